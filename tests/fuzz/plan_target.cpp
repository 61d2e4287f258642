// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/base/check.hpp"
#include "redag_lab/experiment/acceptance.hpp"
#include "redag_lab/experiment/acceptance_plan.hpp"
#include "redag_lab/experiment/factorial_plan.hpp"
#include "tests/fuzz/targets.hpp"

namespace redag::fuzz {

namespace {

using namespace experiment;

void factorial(std::string_view input) {
  const auto executors = [](World) { return std::vector<std::string>{"redag", "mte", "ste", "events"}; };
  const Result<FactorialPlan> plan = parse_factorial_plan(input, "fuzz.yaml", executors);
  if (!plan) {
    REDAG_CHECK(!plan.error().empty(), "a refusal says why");
    return;
  }
  const std::string text = to_yaml(*plan);
  const Result<FactorialPlan> again = parse_factorial_plan(text, "again.yaml", executors);
  REDAG_CHECK(again.has_value() && to_yaml(*again) == text, "what was written is read as it was");
  REDAG_CHECK(!points_of(*plan).empty(), "a plan has something to do");
}

}  // namespace

void plan_target(std::string_view input) {
  factorial(input);
  const Result<AcceptancePlan> plan = parse_acceptance_plan(input, "fuzz.yaml");
  if (!plan) {
    REDAG_CHECK(!plan.error().empty(), "a refusal says why");
    return;
  }
  const std::string text = to_yaml(*plan);
  const Result<AcceptancePlan> again = parse_acceptance_plan(text, "again.yaml");
  REDAG_CHECK(again.has_value() && to_yaml(*again) == text, "what was written is read as it was");
  REDAG_CHECK(unit_count(*plan) > 0, "a plan has something to do");
}

}  // namespace redag::fuzz
