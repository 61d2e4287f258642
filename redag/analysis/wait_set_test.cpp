#include "redag/analysis/wait_set.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <map>

#include <fmt/format.h>

#include "redag/sched/executors.hpp"
#include "redag/sim/simulator.hpp"
#include "redag/testing/bound_property.hpp"

namespace redag::analysis {
namespace {

// Largest f - origin of each DAG's jobs under the model of rclcpp's executor.
std::vector<Duration> observed(const System &system, const testing::BoundCase &bound_case, int run, Rng &rng) {
  Workload workload = bound_case.workload;
  std::vector<Duration> offsets;
  for (const Unit &unit : system.units) offsets.push_back(run == 0 ? 0 : rng.uniform(0, unit.period));
  std::uint32_t id = 0;
  Duration longest = 0;
  for (Dag &dag : workload.dags) {
    for (Task &task : dag.tasks) {
      const std::uint32_t unit = system.tasks[id++].unit;
      if (task.activation == Activation::Timer) task.offset = offsets[unit];
      longest = std::max(longest, task.period);
    }
  }
  const std::uint64_t seed = rng();
  sim::Options options;
  options.horizon = 12 * longest;
  options.seed = seed;
  options.demand = [seed, run](const Task &task, TaskId task_id, std::uint32_t number) {
    return run % 2 == 0 ? task.wcet : Rng::stream(seed, task_id.value, number).uniform(1, task.wcet);
  };
  sched::Config config;
  config.workers = bound_case.platform.workers;
  config.policy = workload.policy;
  const auto scheduler = sched::make_scheduler(config.workers == 1 ? "ste" : "mte", workload, config);
  std::vector<Duration> responses(system.dags.size(), 0);
  std::map<std::pair<std::uint32_t, std::uint32_t>, Time> origins;
  sim::simulate(workload, *scheduler, config.workers, options, [&](std::span<const JobEvent> events) {
    for (const JobEvent &event : events) {
      const std::pair job(event.task.value, event.job);
      if (event.kind == JobEventKind::Ready) origins[job] = event.value;
      if (event.kind != JobEventKind::Finished) continue;
      Duration &response = responses[system.tasks[event.task.value].dag.value];
      response = std::max(response, event.value - origins.at(job));
    }
    return true;
  });
  return responses;
}

TEST(WaitSetBound, HoldsUnderTheModelOfRclcpp) {
  std::uint64_t wanted = 1500;
  if (const char *many = std::getenv("REDAG_BOUND_WORKLOADS")) wanted = std::strtoull(many, nullptr, 10);
  testing::BoundCaseLimits limits;
  limits.preemption = sched::Preemption::None;
  limits.policies = {PolicyKind::RateMonotonic};
  limits.max_workers = 4;
  limits.max_dags = 4;
  limits.jitter = limits.caps = true;
  limits.min_utilization = 0.02;
  limits.max_utilization = 0.3;
  limits.min_period = 20;
  limits.max_period = 300;
  std::uint64_t bounds = 0;
  std::uint64_t violations = 0;
  double ratios = 0;
  for (std::uint64_t i = 0; i < wanted; ++i) {
    Rng rng(mix(i));
    limits.edges = i % 2 == 0;
    const testing::BoundCase bound_case = random_bound_case(rng, limits);
    const System system = compile(bound_case.workload, bound_case.platform).value();
    const Outcome outcome = wait_set().apply(system);
    if (!system.not_analysable.empty() || !std::holds_alternative<Bound>(outcome)) continue;
    std::vector<Duration> worst(system.dags.size(), 0);
    for (int run = 0; run < 5; ++run) {
      const std::vector<Duration> responses = observed(system, bound_case, run, rng);
      for (std::size_t d = 0; d < worst.size(); ++d) worst[d] = std::max(worst[d], responses[d]);
    }
    for (std::size_t d = 0; d < worst.size(); ++d) {
      const auto response = std::get<Bound>(outcome).dags[d].response;
      if (!response) continue;
      ++bounds;
      ratios += static_cast<double>(worst[d]) / static_cast<double>(*response);
      if (worst[d] <= *response) continue;
      if (violations++ == 0) ADD_FAILURE() << worst[d] << " above " << *response << "\n" << describe(bound_case);
    }
  }
  fmt::print("[ figures  ] wait_set: {} workloads, {} bounds, {} violations; mean observed/bound {:.3f}\n", wanted,
             bounds, violations, ratios / static_cast<double>(bounds));
  EXPECT_EQ(violations, 0U);
  EXPECT_GT(bounds, wanted / 2);
}

Workload three_timers(std::uint32_t workers) {
  Workload workload;
  workload.name = "w";
  workload.platform = {workers, PreemptionMode::None};
  for (const Duration wcet : {3, 5, 7}) {
    Task task;
    task.name = "t";
    task.wcet = task.bcet = wcet;
    task.period = task.deadline = 100;
    Dag dag;
    dag.name = "d" + std::to_string(wcet);
    dag.tasks.push_back(task);
    workload.dags.push_back(dag);
  }
  return workload;
}

TEST(WaitSetBound, EveryOtherCallbackOnceAndThoseBeforeTwice) {
  for (const std::uint32_t workers : {1U, 2U}) {
    const Workload workload = three_timers(workers);
    const System system = compile(workload, platform_of(workload)).value();
    const Outcome outcome = wait_set().apply(system);
    const auto &bound = std::get<Bound>(outcome);
    EXPECT_EQ(bound.tasks[0].response, 3 + (5 + 7) / workers);
    EXPECT_EQ(bound.tasks[1].response, 5 + (3 + 7 + 3) / workers);
    EXPECT_EQ(bound.tasks[2].response, 7 + (3 + 5 + 3 + 5) / workers);
  }
}

TEST(WaitSetBound, IsNotAmongTheMethodsForOurScheduler) { EXPECT_EQ(find_method("wait_set"), nullptr); }

}  // namespace
}  // namespace redag::analysis
