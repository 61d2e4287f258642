// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "tests/testing/bound_property.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <map>
#include <numeric>
#include <optional>

#include <fmt/format.h>

#include "redag/derived/waits.hpp"
#include "redag_analysis/analyze/executors.hpp"
#include "redag_analysis/metrics/deadline_watch.hpp"
#include "redag_analysis/sim/simulator.hpp"
#include "tests/testing/environment.hpp"

namespace redag::testing {
namespace {

// How the jobs of one simulation are released, and how long they execute.
struct Run {
  std::uint64_t seed = 0;
  std::vector<Duration> offsets;  // by unit
  double full_demand = 1.0;       // share of jobs that execute for their wcet
  double gap = 0.0;               // share of releases that come later than one period after the last
  enum class Jitter : std::uint8_t { None, First, Largest, Random } jitter = Jitter::None;
};

Run draw_run(const analysis::TaskSet &task_set, std::uint32_t index, Rng &rng) {
  Run run;
  run.seed = rng();
  const auto random_offsets = [&] {
    for (const analysis::Unit &unit : task_set.units) run.offsets.push_back(rng.uniform(0, unit.period));
  };
  switch (index % 5) {
    case 0:  // all at once
      run.offsets.assign(task_set.units.size(), 0);
      run.jitter = Run::Jitter::First;
      break;
    case 1: {  // less urgent jobs start an instant before one task and all above it are released, each as late as
               // allowed
      const auto pivot = static_cast<std::uint32_t>(rng.uniform(0, static_cast<int>(task_set.tasks.size()) - 1));
      Duration largest = 0;
      for (const analysis::Unit &unit : task_set.units) largest = std::max(largest, unit.jitter);
      for (const analysis::Unit &unit : task_set.units) {
        run.offsets.push_back(unit.first_rank > pivot ? largest : largest + 1 - unit.jitter);
      }
      run.jitter = Run::Jitter::First;
      break;
    }
    case 2:
      random_offsets();
      run.full_demand = 0.3;
      run.gap = 0.3;
      run.jitter = Run::Jitter::Random;
      break;
    case 3:
      random_offsets();
      run.full_demand = 0.9;
      run.gap = 0.1;
      run.jitter = Run::Jitter::Random;
      break;
    default:
      random_offsets();
      run.jitter = rng.uniform(0, 1) == 0 ? Run::Jitter::Largest : Run::Jitter::Random;
      break;
  }
  return run;
}

// The observations of a simulation.
struct Observed {
  std::vector<Duration> tasks;      // largest response, by TaskId
  std::vector<Duration> ended;      // the same of jobs that ended
  std::vector<Duration> dags;       // largest f - origin, by DagId
  std::vector<std::uint64_t> lost;  // skipped or aborted, by TaskId
  std::vector<std::uint64_t> finished;
};

void observe(const metrics::JudgedJob &job, const analysis::TaskSet &task_set, bool from_source, Observed &observed) {
  const TaskId task = job.record.task;
  if (task.value >= task_set.tasks.size()) return;  // a stall
  if (job.miss == metrics::Miss::Lost) ++observed.lost[task.value];
  if (job.record.outcome == metrics::JobOutcome::Finished) ++observed.finished[task.value];
  const analysis::CompiledTask &compiled = task_set.tasks[task.value];
  Duration &response = observed.tasks[task.value];
  if (job.response) response = std::max(response, *job.response);
  if (job.record.outcome == metrics::JobOutcome::Finished) {
    observed.ended[task.value] = std::max(observed.ended[task.value], job.record.response());
  }
  const bool has_source = !compiled.predecessors.empty() && task_set.units[compiled.unit].awaits.empty();
  if (job.response && from_source && has_source)
    response = std::max(response, *job.response + job.record.release - job.record.origin);
  Duration &dag = observed.dags[task_set.tasks[task.value].dag.value];
  if (job.end_to_end) dag = std::max(dag, *job.end_to_end);
}

// Adds stalls as the analysis defines them: on each worker a job above all others, `stall.longest` long and as frequent
// as `stall.per_second` allows. Requires a policy and a preemption mode that put these jobs above all others.
Duration add_stalls(Workload &workload, const analysis::AnalysisPlatform &platform, const Run &run) {
  if (platform.stall.longest == 0) return 0;
  for (std::uint32_t w = 0; w < platform.workers; ++w) {
    Task task;
    task.name = fmt::format("stall{}", w);
    task.wcet = task.bcet = task.period = task.deadline = platform.stall.longest;
    task.offset = Rng::stream(run.seed + 3, w, 0).uniform(0, 40);
    workload.dags.push_back(Dag{});
    workload.dags.back().name = task.name;
    workload.dags.back().tasks.push_back(std::move(task));
  }
  if (platform.stall.per_second == 0) return kMaxDuration / 4;  // a single stall
  return (platform.stall.longest * kSecond + platform.stall.per_second - 1) / platform.stall.per_second;
}

void simulate_run(const BoundCase &bound_case, const analysis::TaskSet &task_set, const Run &run,
                  const BoundPropertyOptions &property, Observed &observed) {
  Workload workload = bound_case.workload;
  std::vector<std::uint32_t> unit_of;
  std::vector<bool> can_pause;  // by TaskId
  Duration longest = 0;
  for (Dag &dag : workload.dags) {
    const std::vector<std::uint32_t> &units =
        task_set.dags[static_cast<std::size_t>(&dag - workload.dags.data())].units;
    const auto awaits = [&](std::uint32_t u) { return !task_set.units[u].awaits.empty(); };
    const bool joins_rates = property.keeps_grids || std::any_of(units.begin(), units.end(), awaits);
    const bool has_clocks =
        std::any_of(dag.tasks.begin(), dag.tasks.end(), [](const Task &task) { return task.phase != Phase::Common; });
    for (Task &task : dag.tasks) {
      unit_of.push_back(task_set.tasks[unit_of.size()].unit);
      can_pause.push_back(!joins_rates || task.phase == Phase::Event);
      if (joins_rates && task.phase != Phase::Common) {
        task.offset = run.offsets[unit_of.back()] % task.period;
      } else if (joins_rates) {
        // The analysis uses these offsets; they move together. Sources of other clocks move against them.
        if (task.activation == Activation::Timer && !has_clocks) task.offset += run.offsets[units.front()];
      } else if (task.activation == Activation::Timer) {
        task.offset = run.offsets[unit_of.back()];
      }
      longest = std::max(longest, task.period + task.offset);
    }
  }

  sim::Options options;
  const analysis::AnalysisPlatform &platform = bound_case.platform;
  options.horizon = (property.periods + 1) * longest + 1;
  options.overheads = {platform.release_overhead, platform.dispatch_overhead, platform.preempt_overhead};
  const std::size_t tasks = unit_of.size();
  const Duration between_stalls = add_stalls(workload, platform, run);
  options.demand = [&](const Task &task, TaskId id, std::uint32_t number) {
    if (id.value >= tasks) return task.wcet - platform.release_overhead - platform.dispatch_overhead;
    Rng rng = Rng::stream(run.seed, id.value, number);
    return rng.uniform01() < run.full_demand ? task.wcet : rng.uniform(shortest_demand(task), task.wcet);
  };
  options.wait = [&](const Task &task, TaskId id, std::uint32_t number, std::size_t wait) {
    Rng rng = Rng::stream(run.seed + 4 + wait, id.value, number);
    const Duration most = task.waits[wait].longest;
    return rng.uniform01() < run.full_demand ? most : rng.uniform(1, most);
  };
  options.gap = [&](const Task &task, TaskId id, std::uint32_t number) -> Duration {
    if (id.value >= tasks) {
      Rng rng = Rng::stream(run.seed + 3, id.value, number + 1);
      return between_stalls - task.period + (run.gap > 0 ? rng.uniform(0, 20) : 0);
    }
    if (!can_pause[id.value]) return 0;
    Rng rng = Rng::stream(run.seed + 1, unit_of[id.value], number);
    return rng.uniform01() < run.gap ? rng.uniform(1, task.period) : 0;
  };
  options.jitter = [&](const Task &task, TaskId id, std::uint32_t number) -> Duration {
    if (id.value >= tasks) return 0;
    const Duration latest = task.jitter + platform.lateness;
    switch (run.jitter) {
      case Run::Jitter::None: return 0;
      case Run::Jitter::First: return number == 0 ? latest : 0;
      case Run::Jitter::Largest: return latest;
      case Run::Jitter::Random: break;
    }
    return Rng::stream(run.seed + 2, id.value, number).uniform(0, latest);
  };

  const sched::Config config = analysis::config_of(platform, workload);
  const auto scheduler = executors::make_scheduler(property.executor, workload, config);
  metrics::DeadlineWatch watch(workload);
  const auto see = [&](const metrics::JudgedJob &job) { observe(job, task_set, property.from_source, observed); };
  const sim::Result result =
      sim::simulate(workload, *scheduler, platform.workers, options, [&](std::span<const JobEvent> events) {
        watch.add(events, see);
        return true;
      });
  watch.finish(result.end, see);
}

// Compares one workload with one bound.
class Judge {
 public:
  Judge(const analysis::TaskSet &task_set, const analysis::Bound &bound, BoundPropertyResult &result,
        std::vector<double> &ratios)
      : task_set_(task_set), bound_(bound), result_(result), ratios_(ratios) {}

