// PriorityScheduler against ReferenceScheduler: the same events must give the same decisions.
#include <cstdlib>
#include <string>
#include <tuple>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "redag/sched/policy.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag/testing/random_workloads.hpp"
#include "redag/testing/reference_scheduler.hpp"
#include "redag/testing/schedule_script.hpp"

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

/// Takes out of the script, step by step, what the difference does not need.
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
  c.script = random_script(seed, static_cast<std::size_t>(rng.uniform(10, 300)), rng.uniform01() < 0.2);
  return c;
}

/// Empty, or all that is needed to see the difference again.
std::string report_difference(Case c, const std::string &replay) {
  if (!find_difference(c)) return {};
  shrink(c);
  return fmt::format("{}{}\n{}\n{}", describe(c.workload, c.config), describe(c.script), *find_difference(c), replay);
}

std::uint64_t from_environment(const char *name, std::uint64_t fallback) {
  const char *text = std::getenv(name);
  return text == nullptr ? fallback : std::strtoull(text, nullptr, 10);
}

class Differential : public ::testing::TestWithParam<std::tuple<PolicyKind, Preemption>> {};

// REDAG_DIFFERENTIAL_SEED and REDAG_DIFFERENTIAL_COUNT choose other workloads than the committed ones.
TEST_P(Differential, DecidesAsTheReferenceDoes) {
  const auto [policy, preemption] = GetParam();
  const std::uint64_t first = from_environment("REDAG_DIFFERENTIAL_SEED", 1);
  const std::uint64_t count = from_environment("REDAG_DIFFERENTIAL_COUNT", 400);
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

}  // namespace
}  // namespace redag::testing
