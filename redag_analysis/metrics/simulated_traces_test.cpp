// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Tests the checker and our scheduler against each other on random workloads. Also tests the checker against damage: it
// must notice if any event of a good trace is dropped, doubled or shifted.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <array>

#include "redag/base/rng.hpp"
#include "redag_analysis/executors/executors.hpp"
#include "redag_analysis/metrics/summary.hpp"
#include "redag_analysis/metrics/trace_checker.hpp"
#include "redag_analysis/sim/simulator.hpp"
#include "redag_lab/workload/generate.hpp"
#include "redag_testing/builders.hpp"

namespace redag::metrics {
namespace {

bool coin(Rng &rng) { return rng.uniform(0, 1) == 1; }

std::uint32_t pick(Rng &rng, std::int64_t low, std::int64_t high) {
  return static_cast<std::uint32_t>(rng.uniform(low, high));
}

lab::GenerateOptions random_options(Rng &rng) {
  constexpr std::array kModes = {PreemptionMode::None, PreemptionMode::Cooperative, PreemptionMode::Auto};
  lab::GenerateOptions options;
  options.dags = pick(rng, 1, 4);
  options.min_tasks = 1;
  options.max_tasks = pick(rng, 2, 7);
  options.workers = pick(rng, 1, 3);
  options.preemption = kModes[pick(rng, 0, 2)];
  options.policy = static_cast<PolicyKind>(rng.uniform(0, 5));
  // Overload is included, but never more than the smallest number of tasks can have.
  options.utilization = std::min(options.workers * (0.3 + rng.uniform01()), 0.9 * options.dags);
  options.period_max = 50 * kMillisecond;
  options.rates = coin(rng) ? lab::RateScope::PerDag : lab::RateScope::PerTask;
  options.shape = static_cast<lab::DagShape>(rng.uniform(0, 4));
  options.data_share = rng.uniform01();
  options.bcet_min = 0.5;
  options.offsets = coin(rng);
  options.deadline_min = coin(rng) ? 0.5 : 1.0;
  if (coin(rng)) options.jitter = 0.3;
  if (coin(rng)) options.max_active_min = 1, options.max_active_max = 3;
  if (coin(rng)) options.groups = 2, options.group_share = 0.4;
  if (coin(rng)) options.queue_share = 0.5;
  return options;
}

// Adds features that the generator does not draw.
void add_details(Workload &workload, Rng &rng) {
  for (Dag &dag : workload.dags) {
    if (coin(rng)) dag.max_pending = pick(rng, 1, 4);
    for (Task &task : dag.tasks) {
      if (coin(rng)) task.priority = static_cast<int>(rng.uniform(0, 4));
      if (rng.uniform(0, 5) == 0) task.budget = std::max<Duration>(1, task.wcet * 4 / 5);
      if (workload.platform.preemption == PreemptionMode::Cooperative && coin(rng)) {
        task.region = std::max<Duration>(1, task.wcet / rng.uniform(1, 5));
      }
    }
  }
}

/// A random workload and platform, not yet run.
trace::RunInfo drawn(std::uint64_t seed) {
  Rng rng(seed);
  trace::RunInfo info;
  Result<Workload> workload = generate(random_options(rng), seed);
  if (!workload) ADD_FAILURE() << to_string(workload.error());
  add_details(*workload, rng);
  info.executor = "redag";
  info.seed = seed;
  info.config = sched::config_of(*workload);
  info.workload = std::move(*workload);
  if (info.config.preemption == sched::Preemption::Full) {
    if (is_static(info.config.policy) && coin(rng)) info.config.levels = pick(rng, 1, 5);
    if (coin(rng)) info.config.max_started = info.config.workers + pick(rng, 0, 2);
  }
  return info;
}

trace::Trace simulated(trace::RunInfo info, Duration horizon) {
  trace::Trace trace{std::move(info), {}};
  const auto scheduler = executors::make_scheduler(trace.info.executor, trace.info.workload, trace.info.config);
  sim::Options options;
  options.horizon = horizon;
  options.seed = trace.info.seed;
  const auto keep = [&](std::span<const JobEvent> events) {
    trace.events.insert(trace.events.end(), events.begin(), events.end());
    return true;
  };
  trace.info.end = sim::simulate(trace.info.workload, *scheduler, trace.info.config.workers, options, keep).end;
  return trace;
}

RC_GTEST_PROP(SimulatedTraces, KeepEveryRule, ()) {
  const auto seed = *rc::gen::arbitrary<std::uint64_t>();
  const trace::Trace trace = simulated(drawn(seed), 200 * kMillisecond);
  const CheckReport report = check_trace(trace);
  RC_LOG() << report.to_string();
  RC_ASSERT(report.ok());
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

// Without exclusive groups a fully preemptive platform has no priority inversion at all.
RC_GTEST_PROP(SimulatedTraces, FullPreemptionHasNoInversion, ()) {
  const auto seed = *rc::gen::arbitrary<std::uint64_t>();
  trace::RunInfo info = drawn(seed);
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
