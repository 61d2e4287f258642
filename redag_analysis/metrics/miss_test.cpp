// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/miss.hpp"

#include <gtest/gtest.h>

namespace redag::metrics {
namespace {

JobRecord job(JobOutcome outcome, Time finish) {
  JobRecord record;
  record.release = 0;
  record.deadline = 10;
  record.origin = -5;
  record.finish = finish;
  record.outcome = outcome;
  return record;
}

TEST(Miss, AFinishedJobIsLateAfterItsDeadline) {
  EXPECT_EQ(miss_of(job(JobOutcome::Finished, 10), 100), Miss::None);
  EXPECT_EQ(miss_of(job(JobOutcome::Finished, 11), 100), Miss::Deadline);
}

TEST(Miss, AJobInFlightIsLateOnceItsDeadlineHasPassed) {
  EXPECT_EQ(miss_of(job(JobOutcome::InFlight, kNever), 10), Miss::None);
  EXPECT_EQ(miss_of(job(JobOutcome::InFlight, kNever), 11), Miss::Deadline);
}

TEST(Miss, SkippedAndAbortedJobsAreLostButNotWithoutData) {
  EXPECT_EQ(miss_of(job(JobOutcome::Skipped, 1), 100), Miss::Lost);
  EXPECT_EQ(miss_of(job(JobOutcome::Aborted, 1), 100), Miss::Lost);
  JobRecord empty = job(JobOutcome::Aborted, 20);
  empty.reason = Reason::NoData;
  EXPECT_EQ(miss_of(empty, 100, 1), Miss::None);
}

TEST(Miss, EndToEndCountsFromTheOrigin) {
  EXPECT_EQ(miss_of(job(JobOutcome::Finished, 9), 100, 14), Miss::None);
  EXPECT_EQ(miss_of(job(JobOutcome::Finished, 9), 100, 13), Miss::EndToEnd);
  EXPECT_EQ(miss_of(job(JobOutcome::Finished, 11), 100, 13), Miss::Deadline) << "its own deadline first";
  EXPECT_TRUE(is_late_end_to_end(job(JobOutcome::Finished, 11), 100, 13));
  EXPECT_TRUE(is_late_end_to_end(job(JobOutcome::InFlight, kNever), 9, 13));
  EXPECT_FALSE(is_late_end_to_end(job(JobOutcome::InFlight, kNever), 8, 13));
  EXPECT_FALSE(is_late_end_to_end(job(JobOutcome::Finished, 99), 100, 0)) << "no deadline";
  EXPECT_FALSE(is_late_end_to_end(job(JobOutcome::Skipped, 99), 100, 13)) << "it never answers";
  JobRecord waiting = job(JobOutcome::InFlight, kNever);
  waiting.origin = kNever;
  EXPECT_FALSE(is_late_end_to_end(waiting, 99, 13)) << "it carries no data yet";
}

}  // namespace
}  // namespace redag::metrics
