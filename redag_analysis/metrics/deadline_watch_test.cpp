// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/deadline_watch.hpp"

#include <gtest/gtest.h>

#include <string>

#include "redag_analysis/metrics/summary.hpp"
#include "tests/testing/builders.hpp"
#include "tests/testing/trace_builder.hpp"

namespace redag::metrics {
namespace {

using testing::make_dag;
using testing::make_workload;
using testing::TraceBuilder;
constexpr Duration kMs = kMillisecond;

Workload pipeline() {
  Workload workload = make_workload({make_dag("a", {{"sense", 10, 1}, {"act", 0, 1, {0}}})}, 1);
  workload.dags[0].deadline = 6 * kMs;
  return workload;
}

// The judged jobs in order, each as "sense#0 none 1ms/1ms".
std::string seen(const TraceBuilder &builder, Time end_ms) {
  const trace::Trace trace = builder.until(end_ms);
  std::string text;
  const auto say = [&](const JudgedJob &job) {
    const char *words[] = {"none", "lost", "deadline", "end_to_end"};
    const auto number = [](std::optional<Duration> value) { return value ? std::to_string(*value / kMs) : "-"; };
    text += trace.info.workload.dags[0].tasks[job.record.task.value].name + "#" + std::to_string(job.record.number) +
            " " + words[static_cast<int>(job.miss)] + " " + number(job.response) + "/" + number(job.end_to_end) + "; ";
  };
  DeadlineWatch watch(trace.info.workload);
  for (const JobEvent &event : trace.events) watch.add({&event, 1}, say);
  watch.finish(trace.info.end, say);
  return text;
}

TEST(DeadlineWatch, InTime) {
  TraceBuilder t(pipeline());
  t.at(0).arrives("sense", 0).dispatched("sense", 0, 0, 10).at(1).finished("sense", 0, 0);
  t.released("act", 0).ready("act", 0, 0).dispatched("act", 0, 0, 11).at(6).finished("act", 0, 0);
  EXPECT_EQ(seen(t, 10), "sense#0 none 1/-; act#0 none 5/6; ");
}

TEST(DeadlineWatch, TheDeadlineOfTheTaskIsNamedBeforeThatOfTheDag) {
  TraceBuilder t(pipeline());
  t.at(0).arrives("sense", 0).dispatched("sense", 0, 0, 10).at(1).finished("sense", 0, 0);
  t.released("act", 0).ready("act", 0, 0).dispatched("act", 0, 0, 11).at(7).finished("act", 0, 0);
  t.at(10).arrives("sense", 1).dispatched("sense", 1, 0, 20).at(21).finished("sense", 1, 0);
  EXPECT_EQ(seen(t, 30), "sense#0 none 1/-; act#0 end_to_end 6/7; sense#1 deadline 11/-; ");
}

TEST(DeadlineWatch, LostJobsHaveNoResponse) {
  TraceBuilder t(pipeline());
  t.at(0).arrives("sense", 0).at(10).released("sense", 1).skipped("sense", 0, Reason::Overrun);
  t.ready("sense", 1, 10).dispatched("sense", 1, 0, 20).at(11).aborted("sense", 1, 0, Reason::Exception);
  EXPECT_EQ(seen(t, 30), "sense#0 lost -/-; sense#1 lost -/-; ");
}

TEST(DeadlineWatch, NoDataIsNoMiss) {
  TraceBuilder t(pipeline());
  t.at(0).arrives("sense", 0).dispatched("sense", 0, 0, 10).at(1).aborted("sense", 0, 0, Reason::NoData);
  EXPECT_EQ(seen(t, 30), "sense#0 none -/-; ");
}

TEST(DeadlineWatch, InFlightHasAnsweredNoSoonerThanTheEnd) {
  TraceBuilder t(pipeline());
  t.at(0).arrives("sense", 0).dispatched("sense", 0, 0, 10).at(1).finished("sense", 0, 0);
  t.released("act", 0).ready("act", 0, 0).dispatched("act", 0, 0, 11);
  EXPECT_EQ(seen(t, 6), "sense#0 none 1/-; act#0 none 5/6; ");
  EXPECT_EQ(seen(t, 7), "sense#0 none 1/-; act#0 end_to_end 6/7; ");
  EXPECT_EQ(seen(t, 12), "sense#0 none 1/-; act#0 deadline 11/12; ");
  TraceBuilder waiting(pipeline());
  waiting.at(0).released("sense", 0);
  EXPECT_EQ(seen(waiting, 9), "sense#0 none 9/-; ");
}

// docs/model.md, "What is measured": the end-to-end deadline is that of sinks, as in the summary.
TEST(DeadlineWatch, OnlySinksHaveTheEndToEndDeadline) {
  Workload workload = pipeline();
  workload.dags[0].tasks[0].deadline = 20 * kMs;
  TraceBuilder t(workload);
  t.at(0).arrives("sense", 0).dispatched("sense", 0, 0, 20).at(8).finished("sense", 0, 0);
  EXPECT_EQ(seen(t, 9), "sense#0 none 8/-; ");
  EXPECT_EQ(summarize(t.until(9)).dags[0].end_to_end.late, 0U);
}

}  // namespace
}  // namespace redag::metrics
