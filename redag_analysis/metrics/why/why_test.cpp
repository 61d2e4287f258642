// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/why/why.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <map>
#include <numeric>

#include "redag/derived/demand.hpp"
#include "redag/derived/rng.hpp"
#include "redag_analysis/executors/executors.hpp"
#include "redag_analysis/metrics/why/why_text.hpp"
#include "tests/testing/builders.hpp"
#include "tests/testing/random_workloads.hpp"
#include "tests/testing/timeline.hpp"
#include "tests/testing/trace_builder.hpp"

namespace redag::metrics {
namespace {

using testing::between;
using testing::chance;
using testing::make_dag;
using testing::make_workload;
using testing::simulated;
using testing::TraceBuilder;

Duration sum_of(const Explanation &explanation) {
  return std::accumulate(explanation.parts.begin(), explanation.parts.end(), Duration{0},
                         [](Duration sum, const Part &part) { return sum + part.length; });
}

Duration time_of(const Explanation &explanation, std::initializer_list<Cause> causes, std::optional<JobId> job = {}) {
  Duration sum = 0;
  for (const Part &part : explanation.parts) {
    const bool counts = std::find(causes.begin(), causes.end(), part.cause) != causes.end();
    if (counts && (!job || part.job == *job)) sum += part.length;
  }
  return sum;
}

std::vector<Explanation> explain_all(const trace::Trace &trace, bool end_to_end = false) {
  std::vector<Subject> subjects;
  for (const JobRecord &job : fold_jobs(trace.info.workload, trace.events)) {
    subjects.push_back({{job.task, job.number}, end_to_end});
  }
  return Investigation::of(trace).value().explain(subjects).value();
}

std::vector<Explanation> explain_misses(const trace::Trace &trace) {
  const Investigation investigation = Investigation::of(trace).value();
  return investigation.explain(investigation.misses()).value();
}

std::string to_text(const trace::Trace &trace, const Explanation &explanation) {
  const Workload &workload = trace.info.workload;
  const JobId job{explanation.job.task, explanation.job.number};
  std::string text = headline(explanation, workload) + "\n";
  for (const Part &part : explanation.parts) {
    text += std::to_string(part.length) + " " + describe(part, workload, job) + "\n";
  }
  return text;
}

trace::RunInfo drawn(Rng &rng, std::uint64_t seed) {
  Workload workload = testing::contended(rng);
  if (chance(rng, 0.3)) testing::add_waits(rng, workload);
  trace::RunInfo info = testing::run_info(std::move(workload), "redag", seed);
  if (info.config.preemption == sched::Preemption::Full) {
    if (is_static(info.config.policy) && chance(rng, 0.5)) info.config.levels = between(rng, 1, 5);
    if (chance(rng, 0.5)) info.config.max_started = info.config.workers + between(rng, 0, 2);
  }
  return info;
}

// The end of each job, read from the events themselves.
std::map<JobId, Time> ends_in(const trace::Trace &trace) {
  std::map<JobId, Time> ends;
  for (const JobEvent &event : trace.events) {
    if (event.kind == JobEventKind::Skipped) ends[{event.task, event.job}] = event.time;
    if (event.kind == JobEventKind::Finished || event.kind == JobEventKind::Aborted)
      ends[{event.task, event.job}] = event.value;
  }
  return ends;
}

// Of each job, the time of which decisions took its worker away.
std::map<JobId, Duration> suspended_in(const trace::Trace &trace) {
  std::map<JobId, Time> since;
  std::map<JobId, Duration> total;
  for (const JobEvent &event : trace.events) {
    const JobId job{event.task, event.job};
    if (event.kind == JobEventKind::Preempted) since[job] = event.time;
    if (event.kind == JobEventKind::Waits) since[job] = kNever;
    if (event.kind == JobEventKind::Resumed && since[job] != kNever) total[job] += event.time - since[job];
  }
  return total;
}

void expect_sums(const trace::Trace &trace) {
  const std::map<JobId, Time> ends = ends_in(trace);
  for (const bool end_to_end : {false, true}) {
    for (const Explanation &one : explain_all(trace, end_to_end)) {
      const auto end = ends.find({one.job.task, one.job.number});
      RC_ASSERT(one.end == (end == ends.end() ? std::max(trace.info.end, one.begin) : end->second));
      RC_ASSERT(one.begin == (one.end_to_end ? one.job.origin : one.job.release));
      RC_ASSERT(sum_of(one) == one.end - one.begin);
      Time at = one.begin;
      for (const Part &part : one.parts) {
        RC_ASSERT(part.length > 0);
        RC_ASSERT(part.begin == at);
        at += part.length;
      }
    }
  }
}

// Twenty schedules a seed: 2,000 schedules with the hundred seeds of a test run.
constexpr std::uint64_t kSchedules = 20;

RC_GTEST_PROP(Why, PartsSumExactlyToTheResponseAndTheEndToEndTime, ()) {
  const auto seed = *rc::gen::arbitrary<std::uint64_t>();
  for (std::uint64_t i = 0; i < kSchedules; ++i) {
    Rng rng(kSchedules * seed + i);
    expect_sums(simulated(drawn(rng, kSchedules * seed + i), 20 * kMillisecond));
  }
}

RC_GTEST_PROP(Why, PartsSumExactlyForOtherExecutors, ()) {
  const auto seed = *rc::gen::arbitrary<std::uint64_t>();
  Rng rng(seed);
  for (const executors::ExecutorKind &kind : executors::all()) {
    trace::RunInfo info = testing::run_info(testing::contended(rng), std::string(kind.name), seed);
    expect_sums(simulated(std::move(info), 20 * kMillisecond));
  }
}

// Execution is compared with the demand that the simulator was given, and waiting with the events.
RC_GTEST_PROP(Why, OfASimulationNothingIsUnknownAndExecutionIsTheDemand, ()) {
  const auto seed = *rc::gen::arbitrary<std::uint64_t>();
  for (std::uint64_t i = 0; i < kSchedules; ++i) {
    Rng rng(kSchedules * seed + i);
    const trace::Trace trace = simulated(drawn(rng, kSchedules * seed + i), 20 * kMillisecond);
    for (const Explanation &one : explain_all(trace, true)) RC_ASSERT(time_of(one, {Cause::Unknown}) == 0);
    const std::vector<TaskRef> tasks = flatten(trace.info.workload);
    const std::map<JobId, Duration> suspended = suspended_in(trace);
    for (const Explanation &one : explain_all(trace)) {
      const JobId job{one.job.task, one.job.number};
      RC_LOG() << to_text(trace, one);
      RC_ASSERT(time_of(one, {Cause::Unknown, Cause::HandOver, Cause::Wakeup, Cause::OffProcessor, Cause::OnWorker}) ==
                0);
      if (one.job.outcome != JobOutcome::Finished) continue;
      const Duration demand = execution_time(*tasks[job.task.value].task, job.task, job.number, trace.info.seed);
      RC_ASSERT(time_of(one, {Cause::Execution}, job) == demand);
      const Duration waiting = suspended.contains(job) ? suspended.at(job) : 0;
      RC_ASSERT(one.length() - demand >= waiting);
      RC_ASSERT(time_of(one, {Cause::Preempted}, job) <= waiting);
    }
  }
}

// A trace of any driver, with events missing, must not break the sums.
RC_GTEST_PROP(Why, PartsSumExactlyForDamagedTraces, ()) {
  const auto seed = *rc::gen::arbitrary<std::uint64_t>();
  Rng rng(seed);
  trace::Trace trace = simulated(drawn(rng, seed), 20 * kMillisecond);
  std::erase_if(trace.events, [&](const JobEvent &) { return chance(rng, 0.1); });
  trace.info.driver = static_cast<trace::Driver>(between(rng, 0, 3));
  for (const bool end_to_end : {false, true}) {
    for (const Explanation &one : explain_all(trace, end_to_end)) RC_ASSERT(sum_of(one) == one.length());
  }
}

// hi waits for the device behind lo, which it serves first; then the device serves hi.
TEST(Why, AWaitIsNoDelayAndTheQueueOfADeviceIsOne) {
  Workload workload = make_workload({make_dag("a", {{"hi", 20, 2}}), make_dag("b", {{"lo", 40, 2}})}, 2);
  for (Dag &dag : workload.dags)
    dag.tasks[0].waits = {Wait{kMillisecond, 3 * kMillisecond, 0, DeviceId(std::size_t{0})}};
  workload.platform.devices = {Device{"gpu"}};
  workload.dags[0].tasks[0].offset = kMillisecond;
  const trace::Trace trace = simulated(testing::run_info(workload), 15 * kMillisecond);
  for (const Explanation &one : explain_all(trace)) {
    const bool is_hi = one.job.task == TaskId(0);
    EXPECT_EQ(time_of(one, {Cause::Waited}), 3 * kMillisecond) << to_text(trace, one);
    EXPECT_EQ(time_of(one, {Cause::DeviceQueue}), is_hi ? 2 * kMillisecond : 0) << to_text(trace, one);
    EXPECT_EQ(time_of(one, {Cause::Execution}), 2 * kMillisecond) << to_text(trace, one);
    if (is_hi) {
      EXPECT_NE(to_text(trace, one).find("its device served b.lo#0"), std::string::npos) << to_text(trace, one);
    }
  }
}

// Parts of job d.a#0, all of them queued behind job d.b#7.
std::vector<Part> parts_of_lengths(const std::vector<std::uint16_t> &lengths) {
  Part part;
  part.cause = Cause::Queued;
  part.job = {TaskId(0), 0};
  part.by = {TaskId(1), 7};
  std::vector<Part> parts;
  for (const std::uint16_t length : lengths) {
    part.length = length;
    parts.push_back(part);
  }
  return parts;
}

TEST(Why, ManyPartsAreFewRows) {
  const std::vector<Part> parts = parts_of_lengths({1, 50, 2, 3, 60, 4, 5});
  const Workload workload = make_workload({make_dag("d", {{.name = "a"}, {.name = "b", .period = 10}})});
  std::string text;
  for (const PartRow &row : rows_of(parts, 5)) {
    text += fmt::format("{}: {}\n", row.length(), describe(row, workload, {TaskId(0), 0}));
  }
  EXPECT_EQ(text,
            "1: queued behind d.b#7 (100 Hz)\n"
            "50: queued behind d.b#7 (100 Hz)\n"
            "5: 2 shorter parts, mainly queued behind d.b (5ns)\n"
            "60: queued behind d.b#7 (100 Hz)\n"
            "9: 2 shorter parts, mainly queued behind d.b (9ns)\n");
  EXPECT_EQ(rows_of(parts, 7).size(), 7U);
  EXPECT_TRUE(rows_of({}, 3).empty());
}

RC_GTEST_PROP(Why, RowsHoldEachPartOnceAndInOrder, (const std::vector<std::uint16_t> &lengths, std::uint8_t spare)) {
  const std::vector<Part> parts = parts_of_lengths(lengths);
  const std::size_t most = std::size_t{3} + spare;
  const std::vector<PartRow> rows = rows_of(parts, most);
  RC_ASSERT(rows.size() <= most);
  std::vector<Part> all;
  Duration longest_together = 0;
  for (const PartRow &row : rows) {
    all.insert(all.end(), row.parts.begin(), row.parts.end());
    if (row.parts.size() == 1) continue;
    for (const Part &part : row.parts) longest_together = std::max(longest_together, part.length);
  }
  RC_ASSERT(all == parts);
  // No part that shares a row is longer than one that has its own.
  std::vector<std::uint16_t> sorted = lengths;
  std::sort(sorted.rbegin(), sorted.rend());
  if (longest_together > 0) RC_ASSERT(longest_together <= sorted[(most - 1) / 2 - 1]);
}

TEST(Why, FollowsTheDataBackToTheSource) {
  // Two workers. "b" waits for "a", which is preempted by nothing but queued behind "urgent".
  Workload workload = make_workload({make_dag("u", {{"urgent", 20, 3}, {"urgent2", 20, 3}}),
                                     make_dag("d", {{"a", 100, 2}, {"b", 0, 1, {0}}, {"c", 0, 4, {1}}})},
                                    2);
  workload.dags[1].deadline = 5 * kMillisecond;
  const trace::Trace trace = simulated(testing::run_info(workload), 90 * kMillisecond);
  const std::vector<Explanation> all = explain_misses(trace);
  ASSERT_EQ(all.size(), 1U);
  EXPECT_EQ(to_text(trace, all[0]),
            "d.c#0 missed the end-to-end deadline of 5ms by 5ms\n"
            "3000000 d.a#0: queued behind u.urgent2#0 (50 Hz)\n"
            "2000000 d.a#0: executed\n"
            "1000000 d.b#0: executed\n"
            "4000000 executed\n");
}

TEST(Why, OfAnAndJoinTheWayFollowsTheOldestDataAndTheWaitTheLastOne) {
  Workload workload =
      make_workload({make_dag("d", {{"old", 100, 1}, {"slow", 100, 8, {}, "", 2}, {"join", 0, 1, {0, 1}}})}, 2);
  workload.dags[0].deadline = 5 * kMillisecond;
  const trace::Trace trace = simulated(testing::run_info(workload), 90 * kMillisecond);
  const std::vector<Explanation> all = explain_misses(trace);
  ASSERT_EQ(all.size(), 1U);
  EXPECT_EQ(to_text(trace, all[0]),
            "d.join#0 missed the end-to-end deadline of 5ms by 6ms\n"
            "1000000 d.old#0: executed\n"
            "1000000 d.slow#0: was not released yet\n"
            "8000000 waited for predecessor d.slow#0 (10 Hz)\n"
            "1000000 executed\n");
}

// A less urgent job keeps the worker from 5 to 39. Three jobs queue behind it, and it delays each of them.
TEST(Why, AJobInAQueueWaitsForWhatTheFirstOneWaitsFor) {
  Workload workload = make_workload({make_dag("a", {{.name = "fast", .period = 10}}),
                                     make_dag("b", {{.name = "long", .period = 1000, .wcet = 34, .offset = 5}})});
  workload.dags[0].tasks[0].overrun = Overrun::Queue;
  workload.dags[0].tasks[0].queue_depth = 4;
  const trace::Trace trace = simulated(testing::run_info(std::move(workload), "redag", 1), 100 * kMillisecond);
  for (const Explanation &one : explain_all(trace)) {
    const auto behind = static_cast<Duration>(one.job.number) - 1;
    if (one.job.task != TaskId(0) || behind < 0 || behind > 2) continue;
    EXPECT_EQ(time_of(one, {Cause::Blocked}), (29 - 10 * behind) * kMillisecond);
    EXPECT_EQ(time_of(one, {Cause::OwnTask}), behind * kMillisecond) << "those before it execute";
  }
}

TEST(Why, WithoutAMissThereAreTheJobsClosestToTheirDeadlines) {
  const trace::Trace trace =
      simulated(testing::run_info(make_workload({make_dag("d", {{"a", 10, 1}, {"b", 10, 2}})}, 1)), 50 * kMillisecond);
  const Investigation investigation = Investigation::of(trace).value();
  EXPECT_TRUE(investigation.misses().empty());
  const std::vector<Subject> closest = investigation.closest(3);
  ASSERT_EQ(closest.size(), 2U);
  EXPECT_EQ(to_text(trace, investigation.explain(closest).value()[0]),
            "d.b#0 met its deadline of 10ms with 7ms to spare\n"
            "1000000 queued behind d.a#0 (100 Hz)\n"
            "2000000 executed\n");
}

// One callback runs after the other, and max_active of the workload is no reason.
// Each job meets its own deadline of 10 ms. The chain takes 4 ms, and its deadline is 3 ms.
TEST(Why, JobsLateEndToEndOnlyAreCountedApart) {
  Workload workload = make_workload({make_dag("d", {{"a", 10, 2}, {"b", 0, 2, {0}}})});
  workload.dags[0].deadline = 3 * kMillisecond;
  const trace::Trace trace = simulated(testing::run_info(workload), 50 * kMillisecond);
  const Investigation investigation = Investigation::of(trace).value();
  EXPECT_EQ(investigation.counted(), 10U);
  EXPECT_EQ(investigation.missed(), 0U);
  EXPECT_EQ(investigation.late_end_to_end(), 5U);
  EXPECT_EQ(investigation.misses().size(), 5U);
}

TEST(Why, OtherExecutorsHaveNoMaxActiveAndNoOrder) {
  Workload workload = make_workload({make_dag("d", {{"a", 10, 3}, {"b", 10, 2}})}, 1, PreemptionMode::None);
  workload.dags[0].max_active = 1;
  const trace::Trace trace = simulated(testing::run_info(workload, "ste"), 50 * kMillisecond);
  Duration queued = 0;
  for (const Explanation &one : explain_all(trace)) {
    EXPECT_EQ(time_of(one, {Cause::MaxActive, Cause::Blocked, Cause::Demoted}), 0) << to_text(trace, one);
    queued += time_of(one, {Cause::Queued});
  }
  EXPECT_GT(queued, 0);
}

// ---- what only threads show: a record of events by hand ----

TraceBuilder on_threads() {
  TraceBuilder builder(make_workload({make_dag("d", {{"a", 100, 2}, {"b", 0, 1, {0}}})}, 1));
  builder.at(1).released_for("a", 0, 0).ready("a", 0, 0);
  builder.at(2).dispatched("a", 0, 0, 100).at(3).started("a", 0, 0);
  return builder;
}

trace::Trace threads_trace(const TraceBuilder &builder) {
  trace::Trace trace = builder.until(90);
  trace.info.driver = trace::Driver::Threads;
  return trace;
}

TEST(Why, ThreadsShowLateReleasesWakeupsAndTimeWithoutExecution) {
  const trace::Trace trace = threads_trace(
      on_threads().at(13).executed("a", 0, 0, 5).finished("a", 0, 0).at(14).released_for("b", 0, 13).ready("b", 0, 0));
  EXPECT_EQ(to_text(trace, explain_all(trace)[0]),
            "d.a#0 met its deadline of 100ms with 87ms to spare\n"
            "1000000 its timer fired late\n"
            "1000000 unknown\n"
            "1000000 its thread woke up late\n"
            "2000000 executed\n"
            "3000000 executed beyond its wcet of 2ms\n"
            "5000000 stood still: its body waited, or another program ran\n");
  EXPECT_EQ(explain_all(trace)[1].parts.front().cause, Cause::HandOver);
}

TEST(Why, WithoutProcessorTimeItIsUnknownWhetherAJobExecuted) {
  const trace::Trace trace = threads_trace(on_threads().at(13).finished("a", 0, 0));
  EXPECT_EQ(time_of(explain_all(trace)[0], {Cause::OnWorker}), 10 * kMillisecond);
}

}  // namespace
}  // namespace redag::metrics
