# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

# Writes build_revision.cpp, which holds the git revision of the sources. Runs at every build, in script mode. The file
# changes only with the revision: a commit recompiles this one file.
#   cmake -DOUTPUT=build_revision.cpp -DSOURCE=. [-DREVISION=given] -P revision.cmake
cmake_minimum_required(VERSION 3.22)

if(NOT REVISION)
  find_program(GIT git)
  if(GIT)
    # Always gives the hash, even if there are tags.
    execute_process(COMMAND ${GIT} -C ${SOURCE} describe --always --dirty --abbrev=12 --exclude *
      OUTPUT_VARIABLE REVISION OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET RESULT_VARIABLE failed)
    if(failed)
      set(REVISION "")
    endif()
  endif()
endif()
if(NOT REVISION)
  set(REVISION unknown)
endif()
if(NOT REVISION MATCHES "^[A-Za-z0-9._+~-]+$")
  message(FATAL_ERROR "REDAG_REVISION '${REVISION}' has other characters than letters, digits and . _ + ~ -")
endif()

file(WRITE ${OUTPUT}.new "// Made by redag/cmake/revision.cmake.
#include \"redag/loader/provenance.hpp\"

const char *redag::build_revision() { return \"${REVISION}\"; }
")
file(COPY_FILE ${OUTPUT}.new ${OUTPUT} ONLY_IF_DIFFERENT)
