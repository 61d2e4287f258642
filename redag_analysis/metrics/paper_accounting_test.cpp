// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/paper_accounting.hpp"

#include <gtest/gtest.h>

#include "tests/testing/builders.hpp"

namespace redag::metrics {
namespace {

Workload one_timer() { return testing::make_workload({testing::tick_dag("d", {{"t", 10, 1}})}); }

JobRecord job(std::uint32_t number, JobOutcome outcome, Time finish) {
  JobRecord record;
  record.task = TaskId(0);
  record.number = number;
  record.release = Time{number} * 10;
  record.outcome = outcome;
  record.finish = finish;
  record.deadline = record.release + 10;
  return record;
}

TEST(PaperAccounting, ItsClockFallsBehindWithEveryDroppedRelease) {
  // All are on time, but the second release was dropped. The paper's program takes the third for the second, and thus
  // for late.
  const std::vector<JobRecord> jobs = {job(0, JobOutcome::Finished, 5), job(1, JobOutcome::Skipped, 20),
                                       job(2, JobOutcome::Finished, 25), job(3, JobOutcome::Finished, 35)};
  const PaperCount count = paper_count(one_timer(), jobs, 0);
  EXPECT_EQ(count.jobs, 3U);
  EXPECT_EQ(count.late, 2U);
  EXPECT_EQ(count.max_lateness, 5);
}

TEST(PaperAccounting, AnEpochBeforeStartUpMakesJobsLate) {
  const std::vector<JobRecord> jobs = {job(0, JobOutcome::Finished, 6), job(1, JobOutcome::Finished, 14)};
  EXPECT_EQ(paper_count(one_timer(), jobs, 0).late, 0U);
  EXPECT_EQ(paper_count(one_timer(), jobs, 5).late, 1U);
  EXPECT_EQ(paper_count(one_timer(), jobs, 7).late, 2U);
}

// Timers of ROS 2 begin when their nodes are created.
TEST(PaperAccounting, TheGridBeginsWithTheFirstRelease) {
  std::vector<JobRecord> jobs = {job(0, JobOutcome::Finished, 1005), job(1, JobOutcome::Finished, 1015)};
  for (JobRecord &one : jobs) one.release += 1000;
  EXPECT_EQ(paper_count(one_timer(), jobs, 0).late, 0U);
  EXPECT_EQ(paper_count(one_timer(), jobs, 0).max_lateness, -5);
}

TEST(PaperAccounting, OnlyTimersOfTheDagThatFinished) {
  Workload workload = one_timer();
  workload.dags.push_back(workload.dags[0]);
  workload.dags[1].tasks[0].activation = Activation::Data;
  std::vector<JobRecord> jobs = {job(0, JobOutcome::Finished, 6), job(1, JobOutcome::InFlight, kNever)};
  jobs.push_back(job(0, JobOutcome::Finished, 100));
  jobs.back().task = TaskId(1);
  EXPECT_EQ(paper_count(workload, jobs, 0).jobs, 1U);
  EXPECT_EQ(paper_count(workload, jobs, 0, DagId(0)).jobs, 1U);
  EXPECT_EQ(paper_count(workload, jobs, 0, DagId(1)).jobs, 0U);
  EXPECT_EQ(paper_count(workload, jobs, 0, DagId(1)).max_lateness, std::nullopt);
}

}  // namespace
}  // namespace redag::metrics