  // Returns what is broken, or an empty text.
  std::string judge(const Observed &observed) {
    if (bound_.accepts) return judge_accepted(observed);
    std::string broken;
    for (std::size_t t = 0; t < bound_.tasks.size(); ++t) {
      const analysis::CompiledTask &task = task_set_.tasks[t];
      if (!bound_.tasks[t].response) continue;
      result_.jobs += observed.finished[t];
      if (observed.lost[t] > 0 && !bound_.tasks[t].of_ended && *bound_.tasks[t].response <= task.limit) {
        broken += fmt::format("{}: bounded by {}, and {} of its jobs were skipped\n", task.name,
                              *bound_.tasks[t].response, observed.lost[t]);
      }
      const bool is_single = task_set_.units[task.unit].tasks.size() == 1;
      const Duration seen = bound_.tasks[t].of_ended ? observed.ended[t] : observed.tasks[t];
      compare(task.name, seen, *bound_.tasks[t].response, is_single, broken);
    }
    for (std::size_t d = 0; d < bound_.dags.size(); ++d) {
      const analysis::CompiledDag &dag = task_set_.dags[d];
      if (bound_.dags[d].response) {
        compare(dag.name, observed.dags[d], *bound_.dags[d].response, dag.units.size() < dag.tasks.size(), broken);
      }
    }
    return broken;
  }

