# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

# Settings for every target of this project. The top CMakeLists.txt includes this file: the repository's, or that of
# redag/, redag_analysis/ or redag_lab/ if one of these is built alone. redag/ installs this folder, where the other
# packages find it.
set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
# The library is linked into ROS components, which are shared objects.
set(CMAKE_POSITION_INDEPENDENT_CODE ON)
if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
  set(CMAKE_BUILD_TYPE RelWithDebInfo)
endif()

if((CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 11)
   OR (CMAKE_CXX_COMPILER_ID STREQUAL "Clang" AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 14))
  message(FATAL_ERROR "ReDAG-RT needs GCC 11 or clang 14, or newer; this is ${CMAKE_CXX_COMPILER_ID} "
    "${CMAKE_CXX_COMPILER_VERSION}. Choose another with -DCMAKE_CXX_COMPILER=...")
endif()

# colcon and packagers pass this to every package. The tests of these belong to the repository's build: without a use of
# the variable, CMake would warn.
set(ignored "${BUILD_TESTING}")

include(GNUInstallDirs)
list(APPEND CMAKE_MODULE_PATH ${CMAKE_CURRENT_LIST_DIR})
include(${CMAKE_CURRENT_LIST_DIR}/package.cmake)
include(${CMAKE_CURRENT_LIST_DIR}/warnings.cmake)
include(${CMAKE_CURRENT_LIST_DIR}/sanitizers.cmake)
include(${CMAKE_CURRENT_LIST_DIR}/hardening.cmake)

# Messages and debuggers name files by their paths in the repository, on every machine.
if(REDAG_STANDALONE)
  # The last one that fits counts: the build may lie in the folder of the sources.
  add_compile_options(-ffile-prefix-map=${PROJECT_SOURCE_DIR}/=${PROJECT_NAME}/ -ffile-prefix-map=${redag_include_root}/=)
else()
  add_compile_options(-ffile-prefix-map=${redag_include_root}/=)
endif()

# What ccache has compiled for one checkout or workspace serves every other one: it knows files by their paths from the
# folder that holds both sources and build.
find_program(CCACHE ccache)
mark_as_advanced(CCACHE)
if(CCACHE AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  set(common ${PROJECT_SOURCE_DIR})
  cmake_path(IS_PREFIX common ${PROJECT_BINARY_DIR} NORMALIZE is_common)
  while(NOT is_common)
    cmake_path(GET common PARENT_PATH common)
    cmake_path(IS_PREFIX common ${PROJECT_BINARY_DIR} NORMALIZE is_common)
  endwhile()
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env CCACHE_BASEDIR=${common}
    CCACHE_SLOPPINESS=pch_defines,time_macros ${CCACHE})  # else ccache refuses sources with precompiled headers
endif()
