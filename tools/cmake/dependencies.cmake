# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

# Finds what any part of the repository needs. The top CMakeLists.txt includes this file, because imported targets are
# visible only in its folder and below. A package that is built alone finds what it needs in its own CMakeLists.txt.
# tools/bootstrap installs the packages.
find_package(CLI11 REQUIRED)
set(CURSES_NEED_WIDE TRUE)
find_package(Curses REQUIRED)
find_package(fmt REQUIRED)
find_package(LibYAML REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(PkgConfig REQUIRED)
find_package(TBB REQUIRED)
find_package(Threads REQUIRED)
find_package(tl-expected REQUIRED)
find_package(ZLIB REQUIRED)

if(REDAG_BUILD_TESTS)
  list(APPEND CMAKE_MODULE_PATH ${CMAKE_CURRENT_LIST_DIR})
  find_package(GTest REQUIRED)
  find_package(Protozero REQUIRED)
  find_package(rapidcheck REQUIRED)
  find_package(Python3 REQUIRED COMPONENTS Interpreter)
  include(GoogleTest)
endif()
if(REDAG_BUILD_BENCHMARKS)
  find_package(benchmark REQUIRED)
endif()
