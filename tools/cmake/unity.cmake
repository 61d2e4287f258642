# SPDX-FileCopyrightText: The ReDAG-RT developers
# SPDX-License-Identifier: Apache-2.0

# Most builds compile up to 40 sources as one (CMAKE_UNITY_BUILD). It takes about a third of the time, most of which goes
# to templates that the sources share. The preset `dev` compiles each source alone, which keeps rebuilds short;
# tools/check_sources finds missing includes. Included last, when all targets are defined.

# These are compiled alone: another source of their target has an anonymous namespace with the same name in it.
set(alone
  redag/loader/callback_match_test.cpp
  redag_analysis/analyze/examples_test.cpp
  redag_analysis/core/waiting_test.cpp
  redag_analysis/many_workers/dag_shapes_test.cpp
  redag_analysis/many_workers/global_dag_test.cpp
  redag_analysis/many_workers/global_sequential_test.cpp
  redag_analysis/many_workers/suspension_aware_test.cpp
  redag_analysis/metrics/deadline_watch_test.cpp
  redag_analysis/metrics/jobs_test.cpp
  redag_analysis/metrics/perfetto/perfetto_test.cpp
  redag_analysis/metrics/summary_test.cpp
  redag_analysis/metrics/check/trace_checker_test.cpp
  redag_analysis/metrics/why/why_test.cpp
  redag_analysis/one_worker/edf_demand_test.cpp
  redag_analysis/one_worker/paper_test.cpp
  redag_analysis/one_worker/response_time_test.cpp
  redag_analysis/sim/waits_test.cpp
  redag_lab/cli/analyze/analysis_report_test.cpp
  redag_lab/experiment/factorial_plan_test.cpp
  redag_lab/experiment/factorial_test.cpp
  redag_lab/report/schedule_test.cpp
  redag_lab/run/difference_test.cpp
  tests/testing/conformance_test.cpp
  tests/testing/differential_test.cpp
  tests/testing/everything_test.cpp
  tests/testing/kernel_judge.cpp
  tests/testing/late_data_test.cpp
  tests/testing/overload_test.cpp
  tests/testing/schedule_script.cpp)
# What each job passes is compiled alone in optimised builds: beside others GCC inlines less there, and a job costs the
# scheduler 25 % more instructions, and the engine 11 % (tools/count_instructions).
if(NOT CMAKE_BUILD_TYPE STREQUAL "Debug")
  file(GLOB hot RELATIVE ${PROJECT_SOURCE_DIR} CONFIGURE_DEPENDS redag/sched/*.cpp redag/engine/engine*.cpp
    redag/engine/job_placement.cpp redag/engine/release_*.cpp redag/threads/release_*.cpp redag/engine/waiting_jobs.cpp redag_analysis/sim/*.cpp)
  list(FILTER hot EXCLUDE REGEX "_test\\.cpp$")
  list(APPEND alone ${hot})
  # The rest gains nothing from -O3, and compiles in less time without it.
  foreach(target IN ITEMS redag redag_core redag_engine redag_analysis)
    target_compile_options(${target} PRIVATE $<$<CONFIG:Release>:-O2>)
  endforeach()
  list(TRANSFORM hot PREPEND ${PROJECT_SOURCE_DIR}/)
  set_source_files_properties(${hot} DIRECTORY ${PROJECT_SOURCE_DIR}/redag ${PROJECT_SOURCE_DIR}/redag_analysis
    PROPERTIES COMPILE_OPTIONS $<$<CONFIG:Release>:-O3>)
endif()
foreach(source IN LISTS alone)
  if(NOT EXISTS ${PROJECT_SOURCE_DIR}/${source})
    message(FATAL_ERROR "tools/cmake/unity.cmake lists ${source}, which is not there")
  endif()
  set_source_files_properties(${PROJECT_SOURCE_DIR}/${source} DIRECTORY
    ${PROJECT_SOURCE_DIR} ${PROJECT_SOURCE_DIR}/redag ${PROJECT_SOURCE_DIR}/redag_analysis ${PROJECT_SOURCE_DIR}/redag_lab
    PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
endforeach()
