// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "tests/testing/random_workloads.hpp"

#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "redag/sched/policy.hpp"
#include "redag_lab/workload/generate.hpp"

namespace redag::testing {
namespace {

// Few values make equal ones common; all are multiples of one value, which makes releases coincide.
Duration random_period(Rng &rng) {
  constexpr std::array<Duration, 4> kPeriods{10 * kMicrosecond, 20 * kMicrosecond, 40 * kMicrosecond,
                                             50 * kMicrosecond};
  return kPeriods[between(rng, 0, kPeriods.size() - 1)];
}

Duration random_offset(Rng &rng) { return chance(rng, 0.7) ? 0 : 5 * kMicrosecond * rng.uniform(0, 3); }

void add_edges(Rng &rng, Dag &dag, const RandomWorkloadLimits &limits) {
  const bool mostly_data = chance(rng, 0.5);
  // Edges go from earlier to later in `order`, which is not the order of the file.
  std::vector<std::uint32_t> order(dag.tasks.size());
  for (std::uint32_t i = 0; i < order.size(); ++i) order[i] = i;
  for (std::size_t i = order.size(); i > 1; --i) {
    std::swap(order[i - 1], order[between(rng, 0, static_cast<std::uint32_t>(i - 1))]);
  }
  const double density = rng.uniform01();
  for (std::size_t to = 1; to < order.size(); ++to) {
    Task &task = dag.tasks[order[to]];
    for (std::size_t from = 0; from < to; ++from) {
      if (chance(rng, density)) task.predecessors.push_back(order[from]);
    }
    const bool data = limits.data && !task.predecessors.empty() && chance(rng, mostly_data ? 0.9 : 0.2);
    if (!data) continue;
    task.activation = Activation::Data;
    task.period = 0;
    task.offset = 0;
  }
}

Task random_task(Rng &rng, std::size_t index, const RandomWorkloadLimits &limits) {
  constexpr std::array<const char *, 3> kGroups{"left", "right", "both"};
  Task task;
  task.name = fmt::format("t{}", index);
  task.wcet = kMicrosecond * rng.uniform(1, 6);
  task.bcet = chance(rng, 0.5) ? task.wcet : kMicrosecond;
  if (task.bcet != task.wcet) task.execution.kind = ExecutionTime::Kind::Uniform;
  if (chance(rng, 0.5)) task.region = kMicrosecond * rng.uniform(1, 3);
  if (chance(rng, 0.4)) task.priority = static_cast<int>(rng.uniform(-2, 2));
  if (limits.groups && chance(rng, 0.4)) task.group = kGroups[between(rng, 0, kGroups.size() - 1)];
  if (limits.overlap && task.group.empty() && chance(rng, 0.15)) task.concurrency = between(rng, 2, 3);
  task.on_budget = static_cast<OnBudget>(between(rng, 0, 3));
  task.budget = task.on_budget == OnBudget::Abort ? 0 : kMicrosecond * rng.uniform(1, 6);
  if (limits.bounds && chance(rng, 0.3)) {
    task.overrun = Overrun::Queue;
    task.queue_depth = between(rng, 1, 3);
  }
  return task;
}

Degrade random_degrade(Rng &rng, std::uint32_t most_skipped, double most_stretched) {
  Degrade degrade;
  degrade.kind = static_cast<Degrade::Kind>(between(rng, 0, 2));
  degrade.skip = between(rng, 1, most_skipped);
  degrade.stretch = 1 + (most_stretched - 1) * rng.uniform01();
  return degrade;
}

lab::GenerateOptions random_options(Rng &rng) {
  constexpr std::array kModes{PreemptionMode::None, PreemptionMode::Cooperative, PreemptionMode::Auto};
  lab::GenerateOptions options;
  options.dags = between(rng, 1, 4);
  options.min_tasks = 1;
  options.max_tasks = between(rng, 1, 7);
  options.workers = between(rng, 1, 4);
  options.preemption = kModes[between(rng, 0, 2)];
  options.policy = static_cast<PolicyKind>(between(rng, 0, 5));
  // Never more than the smallest number of tasks can have.
  options.utilization = std::min((0.2 + 1.2 * rng.uniform01()) * options.workers, 0.9 * options.dags);
  options.periods = chance(rng, 0.5) ? lab::PeriodModel::Harmonic : lab::PeriodModel::LogUniform;
  options.period_max = 40 * kMillisecond;
  options.rates = chance(rng, 0.5) ? lab::RateScope::PerDag : lab::RateScope::PerTask;
  options.shape = static_cast<lab::DagShape>(between(rng, 0, 4));
  options.data_share = rng.uniform01();
  options.bcet_min = 0.2;
  options.offsets = chance(rng, 0.5);
  options.deadline_min = chance(rng, 0.5) ? 0.5 : 1.0;
  options.jitter = chance(rng, 0.3) ? 0.5 : 0.0;
  options.max_active_max = between(rng, 0, 3);
  options.groups = between(rng, 0, 2);
  options.group_share = options.groups > 0 ? 0.4 : 0.0;
  options.queue_share = chance(rng, 0.5) ? 0.5 : 0.0;
  return options;
}

void add_details(Rng &rng, Task &task) {
  if (chance(rng, 0.7)) task.region = std::max<Duration>(1, task.wcet / rng.uniform(1, 5));
  if (chance(rng, 0.1)) task.budget = std::max<Duration>(1, task.wcet / 2);
  if (task.group.empty() && chance(rng, 0.1)) task.concurrency = between(rng, 2, 3);
  if (chance(rng, 0.5)) task.priority = static_cast<int>(rng.uniform(-2, 2));
}

// Takes load and limits away, so that bounds exist. Times stay valid: a budget is never below the wcet.
void relieve(Rng &rng, Workload &workload) {
  for (Dag &dag : workload.dags) {
    if (chance(rng, 0.7)) dag.max_pending = 0;
    for (Task &task : dag.tasks) {
      if (task.waits.empty()) {
        task.wcet = std::max(task.wcet_low, std::max<Duration>(2, task.wcet / between(rng, 1, 4)));
        task.bcet = std::min(task.bcet, task.wcet);
      }
      if (chance(rng, 0.95)) {
        task.budget = 0;
        task.on_budget = OnBudget::Abort;
      }
      if (chance(rng, 0.9)) task.concurrency = 1;
      for (Wait &wait : task.waits) {
        wait.longest = std::max<Duration>(1, wait.longest / between(rng, 1, 8));
        wait.shortest = std::min(wait.shortest, wait.longest);
      }
    }
  }
}

bool has_modes(const Workload &workload) {
  const std::vector<TaskRef> tasks = flatten(workload);
  return std::any_of(tasks.begin(), tasks.end(),
                     [](const TaskRef &ref) { return ref.task->wcet_low > 0 && ref.task->wcet_low < ref.task->wcet; });
}

// Takes away what no bound knows together with a HI mode.
void simplify(Rng &rng, Workload &workload) {
  if (chance(rng, 0.8)) workload.platform.workers = 1;
  if (chance(rng, 0.8)) workload.platform.preemption = PreemptionMode::Auto;
  if (chance(rng, 0.8)) workload.policy = static_cast<PolicyKind>(between(rng, 0, 2));
  const bool ungroup = chance(rng, 0.8);
  for (Dag &dag : workload.dags) {
    const bool calm = dag.criticality != Criticality::High && chance(rng, 0.8);
    for (Task &task : dag.tasks) {
      if (ungroup) task.group.clear();
      if (calm) task.jitter = 0;
    }
  }
}

void limit_threads(Rng &rng, std::size_t task_count, sched::Config &config) {
  if (config.preemption != sched::Preemption::Full) return;
  const auto tasks = static_cast<std::uint32_t>(task_count);
  if (is_static(config.policy) && chance(rng, 0.5)) config.levels = between(rng, 1, tasks);
  if (chance(rng, 0.3)) config.max_started = config.workers + between(rng, 0, 2);
}

void add_overload(Rng &rng, Dag &dag) {
  dag.criticality = static_cast<Criticality>(between(rng, 0, 2));
  if (dag.criticality != Criticality::High) dag.degrade = random_degrade(rng, 3, 4);
  const bool has_modes = dag.criticality == Criticality::High && chance(rng, 0.5);
  for (Task &task : dag.tasks) {
    if (has_modes && chance(rng, 0.5)) task.wcet_low = rng.uniform(1, task.wcet);
    if (task.budget > 0 || !chance(rng, 0.2)) continue;
    task.on_budget = static_cast<OnBudget>(between(rng, 1, 3));
    task.budget = rng.uniform(1, task.wcet);
  }
}

}  // namespace

bool chance(Rng &rng, double probability) { return rng.uniform01() < probability; }

std::uint32_t between(Rng &rng, std::uint32_t low, std::uint32_t high) {
  return static_cast<std::uint32_t>(rng.uniform(low, high));
}

Dag random_dag(Rng &rng, const RandomWorkloadLimits &limits) {
  Dag dag;
  dag.name = fmt::format("d{}", between(rng, 0, 999'999));
  if (limits.bounds && chance(rng, 0.5)) dag.max_active = between(rng, 1, 3);
  if (limits.bounds && chance(rng, 0.3)) dag.max_pending = between(rng, 1, 4);
  dag.criticality = static_cast<Criticality>(between(rng, 0, 2));
  if (dag.criticality != Criticality::High) dag.degrade = random_degrade(rng, 2, 3);
  const bool one_rate = chance(rng, 0.5);
  const Duration period = random_period(rng);
  const Duration offset = random_offset(rng);
  const std::uint32_t count = between(rng, 1, limits.max_tasks);
  for (std::size_t i = 0; i < count; ++i) {
    Task task = random_task(rng, i, limits);
    task.period = one_rate ? period : random_period(rng);
    task.offset = one_rate ? offset : random_offset(rng);
    dag.tasks.push_back(task);
  }
  add_edges(rng, dag, limits);
  inherit_periods(dag);
  for (Task &task : dag.tasks) {
    if (chance(rng, 0.3)) task.deadline = std::max(task.wcet, 10 * kMicrosecond * rng.uniform(1, 4));
    if (task.activation == Activation::Timer && chance(rng, 0.15)) task.jitter = rng.uniform(1, 2 * task.period);
    if (dag.criticality == Criticality::High && chance(rng, 0.3)) task.wcet_low = rng.uniform(1, task.wcet);
  }
  return dag;
}

Workload random_workload(Rng &rng, const RandomWorkloadLimits &limits) {
  Workload workload;
  workload.name = "random";
  workload.platform.workers = between(rng, 1, 3);
  workload.ties = chance(rng, 0.7) ? Ties::Share : Ties::Fixed;
  const std::uint32_t count = between(rng, 1, limits.max_dags);
  for (std::size_t i = 0; i < count; ++i) {
    workload.dags.push_back(random_dag(rng, limits));
    workload.dags.back().name = fmt::format("d{}", i);
  }
  return workload;
}

Workload contended(Rng &rng, bool overload) {
  const lab::GenerateOptions options = random_options(rng);
  Workload workload = lab::generate(options, rng()).value();
  for (Dag &dag : workload.dags) {
    if (chance(rng, 0.3)) dag.max_pending = between(rng, 1, 4);
    for (Task &task : dag.tasks) add_details(rng, task);
    if (overload) add_overload(rng, dag);
  }
  return workload;
}

std::vector<Device> random_devices(Rng &rng, bool has_order) {
  std::vector<Device> devices(between(rng, 0, 2));
  for (std::size_t d = 0; d < devices.size(); ++d) {
    devices[d].name = fmt::format("device{}", d);
    devices[d].slots = between(rng, 1, 2);
    devices[d].queue = chance(rng, has_order ? 0.7 : 0) ? Device::Queue::Priority : Device::Queue::Fifo;
  }
  return devices;
}

void add_waits(Rng &rng, Workload &workload) {
  workload.platform.devices = random_devices(rng, workload.platform.clusters.empty());
  const auto devices = static_cast<std::uint32_t>(workload.platform.devices.size());
  for (Dag &dag : workload.dags) {
    for (Task &task : dag.tasks) {
      if (task.wcet < 2 || chance(rng, 0.5)) continue;
      const std::uint32_t count = between(rng, 1, static_cast<std::uint32_t>(std::min<Duration>(3, task.wcet - 1)));
      for (std::uint32_t w = 0; w < count; ++w) {
        Wait wait;
        wait.after = (w + 1) * task.wcet / (count + 1);
        wait.longest = std::max<Duration>(1, task.wcet / 2 * rng.uniform(1, 4));
        if (chance(rng, 0.5)) wait.shortest = rng.uniform(1, wait.longest);
        const std::uint32_t device = between(rng, 0, devices);
        if (device < devices) wait.device = DeviceId(std::size_t{device});
        task.waits.push_back(wait);
      }
    }
  }
}

void divide(Rng &rng, Workload &workload) {
  std::vector<Cluster> &clusters = workload.platform.clusters;
  clusters.resize(between(rng, 1, 3));
  workload.platform.workers = 0;
  for (std::size_t c = 0; c < clusters.size(); ++c) {
    clusters[c].name = fmt::format("c{}", c);
    clusters[c].workers = between(rng, 1, 3);
    workload.platform.workers += clusters[c].workers;
  }
  for (Dag &dag : workload.dags) {
    dag.cluster = clusters[between(rng, 0, static_cast<std::uint32_t>(clusters.size() - 1))].name;
    for (Task &task : dag.tasks) {
      if (!task.group.empty()) task.group += dag.cluster;
    }
  }
}

// Sources begin within their first period, as if all had been running before.
void free_sources(Rng &rng, Dag &dag) {
  for (Task &task : dag.tasks) {
    if (task.activation == Activation::Data) continue;
    task.offset %= task.period;
    if (!task.predecessors.empty() || chance(rng, 0.4)) continue;
    task.phase = chance(rng, 0.7) ? Phase::Unknown : Phase::Event;
    task.offset = 0;
  }
  // No timer waits for jobs of the very same instants, which nothing promises then.
  for (Task &task : dag.tasks) {
    const bool is_timer = task.activation == Activation::Timer;
    const bool waits = std::any_of(task.predecessors.begin(), task.predecessors.end(),
                                   [&](std::uint32_t p) { return dag.tasks[p].phase != Phase::Common; });
    if (is_timer && waits && task.offset == 0) task.offset = 1;
  }
}

RandomRun random_run(Rng &rng) {
  RandomRun run;
  Workload &workload = run.workload;
  const bool moderate = chance(rng, 0.5);
  if (chance(rng, 0.3)) {
    workload = random_workload(rng);
    workload.policy = static_cast<PolicyKind>(between(rng, 0, 5));
    constexpr std::array kModes{PreemptionMode::None, PreemptionMode::Cooperative, PreemptionMode::Auto};
    workload.platform.preemption = kModes[between(rng, 0, 2)];
  } else {
    workload = contended(rng, !moderate || chance(rng, 0.4));
    workload.ties = chance(rng, 0.7) ? Ties::Share : Ties::Fixed;
  }
  if (moderate) relieve(rng, workload);
  if (moderate && has_modes(workload)) simplify(rng, workload);
  if (chance(rng, 0.25)) divide(rng, workload);
  if (chance(rng, 0.35)) {
    add_waits(rng, workload);
    if (moderate) relieve(rng, workload);
  }
  for (Dag &dag : workload.dags) {
    if (chance(rng, 0.15)) free_sources(rng, dag);
    if (chance(rng, 0.3)) dag.deadline = dag.tasks.front().period;
  }
  run.config = sched::config_of(workload);
  limit_threads(rng, workload.task_count(), run.config);
  return run;
}

sched::Config random_config(Rng &rng, PolicyKind policy, sched::Preemption preemption, std::size_t task_count) {
  sched::Config config;
  config.workers = between(rng, 1, 3);
  config.policy = policy;
  config.preemption = preemption;
  config.ties = chance(rng, 0.7) ? Ties::Share : Ties::Fixed;
  limit_threads(rng, task_count, config);
  return config;
}

std::string describe(const Workload &workload, const sched::Config &config) {
  std::string text = fmt::format("{} workers, preemption {}, {}, ties {}, {} levels, {} started at most\n",
                                 config.workers, static_cast<int>(config.preemption), to_string(config.policy),
                                 to_string(config.ties), config.levels, config.max_started);
  for (const Device &device : workload.platform.devices) {
    text += fmt::format("device {}: {} slots, {}\n", device.name, device.slots, to_string(device.queue));
  }
  std::size_t id = 0;
  for (const Dag &dag : workload.dags) {
    text += fmt::format("dag {}: max_active {}, max_pending {}, criticality {}, degrade {} {} {}\n", dag.name,
                        dag.max_active, dag.max_pending, to_string(dag.criticality), static_cast<int>(dag.degrade.kind),
                        dag.degrade.skip, dag.degrade.stretch);
    for (const Task &task : dag.tasks) {
      text += fmt::format(
          "  task {}: {}, T {}, D {}, offset {}, after {{{}}}, group '{}', concurrency {}, queue {}, priority {}, "
          "on_budget {}\n",
          id++, to_string(task.activation), format_duration(task.period), format_duration(task.deadline),
          format_duration(task.offset), fmt::join(task.predecessors, ","), task.group, task.concurrency,
          task.overrun == Overrun::Queue ? task.queue_depth : 0, task.priority.value_or(0), to_string(task.on_budget));
    }
  }
  return text;
}

}  // namespace redag::testing
