# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

# redag_warnings holds the warning options of every target of this project.
add_library(redag_warnings INTERFACE)
target_compile_options(redag_warnings INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wsign-conversion
  -Wnon-virtual-dtor -Woverloaded-virtual -Wold-style-cast -Wcast-qual)
# GCC 12 mistakes "literal" + std::string for an overlapping copy (GCC bug 105651).
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
  target_compile_options(redag_warnings INTERFACE -Wno-restrict)
endif()
# Takes sources that are compiled as one for headers with anonymous namespaces.
if(CMAKE_UNITY_BUILD AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  target_compile_options(redag_warnings INTERFACE -Wno-subobject-linkage)
endif()
option(REDAG_WERROR "Treat warnings as errors" OFF)
if(REDAG_WERROR)
  target_compile_options(redag_warnings INTERFACE -Werror)
endif()
