// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Random workloads for bound_property.hpp.
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "tests/testing/random_workloads.hpp"

#include "tests/testing/bound_property.hpp"

namespace redag::testing {
namespace {

// UUniFast: E. Bini, G. Buttazzo, RTS 30, 2005.
std::vector<double> shares(Rng &rng, std::size_t count, double total) {
  std::vector<double> result;
  for (std::size_t i = 1; i < count; ++i) {
    const double rest = total * std::pow(rng.uniform01(), 1.0 / static_cast<double>(count - i));
    result.push_back(total - rest);
    total = rest;
  }
  result.push_back(total);
  return result;
}

class CaseGenerator {
 public:
  CaseGenerator(Rng &rng, const BoundCaseLimits &limits) : rng_(rng), limits_(limits) {}

  BoundCase run() {
    BoundCase result;
    platform(result.platform);
    Workload &workload = result.workload;
    workload.name = "random";
    workload.platform.workers = result.platform.workers;
    const auto last = static_cast<std::uint32_t>(limits_.policies.size() - 1);
    workload.policy = limits_.policies[between(rng_, 0, last)];
    const std::uint32_t count = between(rng_, 1, limits_.max_dags);
    const double total =
        result.platform.workers *
        (limits_.min_utilization + rng_.uniform01() * (limits_.max_utilization - limits_.min_utilization));
    for (const double share : shares(rng_, count, total)) {
      if (limits_.rates) {
        add_rates(workload, share);
      } else {
        limits_.edges ? add_graph(workload, share) : add_single(workload, share);
      }
    }
    for (Dag &dag : workload.dags) finish(dag);
    if (limits_.levels && chance(rng_, 0.5)) {
      result.platform.levels = between(rng_, 1, static_cast<std::uint32_t>(workload.task_count()));
    }
    workload.ties = chance(rng_, 0.7) ? Ties::Share : Ties::Fixed;
    return result;
  }

 private:
  void platform(analysis::AnalysisPlatform &platform) {
    platform.workers = between(rng_, limits_.min_workers, limits_.max_workers);
    platform.preemption = limits_.preemption;
    if (!limits_.overheads || chance(rng_, 0.5)) return;
    platform.release_overhead = rng_.uniform(0, 1);
    platform.dispatch_overhead = rng_.uniform(0, 1);
    if (platform.workers == 1) platform.preempt_overhead = rng_.uniform(0, 2);
  }

  Duration period() {
    if (limits_.equal_periods && last_period_ > 0 && chance(rng_, 0.25)) return last_period_;
    const double low = std::log(static_cast<double>(limits_.min_period));
    const double high = std::log(static_cast<double>(limits_.max_period) + 0.99);
    last_period_ = std::clamp(static_cast<Duration>(std::exp(low + rng_.uniform01() * (high - low))),
                              limits_.min_period, limits_.max_period);
    return last_period_;
  }

  Task task(Duration period, double utilization) {
    Task task;
    task.name = fmt::format("t{}", next_name_++);
    task.period = period;
    task.wcet =
        std::clamp(std::llround(utilization * static_cast<double>(period)), 1LL, static_cast<long long>(period));
    task.bcet = 1;
    task.priority = static_cast<int>(rng_.uniform(0, 4));
    if (limits_.preemption == sched::Preemption::Cooperative && chance(rng_, 0.8)) {
      task.region = rng_.uniform(1, std::max<Duration>(1, task.wcet));
    }
    if (limits_.groups && chance(rng_, 0.4)) task.group = chance(rng_, 0.5) ? "a" : "b";
    return task;
  }

  Duration deadline(const Task &task, Duration least) {
    const double ratio = limits_.min_deadline + rng_.uniform01() * (limits_.max_deadline - limits_.min_deadline);
    return std::max(
        {Duration{1}, least, static_cast<Duration>(std::llround(ratio * static_cast<double>(task.period)))});
  }

  void add_single(Workload &workload, double utilization) {
    Task single = task(period(), utilization);
    single.deadline = deadline(single, single.wcet);
    if (limits_.jitter && chance(rng_, 0.5)) single.jitter = rng_.uniform(0, single.period / 2);
    if (limits_.queues && chance(rng_, 0.5)) {
      single.overrun = Overrun::Queue;
      single.queue_depth = between(rng_, 1, 4);
      single.jitter *= between(rng_, 1, 4);
    }
    if (workload.dags.empty() || chance(rng_, 0.7)) workload.dags.push_back(named_dag(workload));
    workload.dags.back().tasks.push_back(std::move(single));
  }

