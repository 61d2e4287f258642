// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The memory that a report takes does not depend on the length of its run.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "redag_lab/report/digest.hpp"
#include "tests/testing/allocation_counter.hpp"
#include "tests/testing/builders.hpp"
#include "tests/testing/timeline.hpp"

namespace redag::report {
namespace {

// Has misses, preemptions, and jobs that wait for max_active and for data.
Workload busy() {
  Workload workload = testing::make_workload(
      {testing::make_dag("fast", {{"a", 5, 1}, {"b", 0, 1, {0}}}),
       testing::make_dag("slow", {{"c", 10, 3}, {"d", 10, 3}}, 1), testing::make_dag("late", {{"e", 20, 12}})},
      2, PreemptionMode::Os);
  workload.dags[0].deadline = kMillisecond;
  return workload;
}

struct Measured {
  std::int64_t bytes = 0;
  std::uint64_t jobs = 0;
  std::uint64_t misses = 0;
};

Measured report_of_run(Duration length) {
  const std::filesystem::path file =
      std::filesystem::temp_directory_path() / ("redag_memory_" + std::to_string(::getpid()) + ".redag");
  EXPECT_TRUE(trace::write_trace(file.string(), testing::simulated(testing::run_info(busy()), length)));
  DigestOptions options;
  options.most_slices = 2'000;
  options.exact_jobs = 1'000;
  options.most_explained = 500;
  Measured measured;
  {
    const testing::PeakMemory peak;
    const trace::Recording run = trace::Recording::open(file.string()).value();
    GroupReader reader("long", options);
    EXPECT_TRUE(reader.add("", run));
    const Group group = reader.finish();
    measured = {peak.bytes(), group.total.released, group.why.misses};
    EXPECT_EQ(group.why.explained, options.most_explained);
  }
  std::filesystem::remove(file);
  return measured;
}

TEST(Memory, OfAReportIsThatOfATenthOfTheRun) {
  const Measured tenth = report_of_run(40 * kSecond);
  const Measured whole = report_of_run(400 * kSecond);
  ASSERT_GT(tenth.misses, 1'000U);
  ASSERT_GT(whole.jobs, 9 * tenth.jobs);
  EXPECT_LE(static_cast<double>(whole.bytes), 1.1 * static_cast<double>(tenth.bytes));
  // All jobs of the run in memory would take three times as much.
  EXPECT_LT(static_cast<std::size_t>(whole.bytes) * 3, whole.jobs * sizeof(metrics::JobRecord));
}

}  // namespace
}  // namespace redag::report
