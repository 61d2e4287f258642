// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/jobs.hpp"

#include <gtest/gtest.h>

#include <unistd.h>
#include "redag_analysis/metrics/miss.hpp"

#include <filesystem>
#include <sstream>

#include "redag/loader/text_file.hpp"
#include "redag_analysis/metrics/files/jobs_csv.hpp"
#include "tests/testing/builders.hpp"
#include "tests/testing/trace_builder.hpp"

namespace redag::metrics {
namespace {

using testing::make_dag;
using testing::make_workload;
using testing::TraceBuilder;
constexpr Duration kMs = kMillisecond;

// lo starts, is preempted by hi, and ends late. hi#1 is skipped, hi#2 aborted, and lo#1 is in flight.
TraceBuilder example() {
  Workload w = make_workload({make_dag("a", {{"hi", 10, 1, {}, "", 2}}), make_dag("b", {{"lo", 20, 4, {}, "", 0, 5}})},
                             1, PreemptionMode::Os);
  TraceBuilder t(w);
  t.at(0).arrives("lo", 0).dispatched("lo", 0, 0, 5).at(1).started("lo", 0, 0).at(2).arrives("hi", 0);
  t.preempted("lo", 0, 0).dispatched("hi", 0, 0, 12).at(5).finished("hi", 0, 0).resumed("lo", 0, 0);
  t.at(7).finished("lo", 0, 0).at(12).released("hi", 1).skipped("hi", 1, Reason::DagFull);
  t.at(20).arrives("lo", 1).at(22).released_for("hi", 2, 22).ready("hi", 2, 22).deferred("hi", 2);
  t.at(23).dispatched("hi", 2, 0, 32).at(24).aborted("hi", 2, 0, Reason::Exception);
  return t;
}

TEST(FoldJobs, TakesEveryTimeFromItsEvent) {
  const trace::Trace trace = example().until(30);
  const std::vector<JobRecord> jobs = fold_jobs(trace.info.workload, trace.events);
  ASSERT_EQ(jobs.size(), 5U);

  const JobRecord &lo = jobs[0];
  EXPECT_EQ(lo.task, example().id("lo"));
  EXPECT_EQ(lo.release, 0);
  EXPECT_EQ(lo.start, 1 * kMs);  // Started, not Dispatched
  EXPECT_EQ(lo.finish, 7 * kMs);
  EXPECT_EQ(lo.deadline, 5 * kMs);
  EXPECT_EQ(lo.on_worker, 4 * kMs);
  EXPECT_EQ(lo.preemptions, 1U);
  EXPECT_EQ(lo.lateness(), 2 * kMs);
  EXPECT_EQ(miss_of(lo, 30 * kMs), Miss::Deadline);
  EXPECT_EQ(lo.outcome, JobOutcome::Finished);

  EXPECT_EQ(jobs[1].response(), 3 * kMs);  // hi#0
  EXPECT_EQ(jobs[1].start, 2 * kMs);       // no Started: Dispatched
  EXPECT_NE(miss_of(jobs[1], 30 * kMs), Miss::Deadline);
  EXPECT_EQ(jobs[2].outcome, JobOutcome::Skipped);
  EXPECT_EQ(jobs[2].reason, Reason::DagFull);
  EXPECT_FALSE(jobs[2].has_started());
  EXPECT_EQ(jobs[2].ready, kNever);
  EXPECT_EQ(jobs[3].outcome, JobOutcome::InFlight);  // lo#1, released before hi#2
  EXPECT_EQ(miss_of(jobs[3], 30 * kMs), Miss::Deadline);
  EXPECT_NE(miss_of(jobs[3], 25 * kMs), Miss::Deadline);
  EXPECT_EQ(jobs[4].outcome, JobOutcome::Aborted);
  EXPECT_EQ(jobs[4].reason, Reason::Exception);
  EXPECT_TRUE(jobs[4].deferred);
}

TEST(JobFolder, IsTheSameInAnyPortions) {
  const trace::Trace trace = example().until(30);
  const std::span<const JobEvent> events = trace.events;
  JobFolder whole(trace.info.workload);
  whole.add(events);
  for (std::size_t cut = 0; cut <= events.size(); ++cut) {
    JobFolder parts(trace.info.workload);
    parts.add(events.first(cut));
    std::vector<JobRecord> ended = parts.take_ended();
    parts.add(events.subspan(cut));
    const std::vector<JobRecord> rest = parts.take_ended();
    ended.insert(ended.end(), rest.begin(), rest.end());
    JobFolder again(trace.info.workload);
    again.add(events);
    EXPECT_EQ(ended, again.take_ended());
    EXPECT_EQ(parts.in_flight(), whole.in_flight());
  }
}

// Waits, preemptions and, on threads, a body that ends before the decision to preempt it.
TEST(FoldJobs, CountsTheTimeOnAWorkerAndNoOther) {
  TraceBuilder t(make_workload({make_dag("a", {{"t", 100}})}, 1, PreemptionMode::Os));
  t.at(2).released_for("t", 0, 0).at(3).ready("t", 0, 0).at(7).dispatched("t", 0, 0, 100).at(8).started("t", 0, 0);
  t.at(12).preempted("t", 0, 0).at(18).resumed("t", 0, 0);                                              // 5 ms
  t.at(19).waits("t", 0, 0, 0).at(26).served("t", 0, 0).at(34).woken("t", 0, 0);                        // 1 ms
  t.at(36).resumed("t", 0, 0).at(37).waits("t", 0, 0, -1).at(46).woken("t", 0, -1).resumed("t", 0, 0);  // 1 ms
  trace::Trace trace = t.at(50).preempted("t", 0, 0).finished("t", 0, 0).until(60);                     // 4 ms
  EXPECT_EQ(fold_jobs(trace.info.workload, trace.events).at(0).on_worker, 11 * kMs);
  trace.events.back().value = 48 * kMs;
  EXPECT_EQ(fold_jobs(trace.info.workload, trace.events).at(0).on_worker, 9 * kMs);
}

TEST(JobFolder, CountsWhatItCannotPlace) {
  trace::Trace trace = example().until(30);
  JobFolder folder(trace.info.workload);
  trace.events[3].task = TaskId(99);
  trace.events.back().job = 99;
  folder.add(trace.events);
  EXPECT_EQ(folder.ignored_events(), 2U);
}

std::string csv_of(const trace::Trace &trace, std::size_t most_held) {
  const std::string path =
      (std::filesystem::path(::testing::TempDir()) / ("redag_rows." + std::to_string(::getpid()) + ".csv")).string();
  auto writer = JobsCsvWriter::create(path, trace.info.workload, most_held);
  EXPECT_TRUE(writer);
  for (const JobEvent &event : trace.events) writer->add(std::span(&event, 1));
  EXPECT_TRUE(writer->commit());
  std::string text = read_file(path).value();
  std::filesystem::remove(path);
  return text;
}

std::vector<std::uint64_t> sequences_of(const trace::Trace &trace, std::size_t most_held) {
  std::vector<std::uint64_t> sequences;
  std::istringstream rows(csv_of(trace, most_held));
  std::string row;
  std::getline(rows, row);  // the header
  while (std::getline(rows, row)) sequences.push_back(std::stoull(row));
  return sequences;
}

TEST(JobsCsv, QuotesNamesAndLeavesOutWhatDidNotHappen) {
  trace::Trace trace = example().until(30);
  trace.info.workload.dags[0].name = "odd, \"name\"";
  const std::string text = csv_of(trace, JobsCsvWriter::kMostHeldJobs);
  EXPECT_NE(text.find("\n0,b,lo,0,0,0,1000000,7000000,5000000,0,0,4000000,1,0,finished,none,7000000,7000000,2000000\n"),
            std::string::npos)
      << text;
  EXPECT_NE(text.find(",\"odd, \"\"name\"\"\",hi,"), std::string::npos) << text;
  EXPECT_NE(text.find(",in_flight,none,,,\n"), std::string::npos) << text;
}

// A job in progress for long must not hold all later ones in memory.
TEST(JobsCsv, AJobInProgressHoldsUpOnlySoMany) {
  const Workload w = make_workload({make_dag("a", {{"hi", 10, 1}}), make_dag("b", {{"lo", 1000, 4}})}, 2);
  TraceBuilder t(w);
  t.at(0).arrives("lo", 0).dispatched("lo", 0, 0, 1000);
  for (std::uint32_t job = 0; job < 6; ++job) {
    const Time begin = Time{10} * job;
    t.at(begin).arrives("hi", job).dispatched("hi", job, 1, begin + 10).at(begin + 1).finished("hi", job, 1);
  }
  const trace::Trace trace = t.at(70).finished("lo", 0, 0).arrives("hi", 6).until(80);
  using Sequences = std::vector<std::uint64_t>;
  EXPECT_EQ(sequences_of(trace, 100), (Sequences{0, 1, 2, 3, 4, 5, 6, 7}));
  EXPECT_EQ(sequences_of(trace, 3), (Sequences{1, 2, 3, 4, 5, 6, 0, 7}));
}

}  // namespace
}  // namespace redag::metrics