  void add_graph(Workload &workload, double utilization) {
    Dag dag = named_dag(workload);
    const Duration shared_period = period();
    const std::uint32_t count = between(rng_, 1, limits_.max_tasks);
    const double data_share = rng_.uniform01() < 0.5 ? 1.0 : 0.5;
    for (const double share : shares(rng_, count, utilization)) {
      Task next = task(shared_period, share);
      const auto position = static_cast<std::uint32_t>(dag.tasks.size());
      for (std::uint32_t p = 0; p < position; ++p) {
        if (chance(rng_, 0.4)) next.predecessors.push_back(p);
      }
      if (!next.predecessors.empty() && chance(rng_, data_share)) next.activation = Activation::Data;
      next.deadline = deadline(next, 1);
      const bool is_timer = next.activation == Activation::Timer;
      if (limits_.jitter && is_timer && chance(rng_, 0.5)) next.jitter = rng_.uniform(0, next.period / 3);
      dag.tasks.push_back(std::move(next));
    }
    workload.dags.push_back(std::move(dag));
  }

  // Draws a few periods and offsets, for tasks of one grid to meet, and both data tasks and timers that wait.
  void add_rates(Workload &workload, double utilization) {
    Dag dag = named_dag(workload);
    const std::vector<Duration> periods = related_periods();
    const auto last_period = static_cast<std::uint32_t>(periods.size() - 1);
    const Duration latest = chance(rng_, 0.5) ? 0 : limits_.max_period / 2;
    const Duration offsets[] = {rng_.uniform(0, latest), rng_.uniform(0, latest)};
    const double join = 0.2 + 0.3 * rng_.uniform01();
    const double data_share = 0.3 + 0.7 * rng_.uniform01();
    for (const double share : shares(rng_, between(rng_, 1, limits_.max_tasks), utilization)) {
      std::vector<std::uint32_t> predecessors;
      Duration slowest = 0;
      for (std::uint32_t p = 0; p < dag.tasks.size(); ++p) {
        if (!chance(rng_, join)) continue;
        predecessors.push_back(p);
        slowest = std::max(slowest, dag.tasks[p].period);
      }
      const bool is_data = !predecessors.empty() && chance(rng_, data_share);
      Duration own = periods[between(rng_, 0, last_period)];
      if (is_data || (!predecessors.empty() && chance(rng_, 0.7))) own = slowest;
      Task next = task(own, share);
      next.predecessors = std::move(predecessors);
      next.activation = is_data ? Activation::Data : Activation::Timer;
      next.deadline = deadline(next, 1);
      if (!is_data) next.offset = offsets[between(rng_, 0, 1)];
      if (limits_.jitter && !is_data && chance(rng_, 0.3)) next.jitter = rng_.uniform(0, next.period / 3);
      if (limits_.queues && chance(rng_, 0.2)) {
        next.overrun = Overrun::Queue;
        next.queue_depth = between(rng_, 1, 3);
      }
      dag.tasks.push_back(std::move(next));
    }
    workload.dags.push_back(std::move(dag));
  }

  // Draws periods that are multiples of each other, or unrelated.
  std::vector<Duration> related_periods() {
    std::vector<Duration> periods = {period()};
    const bool harmonic = chance(rng_, 0.5);
    for (std::uint32_t i = between(rng_, 1, 2); i > 0; --i) {
      const Duration next = harmonic ? periods.back() * rng_.uniform(1, 3) : period();
      periods.push_back(std::min(next, limits_.max_period));
    }
    return periods;
  }

  static Dag named_dag(const Workload &workload) {
    Dag dag;
    dag.name = fmt::format("d{}", workload.dags.size());
    return dag;
  }

  void finish(Dag &dag) {
    if (limits_.caps && chance(rng_, 0.5)) {
      dag.max_active = between(rng_, 1, static_cast<std::uint32_t>(dag.tasks.size()));
    }
    if (limits_.edges && limits_.phases && chance(rng_, limits_.rates ? 0.3 : 0.1)) free_sources(rng_, dag);
    if (limits_.edges && chance(rng_, 0.3)) dag.deadline = dag.tasks.front().period;
  }

  Rng &rng_;
  const BoundCaseLimits &limits_;
  Duration last_period_ = 0;
  std::uint32_t next_name_ = 0;
};

}  // namespace

std::vector<PolicyKind> priorities_of_tasks() {
  return {PolicyKind::RateMonotonic, PolicyKind::DeadlineMonotonic, PolicyKind::Fixed};
}

BoundCase random_bound_case(Rng &rng, const BoundCaseLimits &limits) { return CaseGenerator(rng, limits).run(); }

BoundGenerator cases(const BoundCaseLimits &limits) {
  return [limits](Rng &rng) { return random_bound_case(rng, limits); };
}

}  // namespace redag::testing
