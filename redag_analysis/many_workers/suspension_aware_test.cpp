// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/many_workers/suspension_aware.hpp"

#include <gtest/gtest.h>

#include <variant>
#include <vector>

#include <fmt/format.h>

#include "redag_analysis/one_worker/response_time.hpp"
#include "tests/testing/bound_property.hpp"
#include "tests/testing/builders.hpp"
#include "tests/testing/random_workloads.hpp"

namespace redag::analysis {
namespace {

using testing::BoundCase;
using testing::BoundCaseLimits;
using testing::BoundGenerator;
using testing::compiled;
using testing::expect_bound_holds;
using testing::tick_dag;

BoundCaseLimits tasks(sched::Preemption preemption) {
  BoundCaseLimits limits;
  limits.preemption = preemption;
  limits.max_workers = 3;
  limits.jitter = limits.overheads = true;
  limits.min_utilization = 0.1;
  limits.max_utilization = 0.6;
  limits.min_period = 10;
  limits.max_period = 150;
  return limits;
}

BoundCaseLimits graphs(sched::Preemption preemption) {
  BoundCaseLimits limits = tasks(preemption);
  limits.edges = true;
  limits.max_dags = 4;
  limits.max_tasks = 6;
  return limits;
}

BoundGenerator with_waits(const BoundCaseLimits &limits) {
  return [limits](Rng &rng) {
    BoundCase drawn = testing::random_bound_case(rng, limits);
    testing::add_waits(rng, drawn.workload);
    return drawn;
  };
}

// Every task asks one device, which is about as loaded as a processor is.
BoundGenerator with_a_busy_device(BoundCaseLimits limits) {
  limits.max_dags = 4;
  limits.max_utilization = 0.4;
  return [limits](Rng &rng) {
    BoundCase drawn = testing::random_bound_case(rng, limits);
    Device device{"gpu", static_cast<std::uint32_t>(rng.uniform(1, 3)), Device::Queue::Priority};
    if (rng.uniform(0, 2) == 0) device.queue = Device::Queue::Fifo;
    drawn.workload.platform.devices = {device};
    for (Dag &dag : drawn.workload.dags) {
      for (Task &task : dag.tasks) {
        const Duration service = rng.uniform(1, std::max<Duration>(1, task.wcet));
        task.wcet = std::max<Duration>(3, task.wcet / 3);
        task.deadline = std::max(task.deadline, task.wcet);
        task.waits = {Wait{1, service, 0, DeviceId(std::size_t{0})}};
        if (rng.uniform(0, 1) == 0) task.waits.push_back(Wait{2, rng.uniform(1, service), 0, task.waits[0].device});
      }
    }
    return drawn;
  };
}

TEST(BoundProperty, SuspensionAware) {
  expect_bound_holds(suspension_aware(), with_waits(tasks(sched::Preemption::Full)),
                     {.workloads = 600, .from_source = true});
}

TEST(BoundProperty, SuspensionAwareDags) {
  BoundCaseLimits limits = graphs(sched::Preemption::Full);
  expect_bound_holds(suspension_aware(), with_waits(limits), {.workloads = 400, .from_source = true});
  limits.caps = true;
  expect_bound_holds(suspension_aware(), with_waits(limits), {.workloads = 400, .from_source = true});
}

TEST(BoundProperty, SuspensionAwareNonpreemptive) {
  expect_bound_holds(suspension_aware(), with_waits(tasks(sched::Preemption::None)),
                     {.workloads = 400, .from_source = true});
  BoundCaseLimits limits = graphs(sched::Preemption::None);
  expect_bound_holds(suspension_aware(), with_waits(limits), {.workloads = 400, .from_source = true});
  limits.caps = true;
  expect_bound_holds(suspension_aware(), with_waits(limits), {.workloads = 400, .from_source = true});
}

TEST(BoundProperty, SuspensionAwareAtABusyDevice) {
  for (const auto mode : {sched::Preemption::Full, sched::Preemption::None}) {
    expect_bound_holds(suspension_aware(), with_a_busy_device(tasks(mode)), {.workloads = 400, .from_source = true});
    BoundCaseLimits limits = graphs(mode);
    limits.caps = true;
    expect_bound_holds(suspension_aware(), with_a_busy_device(limits), {.workloads = 300, .from_source = true});
  }
}

TEST(BoundProperty, SuspensionAwareOnOneWorker) {
  BoundCaseLimits limits = tasks(sched::Preemption::Full);
  limits.max_workers = 1;
  expect_bound_holds(suspension_aware(), with_waits(limits), {.workloads = 600, .from_source = true});
  expect_bound_holds(suspension_aware(), with_a_busy_device(limits), {.workloads = 300, .from_source = true});
}

TEST(BoundProperty, SuspensionAwareAnyOrder) {
  for (const auto mode : {sched::Preemption::Full, sched::Preemption::None}) {
    BoundCaseLimits limits = graphs(mode);
    limits.max_dags = 3;
    limits.max_utilization = 0.4;
    limits.caps = true;
    limits.policies = {PolicyKind::Edf, PolicyKind::Fifo, PolicyKind::Fixed, PolicyKind::ChainAware};
    expect_bound_holds(suspension_aware_any(), with_waits(limits), {.workloads = 300});
    expect_bound_holds(suspension_aware_any(), with_a_busy_device(limits), {.workloads = 300});
  }
}

DeviceId gpu() { return DeviceId(std::size_t{0}); }

// `hi` above `mid` above `lo`; hi and lo ask the device.
Workload three(std::uint32_t workers, Device device) {
  Workload workload = testing::make_workload(
      {tick_dag("a", {{"hi", 100, 4}}), tick_dag("b", {{"mid", 200, 10}}), tick_dag("c", {{"lo", 300, 6}})}, workers,
      PreemptionMode::Auto);
  workload.platform.devices = {std::move(device)};
  workload.dags[0].tasks[0].waits = {Wait{1, 5, 0, gpu()}, Wait{2, 3, 0, {}}};
  workload.dags[2].tasks[0].waits = {Wait{1, 7, 0, gpu()}};
  return workload;
}

std::vector<std::optional<Duration>> responses(const Workload &workload, const Method &method = suspension_aware()) {
  const Outcome outcome = method.apply(compiled(workload));
  std::vector<std::optional<Duration>> found;
  if (const auto *bound = std::get_if<Bound>(&outcome)) {
    for (const ResponseBound &task : bound->tasks) found.push_back(task.response);
  }
  return found;
}

using Responses = std::vector<std::optional<Duration>>;

TEST(SuspensionAware, CountsServiceThatHasBegunAndTheWaitsOfTheJobItself) {
  // hi: 4 + 5 + 3, and lo's service, begun a tick before. mid: 10 + 4, as hi's waits leave it the worker. lo: 6 + 7,
  // and hi and mid at the worker, hi at the device.
  EXPECT_EQ(responses(three(1, {"gpu", 1})), (Responses{12 + 6, 10 + 4, 13 + 14 + 5}));
}

TEST(SuspensionAware, ServesInTheOrderOfRequestsWhereTheDriverDoes) {
  // A request that came at the same instant counts in full.
  EXPECT_EQ(responses(three(1, {"gpu", 1, Device::Queue::Fifo})), (Responses{12 + 7, 10 + 4, 13 + 14 + 5}));
}

TEST(SuspensionAware, TwoSlotsAndTwoWorkersAreBusyTogetherBeforeAJobWaits) {
  // No task fills two slots or two workers alone.
  EXPECT_EQ(responses(three(1, {"gpu", 2})), (Responses{12 + 3, 10 + 4, 13 + 14}));
  EXPECT_EQ(responses(three(2, {"gpu", 1})), (Responses{12 + 6, 10, 13 + 4 + 5}));
}

TEST(SuspensionAware, CarriesWorkThatAWaitHasPutOff) {
  // A job of `hi` can execute at the end of its response of 9 and the next at once: 4 jobs in a window that begins
  // there. Without its wait 2 would do.
  Workload workload =
      testing::make_workload({tick_dag("a", {{"hi", 10, 4}}), tick_dag("b", {{"lo", 40, 8}})}, 1, PreemptionMode::Auto);
  workload.dags[0].tasks[0].waits = {Wait{1, 5, 0, {}}};
  EXPECT_EQ(responses(workload), (Responses{9, 8 + 3 * 4}));
  workload.dags[0].tasks[0].waits.clear();
  workload.dags[1].tasks[0].waits = {Wait{1, 1, 0, {}}};
  EXPECT_EQ(responses(workload), (Responses{4, 9 + 2 * 4}));
}

TEST(SuspensionAware, RunToCompletionBlocksAtEachWakeUp) {
  Workload workload = three(1, {"gpu", 1});
  workload.platform.preemption = PreemptionMode::None;
  // hi starts, and is woken twice: each time mid can have just begun.
  EXPECT_EQ(responses(workload)[0], 12 + 6 + 3 * 9);
}

TEST(SuspensionAware, AnyOrderCountsAllOthers) {
  Workload workload = three(2, {"gpu", 1});
  workload.policy = PolicyKind::Edf;
  EXPECT_TRUE(responses(workload).empty());
  // lo's service counts in full. One task alone does not fill two workers.
  EXPECT_EQ(responses(workload, suspension_aware_any())[0], 12 + 7 + 6);
}

TEST(SuspensionAware, IsForTasksThatWait) {
  const Outcome outcome = suspension_aware().apply(compiled(testing::independent({{1, 10}})));
  EXPECT_EQ(std::get<NotApplicable>(outcome).reason, "no task waits: see the other bounds");
}

TEST(SuspensionAware, RefusesWhatItDoesNotKnow) {
  Workload workload = three(2, {"gpu", 1});
  workload.dags[0].tasks[0].group = workload.dags[1].tasks[0].group = "g";
  EXPECT_EQ(compiled(workload).not_analysable,
            "callbacks that wait (segments) have bounds only without groups, which a job holds while it waits");
  EXPECT_FALSE(compiled(workload).has_waits);
  workload = three(2, {"gpu", 1});
  workload.dags[0].criticality = Criticality::High;
  workload.dags[0].tasks[0].wcet_low = 3;
  EXPECT_TRUE(compiled(workload).is_beyond_all()) << "no bound knows both HI mode and waits";
  workload = three(2, {"gpu", 1});
  for (const std::uint32_t slots : {4093U, 4091U, 4079U, 4073U}) {
    workload.platform.devices.push_back({"device" + std::to_string(slots), slots});
  }
  EXPECT_TRUE(responses(workload).empty()) << "sums would not be exact";
}

TEST(SuspensionAware, TermsAddUpAndNameTheDevice) {
  std::uint64_t at_device = 0;
  for (const auto mode : {sched::Preemption::Full, sched::Preemption::None}) {
    BoundCaseLimits limits = graphs(mode);
    limits.caps = true;
    testing::for_cases(with_a_busy_device(limits), 300, [&](const BoundCase &, const TaskSet &task_set, Rng &) {
      for (const Method &method : {suspension_aware(), suspension_aware_any()}) {
        const Outcome outcome = method.apply(task_set);
        const auto *bound = std::get_if<Bound>(&outcome);
        if (bound == nullptr) continue;
        for (const ResponseBound &dag : bound->dags) {
          if (!dag.response) continue;
          Duration sum = 0;
          for (const Term &term : dag.terms) {
            sum += term.amount;
            if (term.device.valid()) ++at_device;
            EXPECT_GE(term.amount, 0);
          }
          EXPECT_EQ(sum, *dag.response) << method.name;
        }
      }
    });
  }
  EXPECT_GT(at_device, 300U);
}

// On one worker neither bound is always the smaller one: waits count as execution, but R may exceed T, or work that
// waits have put off is carried.
TEST(SuspensionAware, IsMostlyBelowTheObliviousBoundAndNotAlways) {
  std::uint64_t aware = 0;
  std::uint64_t oblivious = 0;
  std::uint64_t both = 0;
  double ratios = 0;
  BoundCaseLimits limits = tasks(sched::Preemption::Full);
  limits.max_workers = 1;
  limits.jitter = limits.overheads = false;
  const auto check = [&](const BoundCase &, const TaskSet &task_set, Rng &) {
    if (!task_set.has_waits) return;
    const Outcome first = suspension_aware().apply(task_set);
    const Outcome second = rta_preemptive().apply(task_set);
    for (std::size_t t = 0; t < task_set.tasks.size(); ++t) {
      const std::optional<Duration> &seen = std::get<Bound>(first).tasks[t].response;
      const std::optional<Duration> &blind = std::get<Bound>(second).tasks[t].response;
      if (seen && blind) {
        ++both;
        ratios += static_cast<double>(*seen) / static_cast<double>(*blind);
      }
      if (seen.value_or(kNever) < blind.value_or(kNever)) ++aware;
      if (blind.value_or(kNever) < seen.value_or(kNever)) ++oblivious;
    }
  };
  testing::for_cases(with_waits(limits), static_cast<std::uint32_t>(testing::how_many(1000)), check);
  fmt::print("[ figures  ] suspension_aware below rta_preemptive: {}, above: {}; both bound {}, mean ratio {:.3f}\n",
             aware, oblivious, both, ratios / static_cast<double>(both));
  EXPECT_GT(aware, 5 * oblivious);
  EXPECT_GT(oblivious, 0U);
}

// Draws one of `all`.
template <class T>
T &any_of(Rng &rng, std::vector<T> &all) {
  return all[static_cast<std::size_t>(rng.uniform(0, static_cast<int>(all.size()) - 1))];
}

TEST(SuspensionAware, MoreWorkNeverShrinksABound) {
  std::uint64_t compared = 0;
  const auto check = [&](const BoundCase &drawn, const TaskSet &task_set, Rng &rng) {
    Workload more = drawn.workload;
    Task &task = any_of(rng, any_of(rng, more.dags).tasks);
    task.wcet += rng.uniform(0, 1);
    for (Wait &wait : task.waits) wait.longest += rng.uniform(0, 2);
    const Outcome before = suspension_aware().apply(task_set);
    const Outcome after = suspension_aware().apply(compiled(more, drawn.platform));
    if (!std::holds_alternative<Bound>(before) || !std::holds_alternative<Bound>(after)) return;
    for (std::size_t d = 0; d < more.dags.size(); ++d) {
      const std::optional<Duration> &larger = std::get<Bound>(after).dags[d].response;
      if (!larger) continue;
      EXPECT_LE(std::get<Bound>(before).dags[d].response.value_or(kNever), *larger);
      ++compared;
    }
  };
  testing::for_cases(with_waits(graphs(sched::Preemption::Full)), 400, check);
  EXPECT_GT(compared, 100U);
}

}  // namespace
}  // namespace redag::analysis
