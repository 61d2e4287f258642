// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Tests the checker and our scheduler against each other on random workloads. Also tests the checker against damage: it
// must notice if any event of a good trace is dropped, doubled or shifted.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "redag/derived/rng.hpp"
#include "redag/trace/events_file.hpp"
#include "redag_analysis/executors/executors.hpp"
#include "redag_analysis/metrics/check/trace_checker.hpp"
#include "redag_analysis/metrics/summary.hpp"
#include "tests/testing/builders.hpp"
#include "tests/testing/random_workloads.hpp"
#include "tests/testing/timeline.hpp"

namespace redag::metrics {
namespace {

using testing::between;
using testing::chance;
using testing::simulated;

/// A random workload and platform, not yet run.
trace::RunInfo drawn(std::uint64_t seed, bool overload = true) {
  Rng rng(seed);
  trace::RunInfo info = testing::run_info(testing::contended(rng, overload), "redag", seed);
  if (info.config.preemption == sched::Preemption::Full) {
    if (is_static(info.config.policy) && chance(rng, 0.5)) info.config.levels = between(rng, 1, 5);
    if (chance(rng, 0.5)) info.config.max_started = info.config.workers + between(rng, 0, 2);
  }
  return info;
}

RC_GTEST_PROP(SimulatedTraces, KeepEveryRule, ()) {
  const auto seed = *rc::gen::arbitrary<std::uint64_t>();
  const trace::Trace trace = simulated(drawn(seed), 200 * kMillisecond);
  const CheckReport report = check_trace(trace);
  RC_LOG() << report.to_string();
  RC_ASSERT(report.ok());
}

// The holder of a group does not inherit from a job that two more urgent ones keep from both workers.
TEST(SimulatedTraces, AHolderInheritsOnlyFromJobsThatAreLookedAt) {
  Workload workload =
      testing::make_workload({testing::make_dag("a", {{"hold", 39, 4, {}, "g"}}),
                              testing::make_dag("b", {{"x", 30, 1}, {"y", 30, 1, {}, "g"}, {"z", 1, 1}})},
                             2, PreemptionMode::Os);
  workload.policy = PolicyKind::Edf;
  workload.ties = Ties::Fixed;
  const CheckReport report = check_trace(simulated(testing::run_info(workload, "redag", 0), 200 * kMillisecond));
  EXPECT_TRUE(report.ok()) << report.to_string();
}

// A run that is killed leaves a record that ends anywhere. Jobs that would end at the next instant have nothing left.
TEST(SimulatedTraces, KeepEveryRuleUpToAnyCut) {
  const std::string path =
      (std::filesystem::path(::testing::TempDir()) / ("redag_cut." + std::to_string(::getpid()) + ".redag")).string();
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    const trace::Trace whole = simulated(drawn(seed), 100 * kMillisecond);
    const std::size_t step = whole.events.size() / 40 + 1;
    for (std::size_t count = 0; count < whole.events.size(); count += step) {
      trace::EventsWriter writer = trace::EventsWriter::record(path, whole.info).value();
      writer.add(std::span(whole.events).first(count));
      ASSERT_TRUE(writer.flush(0));
      const CheckReport report = check_trace(trace::read_trace(path).value());
      ASSERT_TRUE(report.ok()) << "seed " << seed << ", " << count << " events\n" << report.to_string();
    }
  }
  std::filesystem::remove(path);
}

// Nothing may depend on where time 0 is: a run can begin before it.
RC_GTEST_PROP(SimulatedTraces, KeepEveryRuleAtAnyTime, ()) {
  const auto seed = *rc::gen::arbitrary<std::uint64_t>();
  const trace::Trace trace = simulated(drawn(seed), 100 * kMillisecond);
  trace::Trace shifted = trace;
  const Duration by = *rc::gen::inRange<Duration>(-kSecond, kSecond);
  shifted.info.start += by;
  shifted.info.end += by;
  for (JobEvent &event : shifted.events) {
    event.time += by;
    switch (event.kind) {
      case JobEventKind::Released:
      case JobEventKind::Ready:
      case JobEventKind::Dispatched:
      case JobEventKind::Started:
      case JobEventKind::Finished:
      case JobEventKind::Aborted:
      case JobEventKind::LowMode: event.value += by; break;
      default: break;
    }
  }
  const CheckReport report = check_trace(shifted);
  RC_LOG() << report.to_string();
  RC_ASSERT(report.ok());
  const Summary before = summarize(trace);
  const Summary after = summarize(shifted);
  RC_ASSERT(after.total.missed() == before.total.missed());
  RC_ASSERT(after.inversions.count == before.inversions.count);
  for (std::size_t t = 0; t < before.tasks.size(); ++t) {
    RC_ASSERT(after.tasks[t].jobs.response == before.tasks[t].jobs.response);
  }
}

trace::RunInfo on_peer(trace::RunInfo info, const executors::ExecutorKind &peer) {
  info.executor = peer.name;
  info.config = executors::effective_config(peer, info.config);
  return info;
}

RC_GTEST_PROP(SimulatedTraces, OfPeersKeepTheRulesThatPeersHave, ()) {
  const auto seed = *rc::gen::arbitrary<std::uint64_t>();
  for (const executors::ExecutorKind &kind : executors::all()) {
    if (kind.ours) continue;
    const trace::Trace trace = simulated(on_peer(drawn(seed), kind), 100 * kMillisecond);
    const CheckReport report = check_trace(trace, rules_for(trace.info));
    RC_LOG() << kind.name << ": " << report.to_string();
    RC_ASSERT(report.ok());
  }
}

// Only the events executor keeps every release of a timer, and the checker relies on that.
TEST(SimulatedTraces, AnExecutorThatLosesPeriodsIsNotTheEventsExecutor) {
  trace::RunInfo info;
  info.workload =
      testing::make_workload({testing::make_dag("a", {{"often", 1}}), testing::make_dag("b", {{"heavy", 1, 5}})});
  info.driver = trace::Driver::Simulator;
  for (const char *executor : {"ste", "events"}) {
    trace::Trace trace = simulated(on_peer(info, *executors::find_executor(executor)), 100 * kMillisecond);
    EXPECT_TRUE(check_trace(trace, rules_for(trace.info)).ok()) << executor;
    trace.info.executor = trace.info.executor == "ste" ? "events" : "ste";
    EXPECT_GT(check_trace(trace, rules_for(trace.info)).violated(Rule::Admission), 0U) << executor;
  }
}

RC_GTEST_PROP(SimulatedTraces, SummaryAgreesWithTheEvents, ()) {
  const auto seed = *rc::gen::arbitrary<std::uint64_t>();
  const trace::Trace trace = simulated(drawn(seed), 100 * kMillisecond);
  const Summary summary = summarize(trace);
  std::uint64_t released = 0;
  for (const JobEvent &event : trace.events) released += event.kind == JobEventKind::Released ? 1U : 0U;
  RC_ASSERT(summary.total.released == released);
  RC_ASSERT(summary.total.released ==
            summary.total.finished + summary.total.skipped + summary.total.aborted + summary.total.in_flight);
  RC_ASSERT(summary.all_enforced);
  RC_ASSERT(summary.ignored_events == 0U);
  for (const double busy : summary.worker_busy) RC_ASSERT(busy >= 0.0 && busy <= 1.0);
}

// Without exclusive groups and overload a fully preemptive platform has no priority inversion at all.
RC_GTEST_PROP(SimulatedTraces, FullPreemptionHasNoInversion, ()) {
  const auto seed = *rc::gen::arbitrary<std::uint64_t>();
  trace::RunInfo info = drawn(seed, false);
  info.config.preemption = sched::Preemption::Full;
  info.config.levels = info.config.max_started = 0;
  if (info.config.policy == PolicyKind::Fifo) info.config.policy = PolicyKind::RateMonotonic;
  for (Dag &dag : info.workload.dags) {
    for (Task &task : dag.tasks) task.group.clear();
  }
  const trace::Trace trace = simulated(std::move(info), 100 * kMillisecond);
  RC_ASSERT(summarize(trace).inversions.count == 0U);
}

class DamagedTraces : public ::testing::TestWithParam<int> {};

bool notices(const trace::Trace &trace) { return !check_trace(trace).ok(); }

std::string name_of(const trace::Trace &trace, std::size_t i) {
  const JobEvent &event = trace.events[i];
  return std::string(to_string(event.kind)) + " " + trace::task_name(trace.info.workload, event.task) + "#" +
         std::to_string(event.job) + ", event " + std::to_string(i);
}

// Each event in turn is dropped, doubled, moved by a nanosecond, or given to the next job.
TEST_P(DamagedTraces, AreNoticed) {
  const trace::Trace good = simulated(drawn(static_cast<std::uint64_t>(GetParam())), 60 * kMillisecond);
  ASSERT_FALSE(notices(good));
  for (std::size_t i = 0; i < good.events.size(); ++i) {
    const auto at = static_cast<std::ptrdiff_t>(i);
    const JobEventKind kind = good.events[i].kind;
    trace::Trace damaged = good;
    damaged.events.insert(damaged.events.begin() + at, good.events[i]);
    EXPECT_TRUE(notices(damaged)) << "doubled: " << name_of(good, i);

    damaged = good;
    ++damaged.events[i].job;
    EXPECT_TRUE(notices(damaged)) << "renumbered: " << name_of(good, i);

    if (kind != JobEventKind::Deferred) {  // while no worker is free, nothing else shows a deferral
      damaged = good;
      damaged.events.erase(damaged.events.begin() + at);
      EXPECT_TRUE(notices(damaged)) << "dropped: " << name_of(good, i);
    }

    // Moves the event if that changes no order. A release may move within its jitter.
    const Time next = i + 1 < good.events.size() ? good.events[i + 1].time : kNever;
    if (kind == JobEventKind::Released || kind == JobEventKind::Deferred || next <= good.events[i].time) continue;
    damaged = good;
    ++damaged.events[i].time;
    if (kind == JobEventKind::Finished || kind == JobEventKind::Aborted) ++damaged.events[i].value;
    EXPECT_TRUE(notices(damaged)) << "moved: " << name_of(good, i);
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, DamagedTraces, ::testing::Range(0, 24));

}  // namespace
}  // namespace redag::metrics