 private:
  void compare(const std::string &name, Duration seen, Duration bound, bool count, std::string &broken) {
    if (seen > bound) broken += fmt::format("{}: answered after {}, bound {}\n", name, seen, bound);
    if (!count) return;
    ++result_.bounds;
    ratios_.push_back(static_cast<double>(seen) / static_cast<double>(bound));
  }

  std::string judge_accepted(const Observed &observed) {
    if (!*bound_.accepts) return {};
    ++result_.bounds;
    std::string broken;
    double worst = 0;
    for (std::size_t t = 0; t < task_set_.tasks.size(); ++t) {
      const analysis::CompiledTask &task = task_set_.tasks[t];
      result_.jobs += observed.finished[t];
      worst = std::max(worst, static_cast<double>(observed.tasks[t]) / static_cast<double>(task.deadline));
      if (observed.tasks[t] <= task.deadline && observed.lost[t] == 0) continue;
      broken += fmt::format("{}: accepted with deadline {}, answered after {}, {} skipped\n", task.name, task.deadline,
                            observed.tasks[t], observed.lost[t]);
    }
    for (std::size_t d = 0; d < task_set_.dags.size(); ++d) {
      const Duration deadline = task_set_.dags[d].deadline;
      if (deadline > 0 && observed.dags[d] > deadline) broken += task_set_.dags[d].name + ": end-to-end deadline\n";
    }
    ratios_.push_back(worst);
    return broken;
  }

