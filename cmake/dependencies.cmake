# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

# Finds all packages. The top CMakeLists.txt includes this file, because imported targets are visible only in its folder
# and below. tools/bootstrap installs the packages.
list(APPEND CMAKE_MODULE_PATH ${CMAKE_CURRENT_LIST_DIR})
find_package(fmt REQUIRED)
find_package(LibYAML REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(tl-expected REQUIRED)
find_package(Threads REQUIRED)
find_package(ZLIB REQUIRED)
if(NOT redag_parts STREQUAL "executor")  # the workbench as well
  find_package(CLI11 REQUIRED)
  find_package(TBB REQUIRED)
endif()

if(REDAG_BUILD_TESTS)
  find_package(GTest REQUIRED)
  find_package(rapidcheck REQUIRED)
  find_package(Python3 REQUIRED COMPONENTS Interpreter)
  include(GoogleTest)
endif()
if(REDAG_BUILD_BENCHMARKS)
  find_package(benchmark REQUIRED)
endif()
