// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/base/check.hpp"
#include "redag_lab/experiment/acceptance.hpp"
#include "redag_lab/experiment/factorial.hpp"
#include "tests/fuzz/targets.hpp"

namespace redag::fuzz {

void plan_target(std::string_view input) {
  using namespace experiment;
  const Result<yaml::Node> root = yaml::parse(input, "fuzz.yaml");
  if (!root) return;
  const auto executors = [](World) { return std::vector<std::string>{"redag", "mte", "ste", "events"}; };
  if (const Result<FactorialPlan> plan = read_factorial_plan(*root, "fuzz.yaml", executors)) {
    REDAG_CHECK(!points_of(*plan).empty(), "a plan has something to do");
  } else {
    REDAG_CHECK(!plan.error().empty(), "a refusal says why");
  }
  if (const Result<AcceptancePlan> plan = read_acceptance_plan(*root, "fuzz.yaml")) {
    REDAG_CHECK(count_combinations(factors_of(*plan), 1) > 0, "a plan has something to do");
  } else {
    REDAG_CHECK(!plan.error().empty(), "a refusal says why");
  }
}

}  // namespace redag::fuzz
