// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The text of a run, from figures that no run has to produce.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "workload_run.hpp"

namespace redag_rclcpp::lab {
namespace {

using redag::kMicrosecond;
using redag::kMillisecond;
using testing::HasSubstr;

WorkloadRun run() {
  WorkloadRun run;
  run.trace.info.workload.name = "cart";
  run.trace.info.executor = "mte";
  run.trace.info.end = redag::kSecond;
  redag::metrics::TaskSummary imu;
  imu.dag = "control";
  imu.name = "imu";
  imu.jobs.released = 1000;
  imu.jobs.late = 2;
  imu.jobs.skipped = 1;
  imu.jobs.response = {.count = 999, .p50 = 250 * kMicrosecond, .p95 = kMillisecond, .p99 = 2 * kMillisecond};
  imu.jobs.response.max = 12 * kMillisecond;
  redag::metrics::TaskSummary idle;
  idle.dag = "map";
  idle.name = "é";
  run.summary.tasks = {imu, idle};
  redag::metrics::DagSummary control;
  control.name = "control";
  control.jobs.released = 1000;
  control.peak_active = 1;
  control.max_active = 2;
  control.end_to_end.response = imu.jobs.response;
  run.summary.dags = {control};
  return run;
}

TEST(WorkloadReport, HasATableOfTasksAndOneOfDags) {
  EXPECT_THAT(describe(run()), HasSubstr("\n"
                                         "task         jobs  late  skipped  aborted     missed    p50  p95  p99   max\n"
                                         "control.imu  1000     2        1        0  3 (0.3 %)  250us  1ms  2ms  12ms\n"
                                         "map.é           0     0        0        0          -      -    -    -     -\n"
                                         "\n"
                                         "DAG      jobs  missed  end-to-end p50  p99   max  active\n"
                                         "control  1000       0           250us  2ms  12ms     1/2\n"));
}

}  // namespace
}  // namespace redag_rclcpp::lab