  const analysis::TaskSet &task_set_;
  const analysis::Bound &bound_;
  BoundPropertyResult &result_;
  std::vector<double> &ratios_;
};

void check_one(const analysis::Method &method, const BoundGenerator &generator, const BoundPropertyOptions &options,
               std::uint64_t seed, BoundPropertyResult &result, std::vector<double> &ratios) {
  Rng rng(seed);
  const BoundCase bound_case = generator(rng);
  const executors::ExecutorKind &executor = *executors::find_executor(options.executor);
  const auto task_set = analysis::compile_for(executor, bound_case.workload, bound_case.platform);
  ASSERT_TRUE(task_set) << to_string(task_set.error()) << describe(bound_case);
  const bool is_covered = task_set->not_analysable.empty() || (task_set->has_waits && method.knows_waits) ||
                          (options.include_refused && !task_set->is_beyond_numbers);
  if (!is_covered) {
    ++result.not_applicable;
    return;
  }
  const analysis::Outcome outcome = method.apply(*task_set);
  const auto *bound = std::get_if<analysis::Bound>(&outcome);
  if (bound == nullptr || (!bound->unsound.empty() && !options.include_unsound)) {
    ++result.not_applicable;
    return;
  }
  ++result.workloads;

  Observed observed;
  observed.tasks.resize(task_set->tasks.size());
  observed.ended.resize(task_set->tasks.size());
  observed.lost.resize(task_set->tasks.size());
  observed.finished.resize(task_set->tasks.size());
  observed.dags.resize(task_set->dags.size());
  if (bound->accepts != false) {
    for (std::uint32_t r = 0; r < options.runs; ++r) {
      simulate_run(bound_case, *task_set, draw_run(*task_set, r, rng), options, observed);
    }
  }
  const std::string broken = Judge(*task_set, *bound, result, ratios).judge(observed);
  if (broken.empty()) return;
  if (result.violations++ == 0) {
    result.first_violation =
        fmt::format("{}: replay with REDAG_BOUND_SEED={}\n{}{}", method.name, seed, broken, describe(bound_case));
  }
}

const char *phase_text(const Task &task) {
  switch (task.phase) {
    case Phase::Unknown: return "free timer";
    case Phase::Event: return kEventActivation;
    case Phase::Common: break;
  }
  return to_string(task.activation);
}

}  // namespace

std::uint64_t how_many(std::uint64_t usual) {
  const std::uint64_t wanted = from_environment("REDAG_BOUND_WORKLOADS").value_or(usual);
  return std::min(wanted, from_environment("REDAG_BOUND_AT_MOST").value_or(wanted));
}

BoundPropertyResult check_bound(const analysis::Method &method, const BoundGenerator &generator,
                                const BoundPropertyOptions &options) {
  BoundPropertyResult result;
  std::vector<double> ratios;
  if (const auto seed = from_environment("REDAG_BOUND_SEED")) {
    check_one(method, generator, options, *seed, result, ratios);
  } else {
    const std::uint64_t wanted = how_many(options.workloads);
    for (std::uint64_t i = 0; result.workloads < wanted && i < 20 * wanted; ++i) {
      check_one(method, generator, options, mix(options.seed ^ mix(i)), result, ratios);
      if (::testing::Test::HasFatalFailure()) return result;
    }
  }
  if (!ratios.empty()) {
    std::sort(ratios.begin(), ratios.end());
    result.mean_ratio = std::accumulate(ratios.begin(), ratios.end(), 0.0) / static_cast<double>(ratios.size());
    result.p95_ratio = ratios[(ratios.size() - 1) * 95 / 100];
    result.max_ratio = ratios.back();
  }
  return result;
}

void expect_bound_holds(const analysis::Method &method, const BoundGenerator &generator,
                        const BoundPropertyOptions &options) {
  const BoundPropertyResult result = check_bound(method, generator, options);
  fmt::print(
      "[ figures  ] {}: {} workloads ({} not applicable), {} bounds, {} jobs, {} violations; observed/bound mean "
      "{:.3f}, p95 {:.3f}, max {:.3f}\n",
      method.name, result.workloads, result.not_applicable, result.bounds, result.jobs, result.violations,
      result.mean_ratio, result.p95_ratio, result.max_ratio);
  std::fflush(stdout);
  EXPECT_EQ(result.violations, 0U) << result.first_violation;
  EXPECT_GT(result.workloads, 0U) << method.name << " never applied";
  EXPECT_GT(result.bounds, 0U) << method.name << " never gave a bound";
}

void for_cases(const BoundGenerator &generator, std::uint32_t count,
               const std::function<void(const BoundCase &, const analysis::TaskSet &, Rng &)> &check) {
  for (std::uint32_t i = 0; i < count; ++i) {
    Rng rng(mix(i));
    const BoundCase bound_case = generator(rng);
    const auto task_set = analysis::compile(bound_case.workload, bound_case.platform);
    SCOPED_TRACE(describe(bound_case));
    ASSERT_TRUE(task_set);
    if (task_set->not_analysable.empty() || task_set->has_waits) check(bound_case, *task_set, rng);
    if (::testing::Test::HasFailure()) return;
  }
}

analysis::TaskSet compiled(const Workload &workload, const analysis::AnalysisPlatform &platform) {
  const Result<analysis::TaskSet> task_set = analysis::compile(workload, platform);
  EXPECT_TRUE(task_set) << to_string(task_set.error());
  return task_set.value();
}

analysis::TaskSet compiled(const Workload &workload) { return compiled(workload, analysis::platform_of(workload)); }

analysis::TaskSet compiled(const Workload &workload, sched::Preemption preemption) {
  analysis::AnalysisPlatform platform;
  platform.workers = workload.platform.workers;
  platform.preemption = preemption;
  return compiled(workload, platform);
}

analysis::TaskSet compiled(const BoundCase &bound_case) { return compiled(bound_case.workload, bound_case.platform); }

std::string describe(const BoundCase &bound_case) {
  const analysis::AnalysisPlatform &platform = bound_case.platform;
  std::string text = fmt::format(
      "m={} preemption={} policy={} ties={} levels={} overheads={}/{}/{}\n", platform.workers,
      static_cast<int>(platform.preemption), to_string(bound_case.workload.policy), to_string(bound_case.workload.ties),
      platform.levels, platform.release_overhead, platform.dispatch_overhead, platform.preempt_overhead);
  for (const Device &device : bound_case.workload.platform.devices) {
    text += fmt::format("device {} slots={} queue={}\n", device.name, device.slots, to_string(device.queue));
  }
  for (const Dag &dag : bound_case.workload.dags) {
    text += fmt::format("dag {} max_active={} deadline={}\n", dag.name, dag.max_active, dag.deadline);
    for (const Task &task : dag.tasks) {
      text += fmt::format("  {} {} C={} T={} D={} J={} O={} region={} queue={} priority={} group='{}' after=[{}]\n",
                          task.name, phase_text(task), task.wcet, task.period, task.deadline, task.jitter, task.offset,
                          task.region, task.overrun == Overrun::Queue ? task.queue_depth : 0, task.priority.value_or(0),
                          task.group, fmt::join(task.predecessors, ","));
      for (const Wait &wait : task.waits) {
        text +=
            fmt::format("    waits after {} for {} at {}\n", wait.after, wait.longest,
                        wait.device.valid() ? bound_case.workload.platform.devices[wait.device.value].name : "none");
      }
    }
  }
  return text;
}

}  // namespace redag::testing
