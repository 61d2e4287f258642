// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The bounds of analyze() against every schedule of tiny task sets: the scheduler that runs for real is simulated with
// each combination of release jitters and execution times.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <numeric>

#include <fmt/format.h>

#include "redag/sched/priority_scheduler.hpp"
#include "redag_analysis/analyze/analyze.hpp"
#include "redag_analysis/sim/simulator.hpp"
#include "tests/testing/bound_property.hpp"

namespace redag::analysis {
namespace {

using testing::BoundCase;

// Unlike testing::random_bound_case(), with hyperperiods so short that every schedule of one can be simulated.
BoundCase random_case(Rng &rng, std::uint32_t workers, sched::Preemption preemption) {
  constexpr std::array<Duration, 5> kPeriods{4, 6, 8, 12, 24};
  constexpr std::array<PolicyKind, 5> kPolicies{PolicyKind::RateMonotonic, PolicyKind::DeadlineMonotonic,
                                                PolicyKind::Fixed, PolicyKind::ChainAware, PolicyKind::Edf};
  const auto chance = [&](double probability) { return rng.uniform01() < probability; };
  BoundCase result;
  result.platform.workers = workers;
  result.platform.preemption = preemption;
  result.platform.dispatch_overhead = chance(0.2) ? 1 : 0;
  Workload &workload = result.workload;
  workload.policy = kPolicies[static_cast<std::size_t>(rng.uniform(0, kPolicies.size() - 1))];
  workload.ties = chance(0.7) ? Ties::Share : Ties::Fixed;
  const std::int64_t dags = rng.uniform(1, 2 + workers);
  std::uint32_t names = 0;
  for (std::int64_t d = 0; d < dags; ++d) {
    Dag dag;
    dag.name = fmt::format("d{}", d);
    const Duration period = kPeriods[static_cast<std::size_t>(rng.uniform(0, kPeriods.size() - 1))];
    const Time offset = chance(0.5) ? 0 : rng.uniform(0, period);
    const std::int64_t tasks = chance(0.5) ? 1 : rng.uniform(2, workers == 1 ? 3 : 4);
    for (std::uint32_t i = 0; i < tasks; ++i) {
      Task task;
      task.name = fmt::format("t{}", names++);
      task.period = period;
      task.wcet = rng.uniform(1, 3);
      const bool varies = chance(0.4);
      task.bcet = varies ? rng.uniform(1, task.wcet) : task.wcet;
      task.deadline = rng.uniform(std::min(task.wcet, period), period);
      task.priority = static_cast<int>(rng.uniform(0, 3));
      for (std::uint32_t p = 0; p < i; ++p) {
        if (chance(0.5)) task.predecessors.push_back(p);
      }
      const bool data = workload.policy != PolicyKind::Edf && !task.predecessors.empty() && chance(0.6);
      task.activation = data ? Activation::Data : Activation::Timer;
      if (!data) {
        task.offset = offset;
        if (chance(0.3)) task.jitter = rng.uniform(0, 2);
      }
      if (chance(0.2)) task.group = "g";
      dag.tasks.push_back(std::move(task));
    }
    if (chance(0.4)) dag.max_active = static_cast<std::uint32_t>(rng.uniform(1, tasks));
    workload.dags.push_back(std::move(dag));
  }
  return result;
}

struct Demand {
  Duration jitter = 0;
  Duration execution = 0;
};
using Demands = std::vector<std::vector<Demand>>;  // by TaskId, by job number

// Adds what one schedule shows to the largest responses, by TaskId. Returns the number of skipped jobs.
int simulate(const BoundCase &bound_case, const TaskSet &task_set, const Demands &demands, Time horizon,
             std::vector<Duration> &worst) {
  const sched::Config config = config_of(bound_case.platform, bound_case.workload);
  sched::PriorityScheduler scheduler(bound_case.workload, config);
  sim::Options options;
  options.horizon = horizon;
  options.overheads.dispatch = bound_case.platform.dispatch_overhead;
  options.demand = [&](const Task &, TaskId id, std::uint32_t number) { return demands[id.value][number].execution; };
  options.jitter = [&](const Task &, TaskId id, std::uint32_t number) {
    return number < demands[id.value].size() ? demands[id.value][number].jitter : 0;
  };
  int skipped = 0;
  std::vector<std::vector<Time>> released(task_set.tasks.size());  // by TaskId, by job number
  sim::simulate(bound_case.workload, scheduler, config.workers, options, [&](std::span<const JobEvent> events) {
    for (const JobEvent &event : events) {
      skipped += event.kind == JobEventKind::Skipped ? 1 : 0;
      if (event.kind == JobEventKind::Released) released[event.task.value].push_back(event.value);
      if (event.kind != JobEventKind::Finished) continue;
      const Duration response = event.value - released[event.task.value][event.job];
      worst[event.task.value] = std::max(worst[event.task.value], response);
    }
    return skipped == 0;
  });
  return skipped;
}

// The jobs that are released before the horizon, and what can vary of them.
struct Choices {
  struct Choice {
    Duration *value;
    Duration low, high;
  };

