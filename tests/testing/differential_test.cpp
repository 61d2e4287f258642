// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// PriorityScheduler against ReferenceScheduler: the same events must give the same decisions.
#include <algorithm>
#include <optional>
#include <string>
#include <tuple>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "redag/sched/policy.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "tests/testing/environment.hpp"
#include "tests/testing/random_workloads.hpp"
#include "tests/testing/reference_scheduler.hpp"
#include "tests/testing/schedule_script.hpp"

namespace redag::testing {
namespace {

using sched::Preemption;

struct Case {
  Workload workload;
  sched::Config config;
  Script script;
};

std::optional<std::string> find_difference(const Case &c) {
  sched::PriorityScheduler tested(c.workload, c.config);
  ReferenceScheduler expected(c.workload, c.config);
  return find_difference(tested, expected, c.workload, c.config, c.script);
}

/// Removes steps from the script that the difference does not need.
void shrink(Case &c) {
  for (bool progress = true; progress;) {
    progress = false;
    for (std::size_t i = c.script.size(); i-- > 0;) {
      Case smaller = c;
      smaller.script.erase(smaller.script.begin() + static_cast<std::ptrdiff_t>(i));
      if (!find_difference(smaller)) continue;
      c = smaller;
      progress = true;
    }
  }
}

Case make_case(PolicyKind policy, Preemption preemption, std::uint64_t seed) {
  Rng rng(seed);
  RandomWorkloadLimits limits;
  limits.max_dags = static_cast<std::uint32_t>(rng.uniform(1, 3));
  limits.max_tasks = static_cast<std::uint32_t>(rng.uniform(1, 6));
  Case c;
  c.workload = random_workload(rng, limits);
  c.config = random_config(rng, policy, preemption, c.workload.task_count());
  c.workload.platform.devices = random_devices(rng);
  c.script = random_script(seed, static_cast<std::size_t>(rng.uniform(10, 300)), rng.uniform01() < 0.4);
  return c;
}

/// Returns an empty text, or everything needed to reproduce the difference.
std::string report_difference(Case c, const std::string &replay) {
  if (!find_difference(c)) return {};
  shrink(c);
  return fmt::format("{}{}\n{}\n{}", describe(c.workload, c.config), describe(c.script), *find_difference(c), replay);
}

class Differential : public ::testing::TestWithParam<std::tuple<PolicyKind, Preemption>> {};

// REDAG_DIFFERENTIAL_SEED and REDAG_DIFFERENTIAL_COUNT choose other workloads than the default ones.
TEST_P(Differential, DecidesAsTheReferenceDoes) {
  const auto [policy, preemption] = GetParam();
  const std::uint64_t first = from_environment("REDAG_DIFFERENTIAL_SEED").value_or(1);
  const std::uint64_t count = from_environment("REDAG_DIFFERENTIAL_COUNT").value_or(400);
  for (std::uint64_t seed = first; seed < first + count; ++seed) {
    const std::string &test = ::testing::UnitTest::GetInstance()->current_test_info()->name();
    const std::string replay = fmt::format(
        "replay: REDAG_DIFFERENTIAL_SEED={} REDAG_DIFFERENTIAL_COUNT=1 redag_testing_test --gtest_filter='*.{}'", seed,
        test);
    const std::string difference = report_difference(make_case(policy, preemption, seed), replay);
    ASSERT_TRUE(difference.empty()) << difference;
  }
}

std::string name_of(const ::testing::TestParamInfo<Differential::ParamType> &info) {
  constexpr const char *kModes[] = {"none", "cooperative", "full"};
  return fmt::format("{}_{}", to_string(std::get<0>(info.param)), kModes[static_cast<int>(std::get<1>(info.param))]);
}

INSTANTIATE_TEST_SUITE_P(
    All, Differential,
    ::testing::Combine(::testing::Values(PolicyKind::RateMonotonic, PolicyKind::DeadlineMonotonic, PolicyKind::Fixed,
                                         PolicyKind::Edf, PolicyKind::Fifo, PolicyKind::ChainAware),
                       ::testing::Values(Preemption::None, Preemption::Cooperative, Preemption::Full)),
    name_of);

// The same with sequences that RapidCheck makes and shrinks.
RC_GTEST_PROP(DifferentialProperty, AnySequenceOfEventsIsDecidedAlike, (std::uint64_t seed)) {
  const auto policy = *rc::gen::element(PolicyKind::RateMonotonic, PolicyKind::DeadlineMonotonic, PolicyKind::Fixed,
                                        PolicyKind::Edf, PolicyKind::Fifo, PolicyKind::ChainAware);
  const auto preemption = *rc::gen::element(Preemption::None, Preemption::Cooperative, Preemption::Full);
  Case c = make_case(policy, preemption, seed);
  using Kind = ScriptStep::Kind;
  const auto kind = rc::gen::weightedElement<Kind>({{6, Kind::Release},
                                                    {6, Kind::Dispatch},
                                                    {4, Kind::Complete},
                                                    {2, Kind::Advance},
                                                    {2, Kind::PreemptionPoint},
                                                    {1, Kind::Miss},
                                                    {1, Kind::Exceed},
                                                    {2, Kind::Wait},
                                                    {2, Kind::Wake},
                                                    {1, Kind::DispatchSome},
                                                    {1, Kind::AddTask},
                                                    {1, Kind::RemoveTask},
                                                    {1, Kind::SetTiming}});
  c.script = *rc::gen::scale(
      3.0, rc::gen::container<Script>(rc::gen::construct<ScriptStep>(kind, rc::gen::arbitrary<std::uint8_t>())));
  const std::optional<std::string> difference = find_difference(c);
  if (difference) RC_FAIL(describe(c.workload, c.config) + describe(c.script) + "\n" + *difference);
}

// Compares assign_priorities() with a sort by the table of docs/model.md, written out here.
bool comes_before(PolicyKind policy, const Workload &w, const TaskRef &a, const TaskRef &b) {
  const Dag &da = w.dags[a.dag.value];
  const Dag &db = w.dags[b.dag.value];
  const auto smallest = [](const Dag &dag) {
    Duration period = kNever;
    for (const Task &task : dag.tasks) period = std::min(period, task.period);
    return period;
  };
  const std::uint32_t ta = topological_ranks(da)[a.index];
  const std::uint32_t tb = topological_ranks(db)[b.index];
  const int pa = a.task->priority.value_or(0);
  const int pb = b.task->priority.value_or(0);
  if (policy == PolicyKind::RateMonotonic && a.task->period != b.task->period) return a.task->period < b.task->period;
  if (policy == PolicyKind::DeadlineMonotonic && a.task->deadline != b.task->deadline) {
    return a.task->deadline < b.task->deadline;
  }
  if (policy == PolicyKind::Fixed && pa != pb) return pa > pb;
  if (policy == PolicyKind::ChainAware) {
    if (da.criticality != db.criticality) return da.criticality > db.criticality;
    if (smallest(da) != smallest(db)) return smallest(da) < smallest(db);
    return a.dag != b.dag ? a.dag < b.dag : ta > tb;
  }
  return a.dag != b.dag ? a.dag < b.dag : ta < tb;
}

// Compares all that the policy looks at. chain_aware looks at the DAG and the place in it, which always differ.
bool are_equal(PolicyKind policy, const Task &a, const Task &b) {
  if (policy == PolicyKind::RateMonotonic) return a.period == b.period;
  if (policy == PolicyKind::DeadlineMonotonic) return a.deadline == b.deadline;
  return policy == PolicyKind::Fixed && a.priority.value_or(0) == b.priority.value_or(0);
}

RC_GTEST_PROP(Priorities, AreThePlacesInTheOrderOfThePolicy, (std::uint64_t seed)) {
  Rng rng(seed);
  const Workload w = random_workload(rng, {4, 6, true, true, true});
  const std::vector<TaskRef> tasks = flatten(w);
  for (const PolicyKind policy : {PolicyKind::RateMonotonic, PolicyKind::DeadlineMonotonic, PolicyKind::Fixed,
                                  PolicyKind::Edf, PolicyKind::Fifo, PolicyKind::ChainAware}) {
    const auto levels = static_cast<std::uint32_t>(rng.uniform(0, static_cast<std::int64_t>(tasks.size()) + 1));
    const Ties ties = rng.uniform(0, 1) == 0 ? Ties::Share : Ties::Fixed;
    const std::vector<sched::Priority> priorities = sched::assign_priorities(w.dags, policy, ties, levels);
    std::uint32_t tiers = 0;
    for (const sched::Priority &priority : priorities) tiers = std::max(tiers, priority.tier + 1);
    const bool enough = levels == 0 || levels >= tiers || !is_static(policy);
    for (std::size_t i = 0; i < tasks.size(); ++i) {
      const auto rank = std::count_if(tasks.begin(), tasks.end(),
                                      [&](const TaskRef &other) { return comes_before(policy, w, other, tasks[i]); });
      RC_ASSERT(priorities[i].rank == static_cast<std::uint32_t>(rank));
      RC_ASSERT(priorities[i].level < (enough ? tasks.size() : levels));
      for (std::size_t j = 0; j < tasks.size(); ++j) {
        if (i == j) continue;
        const bool is_tie = ties == Ties::Share && are_equal(policy, *tasks[i].task, *tasks[j].task);
        RC_ASSERT((priorities[i].tier == priorities[j].tier) == is_tie);
        RC_ASSERT(!enough || priorities[i].level == priorities[i].tier);
        RC_ASSERT(priorities[i].rank > priorities[j].rank || priorities[i].tier <= priorities[j].tier);
        RC_ASSERT(priorities[i].tier > priorities[j].tier || priorities[i].level <= priorities[j].level);
        // Equal rates share a level before different ones do.
        if (!enough && policy == PolicyKind::RateMonotonic && tasks[i].task->period == tasks[j].task->period) {
          RC_ASSERT(priorities[i].level == priorities[j].level);
        }
      }
    }
  }
}

}  // namespace
}  // namespace redag::testing
