# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

# Builds the tests beside the sources: one program for each group of folders, redag_<group>_test. In ctest each test is
# <group>.<name>, with the group as label (`ctest -L '^sched$'`). Included by the repository's CMakeLists.txt.
set(base redag/base)
set(live redag/live)
set(model redag/model redag/derived redag/loader)
set(sched redag/sched)
set(trace redag/trace)
set(runtime redag/threads redag/engine redag/runtime)
set(executors redag_analysis/executors)
set(metrics redag_analysis/metrics)
set(sim redag_analysis/sim)
set(text redag_analysis/text)
set(analysis redag_analysis/core redag_analysis/one_worker redag_analysis/many_workers redag_analysis/any_features
  redag_analysis/peers redag_analysis/analyze)
foreach(group IN ITEMS workload run search report experiment robot import doctor cli)
  set(${group} redag_lab/${group})
endforeach()
set(testing tests/testing)
set(test_groups base live model sched trace runtime executors metrics sim text analysis workload run search report experiment
  robot import doctor cli testing)

redag_sources(testing_sources tests/testing)
add_library(redag_testing STATIC ${testing_sources})
# Everything that tests may use: a test program names no further libraries.
target_link_libraries(redag_testing
  PUBLIC redag_lab fmt::fmt LibYAML::LibYAML nlohmann_json::nlohmann_json Protozero::Protozero GTest::gtest GTest::gmock rapidcheck
  PRIVATE redag_warnings)
# Only this source depends on where the sources lie: ccache finds the others again for another checkout.
set_source_files_properties(tests/testing/repository.cpp PROPERTIES
  COMPILE_DEFINITIONS REDAG_SOURCE_DIR="${PROJECT_SOURCE_DIR}")

# A sanitized program takes most of a second to start, longer than most tests take. So a few processes run all of its tests.
function(redag_add_shards group program)
  set(shards 4)
  foreach(shard RANGE 1 ${shards})
    math(EXPR index "${shard} - 1")
    set(environment GTEST_TOTAL_SHARDS=${shards} GTEST_SHARD_INDEX=${index})
    if(REDAG_SANITIZE STREQUAL "thread")
      # The oneTBB of run.Difference is not instrumented.
      list(APPEND environment GTEST_FILTER=-Difference.*)
    endif()
    add_test(NAME ${group}.${shard}_of_${shards} COMMAND ${program} --gtest_brief=1)
    set_tests_properties(${group}.${shard}_of_${shards} PROPERTIES LABELS ${group} TIMEOUT 900 ENVIRONMENT "${environment}")
  endforeach()
endfunction()

# All test programs share these headers. A test compiles in up to a quarter less time with them. `dev` has none: it finds
# missing includes.
function(redag_precompile program)
  if(NOT CMAKE_UNITY_BUILD)
    return()
  endif()
  # Without it, ccache refuses GCC's precompiled headers.
  target_compile_options(${program} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-fpch-preprocess>)
  get_property(first GLOBAL PROPERTY redag_precompiled)
  if(first)
    target_precompile_headers(${program} REUSE_FROM ${first})
    return()
  endif()
  set_property(GLOBAL PROPERTY redag_precompiled ${program})
  target_precompile_headers(${program} PRIVATE <algorithm> <chrono> <filesystem> <fstream> <functional> <map> <optional>
    <random> <set> <sstream> <string> <thread> <variant> <vector> <fmt/format.h> <gmock/gmock.h> <gtest/gtest.h>
    <nlohmann/json.hpp> <rapidcheck.h> <tl/expected.hpp>)
endfunction()

# redag_add_test_program(<group> <source>...)
function(redag_add_test_program group)
  set(program redag_${group}_test)
  add_executable(${program} ${ARGN})
  target_link_libraries(${program} PRIVATE redag_testing GTest::gtest_main redag_warnings)
  redag_precompile(${program})
  if(REDAG_SANITIZE)
    redag_add_shards(${group} ${program})
    return()
  endif()
  # Printed values would be addresses, which rename the tests at every build.
  gtest_discover_tests(${program} TEST_PREFIX ${group}. NO_PRETTY_VALUES DISCOVERY_TIMEOUT 60
    PROPERTIES LABELS ${group} TIMEOUT 300)
endfunction()

foreach(group IN LISTS test_groups)
  set(tests)
  foreach(folder IN LISTS ${group})
    file(GLOB_RECURSE found CONFIGURE_DEPENDS ${folder}/*_test.cpp)
    list(APPEND tests ${found})
  endforeach()
  if(tests)
    redag_add_test_program(${group} ${tests})
  endif()
endforeach()
target_link_libraries(redag_cli_test PRIVATE redag_commands)
add_dependencies(redag_cli_test redag_cli)

# Builds the tests that use threads, for runs under ThreadSanitizer.
add_custom_target(redag_concurrency_tests)
add_dependencies(redag_concurrency_tests redag_base_test redag_live_test redag_trace_test redag_runtime_test redag_run_test)