  Choices(const TaskSet &task_set, Time horizon) : demands(task_set.tasks.size()) {
    for (std::size_t t = 0; t < demands.size(); ++t) {
      const CompiledTask &task = task_set.tasks[t];
      const Unit &unit = task_set.units[task.unit];
      const Time first = task_set.tasks[unit.tasks.front()].offset;
      if (first < horizon) demands[t].resize(static_cast<std::size_t>((horizon - first - 1) / unit.period + 1));
      for (Demand &demand : demands[t]) {
        add({&demand.execution, task.bcet - task.overhead, task.wcet - task.overhead});
        add({&demand.jitter, 0, task.data ? 0 : task.jitter});
      }
    }
  }

  void add(const Choice &choice) {
    *choice.value = choice.low;
    const auto values = static_cast<std::uint64_t>(choice.high - choice.low + 1);
    combinations = std::min<std::uint64_t>(combinations * values, std::uint64_t{1} << 40U);
    all.push_back(choice);
  }

  // Counts up; false after the last combination.
  bool next() {
    for (const Choice &choice : all) {
      if (*choice.value < choice.high) {
        ++*choice.value;
        return true;
      }
      *choice.value = choice.low;
    }
    return false;
  }

  Demands demands;
  std::vector<Choice> all;
  std::uint64_t combinations = 1;
};

void expect_every_schedule_within_bounds(std::uint32_t workers, sched::Preemption preemption) {
  const std::uint64_t wanted = testing::how_many(200);
  std::uint64_t compared = 0;
  std::uint64_t reached = 0;
  std::uint64_t tasks = 0;
  for (std::uint64_t seed = 1; compared < wanted && seed < 200 * wanted; ++seed) {
    Rng rng(mix(seed));
    const BoundCase bound_case = random_case(rng, workers, preemption);
    const TaskSet task_set = testing::compiled(bound_case);
    const Report report = analyze(task_set);
    const auto has_bound = [](const Tightest &task) { return task.response.has_value(); };
    if (!std::all_of(report.tasks.begin(), report.tasks.end(), has_bound)) continue;
    Duration hyperperiod = 1;
    Time last_offset = 0;
    for (const CompiledTask &task : task_set.tasks) {
      hyperperiod = std::lcm(hyperperiod, task.period);
      last_offset = std::max(last_offset, task.offset);
    }
    const Time horizon = last_offset + hyperperiod;
    Choices choices(task_set, horizon);
    if (choices.combinations > 4000) continue;
    ++compared;
    std::vector<Duration> worst(task_set.tasks.size(), 0);
    int skipped = 0;
    do {
      skipped += simulate(bound_case, task_set, choices.demands, horizon, worst);
    } while (choices.next());
    const bool can_lose =
        std::any_of(report.tasks.begin(), report.tasks.end(), [](const Tightest &task) { return task.bound.of_ended; });
    ASSERT_TRUE(skipped == 0 || can_lose) << "seed " << seed << "\n" << describe(bound_case);
    for (std::size_t t = 0; t < worst.size(); ++t) {
      ASSERT_LE(worst[t], *report.tasks[t].response)
          << report.tasks[t].method->name << ", task " << t << ", seed " << seed << "\n"
          << describe(bound_case);
      if (can_lose) continue;
      reached += worst[t] == *report.tasks[t].response ? 1U : 0U;
      ++tasks;
    }
  }
  EXPECT_EQ(compared, wanted);
  EXPECT_GT(reached * 4, tasks) << "of " << tasks << " bounds " << reached << " are reached";
}

TEST(EverySchedule, OfOneWorkerIsWithinTheBounds) {
  expect_every_schedule_within_bounds(1, sched::Preemption::None);
  expect_every_schedule_within_bounds(1, sched::Preemption::Full);
}

TEST(EverySchedule, OfSeveralWorkersIsWithinTheBounds) {
  for (const std::uint32_t workers : {2U, 3U}) {
    expect_every_schedule_within_bounds(workers, sched::Preemption::None);
    expect_every_schedule_within_bounds(workers, sched::Preemption::Full);
  }
}

}  // namespace
}  // namespace redag::analysis
