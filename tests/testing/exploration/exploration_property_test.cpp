// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Compares the exploration with the scheduler that runs for real: on tiny task sets with every release jitter and
// execution time, on larger ones with random ones. Also compares it with the bounds, which hold for more than it does.
#include "tests/testing/exploration/exploration.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>

#include <fmt/format.h>

#include "redag/sched/priority_scheduler.hpp"
#include "redag_analysis/analyze/analyze.hpp"
#include "redag_analysis/one_worker/response_time.hpp"
#include "redag_analysis/sim/simulator.hpp"
#include "tests/testing/bound_property.hpp"

namespace redag::analysis {
namespace {

using testing::BoundCase;
using testing::compiled;
using testing::describe;

// ---- random task sets ----

struct Limits {
  std::uint32_t workers = 1;
  std::uint32_t max_dags = 3;
  std::uint32_t max_tasks = 3;  // in a DAG with edges
  Duration max_wcet = 3;
  Duration scale = 1;  // a factor on all times
  bool rich = false;   // more jitter and more varied execution times than can be enumerated
};

// Unlike testing::random_bound_case(), with hyperperiods so short that every state of one can be explored.
BoundCase random_case(Rng &rng, const Limits &limits) {
  constexpr std::array<Duration, 5> kPeriods{4, 6, 8, 12, 24};
  constexpr std::array<PolicyKind, 5> kPolicies{PolicyKind::RateMonotonic, PolicyKind::DeadlineMonotonic,
                                                PolicyKind::Fixed, PolicyKind::ChainAware, PolicyKind::Edf};
  const auto chance = [&](double probability) { return rng.uniform01() < probability; };
  BoundCase result;
  result.platform.workers = limits.workers;
  result.platform.preemption = sched::Preemption::None;
  result.platform.dispatch_overhead = chance(0.2) ? limits.scale : 0;
  Workload &workload = result.workload;
  workload.policy = kPolicies[static_cast<std::size_t>(rng.uniform(0, kPolicies.size() - 1))];
  workload.ties = chance(0.7) ? Ties::Share : Ties::Fixed;
  const std::int64_t dags = rng.uniform(1, limits.max_dags);
  std::uint32_t names = 0;
  for (std::int64_t d = 0; d < dags; ++d) {
    Dag dag;
    dag.name = fmt::format("d{}", d);
    const Duration period = limits.scale * kPeriods[static_cast<std::size_t>(rng.uniform(0, kPeriods.size() - 1))];
    const Time offset = chance(0.5) ? 0 : rng.uniform(0, period);
    const std::int64_t tasks = chance(0.5) ? 1 : rng.uniform(2, limits.max_tasks);
    for (std::uint32_t i = 0; i < tasks; ++i) {
      Task task;
      task.name = fmt::format("t{}", names++);
      task.period = period;
      task.wcet = rng.uniform(1, limits.max_wcet * limits.scale);
      const bool varies = limits.rich || chance(0.4);
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
        if (limits.rich || chance(0.3)) task.jitter = rng.uniform(0, limits.rich ? period / 4 : 2);
      }
      if (chance(0.2)) task.group = "g";
      dag.tasks.push_back(std::move(task));
    }
    if (chance(0.4)) dag.max_active = static_cast<std::uint32_t>(rng.uniform(1, tasks));
    workload.dags.push_back(std::move(dag));
  }
  return result;
}

// ---- what the scheduler does ----

struct Demand {
  Duration jitter = 0;
  Duration execution = 0;
};
using Demands = std::vector<std::vector<Demand>>;  // by TaskId, by job number

struct Seen {
  std::vector<std::vector<ResponseRange>> responses;  // as Exploration::responses
  bool overrun = false;                               // a job was skipped, or answered after its period
};

void simulate(const BoundCase &bound_case, const TaskSet &task_set, const Demands &demands, Time horizon, Seen &seen) {
  const sched::Config config = config_of(bound_case.platform, bound_case.workload);
  sched::PriorityScheduler scheduler(bound_case.workload, config);
  sim::Options options;
  options.horizon = horizon;
  options.overheads.dispatch = bound_case.platform.dispatch_overhead;
  options.demand = [&](const Task &, TaskId id, std::uint32_t number) { return demands[id.value][number].execution; };
  options.jitter = [&](const Task &, TaskId id, std::uint32_t number) {
    return number < demands[id.value].size() ? demands[id.value][number].jitter : 0;
  };
  std::vector<Duration> finished(task_set.tasks.size());  // number of jobs
  sim::simulate(bound_case.workload, scheduler, config.workers, options, [&](std::span<const JobEvent> events) {
    for (const JobEvent &event : events) {
      if (event.kind == JobEventKind::Skipped) seen.overrun = true;
      if (event.kind != JobEventKind::Finished) continue;
      const Unit &unit = task_set.units[task_set.tasks[event.task.value].unit];
      const Time nominal = task_set.tasks[unit.tasks.front()].offset + event.job * unit.period;
      const Duration response = event.value - nominal;
      seen.overrun = seen.overrun || response > unit.period;
      ++finished[event.task.value];
      auto &ranges = seen.responses[event.task.value];
      ResponseRange &range = ranges[event.job % ranges.size()];
      range.best = std::min(range.best, response);
      range.worst = std::max(range.worst, response);
    }
    return !seen.overrun;
  });
  // A job that waits forever causes no event: count the jobs that finished.
  for (std::size_t t = 0; t < finished.size() && !seen.overrun; ++t) {
    const Unit &unit = task_set.units[task_set.tasks[t].unit];
    seen.overrun = task_set.tasks[unit.tasks.front()].offset + (finished[t] + 1) * unit.period < horizon;
  }
}

Seen nothing_seen(const Exploration &exploration) {
  Seen seen;
  for (const auto &ranges : exploration.responses) seen.responses.emplace_back(ranges.size());
  return seen;
}

// Returns one job of each task for every period that begins before the horizon.
std::vector<std::size_t> job_counts(const TaskSet &task_set, Time horizon) {
  std::vector<std::size_t> counts(task_set.tasks.size());
  for (const Unit &unit : task_set.units) {
    const Time first = task_set.tasks[unit.tasks.front()].offset;
    const auto jobs = first >= horizon ? 0 : (horizon - first + unit.period - 1) / unit.period;
    for (const std::uint32_t t : unit.tasks) counts[t] = static_cast<std::size_t>(jobs);
  }
  return counts;
}

// Simulates every combination of jitters and execution times of the jobs released before the horizon; empty if there
// are more than `most`.
std::optional<Seen> enumerate(const BoundCase &bound_case, const TaskSet &task_set, const Exploration &exploration,
                              Time horizon, std::uint64_t most) {
  struct Choice {
    Duration *value;
    Duration low, high;
  };
  Demands demands(task_set.tasks.size());
  std::vector<Choice> choices;
  const std::vector<std::size_t> counts = job_counts(task_set, horizon);
  std::uint64_t combinations = 1;
  for (std::size_t t = 0; t < task_set.tasks.size(); ++t) {
    const CompiledTask &task = task_set.tasks[t];
    demands[t].resize(counts[t]);
    for (Demand &demand : demands[t]) {
      choices.push_back({&demand.execution, task.bcet - task.overhead, task.wcet - task.overhead});
      choices.push_back({&demand.jitter, 0, task.data ? 0 : task.jitter});
      for (std::size_t c = choices.size() - 2; c < choices.size(); ++c) {
        *choices[c].value = choices[c].low;
        combinations *= static_cast<std::uint64_t>(choices[c].high - choices[c].low + 1);
      }
      if (combinations > most) return std::nullopt;
    }
  }
  Seen seen = nothing_seen(exploration);
  for (bool more = true; more && !seen.overrun;) {
    simulate(bound_case, task_set, demands, horizon, seen);
    more = false;
    for (const Choice &choice : choices) {  // count up
      if (*choice.value < choice.high) {
        ++*choice.value;
        more = true;
        break;
      }
      *choice.value = choice.low;
    }
  }
  return seen;
}

Time last_offset(const TaskSet &task_set) {
  Time last = 0;
  for (const CompiledTask &task : task_set.tasks) last = std::max(last, task.offset);
  return last;
}

std::string compare(const Exploration &exploration, const Seen &seen, bool exactly) {
  std::string wrong;
  for (std::size_t t = 0; t < seen.responses.size(); ++t) {
    for (std::size_t k = 0; k < seen.responses[t].size(); ++k) {
      const ResponseRange &range = seen.responses[t][k];
      const ResponseRange &bound = exploration.responses[t][k];
      if (range.worst == 0 && !exactly) continue;  // never simulated
      const bool is_within = bound.best <= range.best && range.worst <= bound.worst;
      if (is_within && (!exactly || bound == range)) continue;
      wrong += fmt::format("task {} job {}: seen [{}, {}], explored [{}, {}]\n", t, k, range.best, range.worst,
                           bound.best, bound.worst);
    }
  }
  return wrong;
}

// Tiny task sets: compares what was explored with what all schedules do.
template <class Judge>
void enumerate_task_sets(const Limits &limits, std::uint64_t task_sets, Judge judge) {
  std::uint64_t compared = 0;
  std::uint64_t late = 0;
  for (std::uint64_t seed = 1; compared < task_sets && seed < 100 * task_sets; ++seed) {
    Rng rng(mix(seed));
    const BoundCase bound_case = random_case(rng, limits);
    const TaskSet task_set = compiled(bound_case);
    ASSERT_FALSE(why_not_explore(task_set)) << *why_not_explore(task_set) << describe(bound_case);
    const Exploration exploration = explore(task_set);
    const bool overruns = exploration.end == Exploration::End::Overrun;
    ASSERT_TRUE(overruns || exploration.end == Exploration::End::Complete) << "seed " << seed << "\n"
                                                                           << describe(bound_case);
    // Long enough for what is new in each hyperperiod, with the offsets before it, and for a late job to end.
    const std::uint32_t rounds = exploration.hyperperiods + (overruns ? 2 : 0);
    const Time horizon = last_offset(task_set) + exploration.hyperperiod * rounds;
    const std::optional<Seen> seen = enumerate(bound_case, task_set, exploration, horizon, 4000);
    if (!seen) continue;
    ++compared;
    if (seen->overrun) ++late;
    judge(exploration, *seen);
    if (::testing::Test::HasFailure()) FAIL() << "seed " << seed << "\n" << describe(bound_case);
  }
  EXPECT_EQ(compared, task_sets);
  EXPECT_GT(late, 0U);
  EXPECT_LT(late, compared);
}

TEST(ExplorationProperty, OneWorkerIsExact) {
  std::uint64_t complete = 0;
  const std::uint64_t task_sets = testing::how_many(1000);
  enumerate_task_sets(Limits{}, task_sets, [&](const Exploration &exploration, const Seen &seen) {
    EXPECT_TRUE(exploration.exact);
    EXPECT_EQ(exploration.end == Exploration::End::Overrun, seen.overrun);
    if (seen.overrun || exploration.end != Exploration::End::Complete) return;
    EXPECT_EQ(compare(exploration, seen, true), "");
    ++complete;
  });
  fmt::print("[ figures  ] {} task sets without an overrun\n", complete);
  EXPECT_GT(complete, task_sets / 10);
}

TEST(ExplorationProperty, SeveralWorkersAreSafe) {
  std::uint64_t ranges = 0;
  std::uint64_t tight = 0;
  for (const std::uint32_t workers : {2U, 3U}) {
    Limits limits;
    limits.workers = workers;
    limits.max_dags = 4;
    limits.max_tasks = 4;
    limits.max_wcet = 4;
    enumerate_task_sets(limits, testing::how_many(500), [&](const Exploration &exploration, const Seen &seen) {
      EXPECT_FALSE(exploration.exact);
      if (seen.overrun) {
        EXPECT_EQ(exploration.end, Exploration::End::Overrun);
        return;
      }
      if (exploration.end != Exploration::End::Complete) return;
      EXPECT_EQ(compare(exploration, seen, false), "");
      for (std::size_t t = 0; t < seen.responses.size(); ++t) {
        for (std::size_t k = 0; k < seen.responses[t].size(); ++k) {
          ++ranges;
          if (seen.responses[t][k] == exploration.responses[t][k]) ++tight;
        }
      }
    });
  }
  fmt::print("[ figures  ] {} of {} ranges are tight\n", tight, ranges);
  EXPECT_GT(tight * 100, ranges * 98);
}

// Longer times and more jobs, at random, for several hyperperiods.
TEST(ExplorationProperty, NoSimulatedResponseIsOutside) {
  std::uint64_t complete = 0;
  const std::uint64_t task_sets = testing::how_many(1000);
  for (std::uint64_t seed = 1; seed <= task_sets; ++seed) {
    Rng rng(mix(seed) + 1);
    Limits limits;
    limits.workers = static_cast<std::uint32_t>(rng.uniform(1, 4));
    limits.max_dags = 2 + limits.workers;
    limits.max_tasks = 5;
    limits.max_wcet = 4;
    limits.scale = 10;
    limits.rich = true;
    const BoundCase bound_case = random_case(rng, limits);
    const TaskSet task_set = compiled(bound_case);
    const Exploration exploration = explore(task_set, 20'000);
    if (exploration.end != Exploration::End::Complete) continue;
    ++complete;
    Seen seen = nothing_seen(exploration);
    const Time horizon = last_offset(task_set) + 3 * exploration.hyperperiod;
    const std::vector<std::size_t> counts = job_counts(task_set, horizon);
    for (int run = 0; run < 20 && !seen.overrun; ++run) {
      Demands demands(task_set.tasks.size());
      const double extreme = rng.uniform01();  // share of jobs at an end of their range
      const auto draw = [&](Duration low, Duration high) {
        if (rng.uniform01() < extreme) return rng.uniform(0, 1) == 0 ? low : high;
        return rng.uniform(low, high);
      };
      for (std::size_t t = 0; t < task_set.tasks.size(); ++t) {
        const CompiledTask &task = task_set.tasks[t];
        for (std::size_t k = 0; k < counts[t]; ++k) {
          demands[t].push_back(
              {draw(0, task.data ? 0 : task.jitter), draw(task.bcet - task.overhead, task.wcet - task.overhead)});
        }
      }
      simulate(bound_case, task_set, demands, horizon, seen);
    }
    ASSERT_FALSE(seen.overrun) << "seed " << seed << "\n" << describe(bound_case);
    ASSERT_EQ(compare(exploration, seen, false), "") << "seed " << seed << "\n" << describe(bound_case);
  }
  fmt::print("[ figures  ] {} of {} task sets explored to the end\n", complete, task_sets);
  EXPECT_GT(complete, task_sets / 5);
}

// The bounds for one worker hold for all offsets and gaps: no explored response exceeds them.
TEST(ExplorationProperty, OneWorkerIsNeverAboveTheBounds) {
  std::uint64_t compared = 0;
  for (std::uint64_t seed = 1; seed <= testing::how_many(500); ++seed) {
    Rng rng(mix(seed) + 2);
    Limits limits;
    limits.scale = 10;
    limits.rich = true;
    const BoundCase bound_case = random_case(rng, limits);
    const TaskSet task_set = compiled(bound_case);
    const Report report = analyze(task_set);
    if (report.verdict != Verdict::Schedulable) continue;
    const Exploration exploration = explore(task_set);
    ASSERT_EQ(exploration.end, Exploration::End::Complete) << describe(bound_case);
    for (std::uint32_t t = 0; t < task_set.tasks.size(); ++t) {
      const auto &best = report.tasks[t].response;
      if (!best) continue;
      ++compared;
      ASSERT_LE(exploration.of(TaskId(t)).worst, *best)
          << report.tasks[t].method->name << ", task " << t << ", seed " << seed << "\n"
          << describe(bound_case);
    }
  }
  EXPECT_GT(compared, 0U);
}

}  // namespace
}  // namespace redag::analysis
