// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Clusters on one time line: each behaves as the only one would, and the trace checker notices a job in a wrong one.
// everything_test.cpp has the properties of clusters that all runs have.
#include <algorithm>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "redag/derived/clusters.hpp"
#include "redag/derived/demand.hpp"
#include "redag/derived/rng.hpp"
#include "redag/loader/validate.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag_analysis/executors/executors.hpp"
#include "redag_analysis/metrics/check/trace_checker.hpp"
#include "redag_analysis/metrics/jobs.hpp"
#include "redag_analysis/metrics/summary.hpp"
#include "redag_analysis/sim/simulator.hpp"
#include "tests/testing/environment.hpp"
#include "tests/testing/random_workloads.hpp"

namespace redag::testing {
namespace {

constexpr Duration kHorizon = 100 * kMillisecond;

// REDAG_SEED=<n> is the first seed, to replay a failure. REDAG_WORKLOADS=<n> is the number of workloads.
std::string replay(std::uint64_t seed) { return fmt::format("replay with REDAG_SEED={} REDAG_WORKLOADS=1", seed); }

template <class Test>
void for_each_workload(std::uint64_t usual, Test test) {
  const std::uint64_t first = from_environment("REDAG_SEED").value_or(1);
  const std::uint64_t count = from_environment("REDAG_WORKLOADS").value_or(usual);
  for (std::uint64_t seed = first; seed < first + count && !::testing::Test::HasFatalFailure(); ++seed) {
    Rng rng(seed);
    Workload workload = contended(rng);
    divide(rng, workload);
    ASSERT_FALSE(has_errors(validate(workload))) << to_string(validate(workload)) << replay(seed);
    test(workload, seed);
  }
}

std::vector<JobEvent> events_of(const Workload &workload, sched::Scheduler &scheduler, const sim::Options &options) {
  std::vector<JobEvent> all;
  sim::simulate(workload, scheduler, workload.platform.workers, options, [&](std::span<const JobEvent> events) {
    all.insert(all.end(), events.begin(), events.end());
    return true;
  });
  return all;
}

sim::Options options_of(std::uint64_t seed) {
  sim::Options options;
  options.horizon = kHorizon;
  options.seed = seed;
  return options;
}

trace::Trace simulated(const Workload &workload, std::uint64_t seed) {
  trace::Trace trace;
  trace.info.workload = workload;
  trace.info.config = sched::config_of(workload);
  trace.info.executor = "redag";
  trace.info.driver = trace::Driver::Simulator;
  trace.info.seed = seed;
  trace.info.end = kHorizon;
  const auto scheduler = executors::make_scheduler("redag", workload, trace.info.config);
  trace.events = events_of(workload, *scheduler, options_of(seed));
  return trace;
}

// The events of the whole run that are the cluster's, in its own numbers.
std::vector<JobEvent> part_of(const std::vector<JobEvent> &events, const std::vector<TaskPlace> &places,
                              const ClusterPart &part, std::size_t index) {
  std::vector<JobEvent> own;
  for (JobEvent event : events) {
    const TaskPlace &place = places[event.task.value];
    if (place.part != index) continue;
    event.task = place.task;
    if (event.worker != WorkerId::kNoneValue) event.worker -= part.first_worker;
    own.push_back(event);
  }
  return own;
}

TEST(Clustered, EachClusterRunsAsIfItWereAlone) {
  std::uint64_t compared = 0;
  for_each_workload(3000, [&](const Workload &workload, std::uint64_t seed) {
    const std::vector<ClusterPart> parts = parts_of(workload);
    const std::vector<TaskPlace> places = places_in(parts);
    const std::vector<JobEvent> whole = simulated(workload, seed).events;
    for (std::size_t p = 0; p < parts.size(); ++p) {
      const ClusterPart &part = parts[p];
      sched::PriorityScheduler scheduler(part.workload, sched::config_of(part.workload));
      sim::Options options = options_of(seed);
      options.demand = [&](const Task &task, TaskId id, std::uint32_t number) {
        return execution_time(task, part.tasks[id.value], number, seed);
      };
      options.jitter = [&](const Task &task, TaskId id, std::uint32_t number) {
        return release_jitter(task, part.tasks[id.value], number, seed);
      };
      const std::vector<JobEvent> alone = events_of(part.workload, scheduler, options);
      ASSERT_EQ(alone, part_of(whole, places, part, p)) << replay(seed);
      compared += alone.size();
    }
  });
  EXPECT_GT(compared, 0U);
}

// Inversions of several clusters at one time count as one. Where only one cluster has any, they are the whole's.
TEST(Clustered, JobsOfOtherClustersAreNoInversion) {
  std::uint64_t compared = 0;
  for_each_workload(300, [&](const Workload &workload, std::uint64_t seed) {
    const std::vector<ClusterPart> parts = parts_of(workload);
    const std::vector<TaskPlace> places = places_in(parts);
    const trace::Trace whole = simulated(workload, seed);
    std::vector<metrics::Inversions> inverted;
    for (std::size_t p = 0; p < parts.size(); ++p) {
      trace::Trace own = whole;
      own.info.workload = parts[p].workload;
      own.info.config = sched::config_of(parts[p].workload);
      own.events = part_of(whole.events, places, parts[p], p);
      const metrics::Inversions inversions = metrics::summarize(own).inversions;
      if (inversions.count > 0) inverted.push_back(inversions);
    }
    if (inverted.size() > 1) return;
    ASSERT_EQ(metrics::summarize(whole).inversions, inverted.empty() ? metrics::Inversions{} : inverted[0])
        << replay(seed);
    ++compared;
  });
  EXPECT_GT(compared, 30U);
}

TEST(Clustered, TheCheckerNoticesAJobOnAWorkerOfAnotherCluster) {
  std::uint64_t moved = 0;
  for_each_workload(100, [&](const Workload &workload, std::uint64_t seed) {
    trace::Trace trace = simulated(workload, seed);
    const std::vector<ClusterPart> parts = parts_of(workload);
    const std::vector<TaskPlace> places = places_in(parts);
    for (JobEvent &event : trace.events) {
      if (event.kind != JobEventKind::Dispatched || parts.size() < 2) continue;
      event.worker = parts[(places[event.task.value].part + 1) % parts.size()].first_worker;
      const metrics::CheckReport report = metrics::check_trace(trace);
      ASSERT_GT(report.violated(metrics::Rule::Worker), 0U) << replay(seed);
      ASSERT_NE(report.to_string().find("the worker belongs to another cluster"), std::string::npos);
      ++moved;
      break;
    }
  });
  EXPECT_GT(moved, 20U);
}

TEST(Clustered, TheCheckerNoticesATimeThatGoesBackBetweenClusters) {
  for_each_workload(100, [](const Workload &workload, std::uint64_t seed) {
    trace::Trace trace = simulated(workload, seed);
    const std::vector<TaskPlace> places = places_in(parts_of(workload));
    for (std::size_t i = 0; i + 1 < trace.events.size(); ++i) {
      JobEvent &event = trace.events[i];
      JobEvent &next = trace.events[i + 1];
      if (places[event.task.value].part == places[next.task.value].part || event.time == next.time) continue;
      std::swap(event, next);
      ASSERT_GT(metrics::check_trace(trace).violated(metrics::Rule::Stream), 0U) << replay(seed);
      break;
    }
  });
}

// Models of other executors: one instance for each cluster.
TEST(Clustered, EveryExecutorRuns) {
  for_each_workload(30, [](Workload workload, std::uint64_t seed) {
    workload.platform.preemption = PreemptionMode::None;
    for (const executors::ExecutorKind &kind : executors::all()) {
      Workload seen = workload;
      if (kind.single_worker) {
        for (Cluster &cluster : seen.platform.clusters) cluster.workers = 1;
        seen.platform.workers = static_cast<std::uint32_t>(seen.platform.clusters.size());
      }
      trace::Trace trace;
      trace.info.workload = seen;
      trace.info.executor = kind.name;
      trace.info.config = executors::effective_config(kind, sched::config_of(seen));
      trace.info.config.workers = seen.platform.workers;
      trace.info.driver = trace::Driver::Simulator;
      trace.info.seed = seed;
      trace.info.end = kHorizon;
      const auto scheduler = executors::make_scheduler(kind.name, seen, trace.info.config);
      trace.events = events_of(seen, *scheduler, options_of(seed));
      const metrics::CheckReport report = metrics::check_trace(trace, metrics::rules_for(trace.info));
      ASSERT_TRUE(report.ok()) << kind.name << "\n" << report.to_string() << replay(seed);
    }
  });
}

}  // namespace
}  // namespace redag::testing
