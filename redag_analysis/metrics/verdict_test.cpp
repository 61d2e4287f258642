// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/verdict.hpp"

#include <gtest/gtest.h>

#include "redag/base/time.hpp"

namespace redag::metrics {
namespace {

DagSummary dag(const std::string &name, std::uint64_t released, std::uint64_t late) {
  DagSummary row;
  row.name = name;
  row.jobs.released = released;
  row.jobs.finished = released;
  row.jobs.late = late;
  row.end_to_end.response.count = released;
  return row;
}

JobCounts total_of(const std::vector<DagSummary> &dags) {
  JobCounts total;
  for (const DagSummary &row : dags) total.add_counts(row.jobs);
  return total;
}

DeadlineVerdict verdict(const std::vector<DagSummary> &dags) { return deadline_verdict(total_of(dags), dags); }

TEST(DeadlineVerdict, OneMissOfManyIsAMiss) {
  const std::vector<DagSummary> dags = {dag("control", 20000, 1), dag("planning", 3326, 0)};
  const DeadlineVerdict one = verdict(dags);
  EXPECT_TRUE(one.is_judged);
  EXPECT_FALSE(one.is_met);
  EXPECT_TRUE(has_misses(total_of(dags), dags));
  EXPECT_EQ(one.text,
            "1 of 23 326 jobs missed their deadline (0.0043 %): 1 late. By DAG: control 0.005 % (1 of 20 000), none in "
            "the other one.");
}

TEST(DeadlineVerdict, TheTextBeginsWithTheHeadline) {
  const DeadlineVerdict missed = verdict({dag("control", 20000, 1)});
  EXPECT_EQ(missed.headline, "1 of 20 000 jobs missed their deadline (0.005 %)");
  for (const DeadlineVerdict &one : {missed, verdict({dag("control", 100, 0)}), verdict({})}) {
    EXPECT_TRUE(one.text.starts_with(one.headline + ": ")) << one.text;
  }
}

TEST(DeadlineVerdict, EveryDeadlineWasMet) {
  const std::vector<DagSummary> dags = {dag("control", 100, 0)};
  EXPECT_TRUE(verdict(dags).is_met);
  EXPECT_FALSE(has_misses(total_of(dags), dags));
  EXPECT_EQ(verdict(dags).text, "Every deadline was met: 100 jobs, none late, none lost.");
}

TEST(DeadlineVerdict, ADagThatIsLateEndToEndDidNotMeetEveryDeadline) {
  std::vector<DagSummary> dags = {dag("control", 1000, 0)};
  dags[0].end_to_end.deadline = 2 * kMillisecond;
  dags[0].end_to_end.late = 3;
  EXPECT_FALSE(verdict(dags).is_met);
  EXPECT_TRUE(has_misses(total_of(dags), dags));
  EXPECT_EQ(
      verdict(dags).text,
      "Every job met its own deadline, but end-to-end deadlines were missed: 1 000 jobs, none late, none lost. End to "
      "end, control exceeded its deadline of 2ms 3 of 1 000 times.");
}

TEST(DeadlineVerdict, LostJobsAreMissesAndThoseWithoutDataAreNot) {
  std::vector<DagSummary> dags = {dag("control", 10, 0)};
  dags[0].jobs.skipped = 2;
  dags[0].jobs.aborted = 3;
  dags[0].jobs.by_reason[static_cast<std::size_t>(Reason::NoData)] = 2;
  EXPECT_EQ(verdict(dags).text,
            "3 of 10 jobs missed their deadline (30.0 %): 2 skipped and 1 aborted. By DAG: control 30.0 %.");
}

TEST(DeadlineVerdict, NothingIsNoSuccess) {
  const DeadlineVerdict nothing = verdict({});
  EXPECT_FALSE(nothing.is_judged);
  EXPECT_FALSE(nothing.is_met);
}

}  // namespace
}  // namespace redag::metrics
