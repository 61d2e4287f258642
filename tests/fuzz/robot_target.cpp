// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <utility>
#include <vector>

#include "redag/base/check.hpp"
#include "redag_lab/robot/changes.hpp"
#include "redag_lab/robot/input.hpp"
#include "tests/fuzz/targets.hpp"

namespace redag::fuzz {

void robot_target(std::string_view input) {
  const Result<robot::Input> read = robot::parse_input(input, "fuzz.yaml");
  if (!read) {
    REDAG_CHECK(!read.error().empty(), "a refusal says why");
    for (const Diagnostic &diagnostic : read.error()) REDAG_CHECK(!diagnostic.message.empty(), "it says something");
    return;
  }
  if (!read->robot) return;
  if (read->workload) {
    REDAG_CHECK(!has_errors(validate(read->workload->workload)), "the union of a sound robot has no mistakes");
  } else {
    REDAG_CHECK(!read->workload.error().empty(), "a refusal says why");
  }
  for (const int limit : {3, 90}) {
    const Result<robot::Plan> plan = robot::plan_of(*read->robot, runtime::band_up_to(limit));
    if (!plan) continue;
    REDAG_CHECK(plan->of_threads.size() == read->robot->threads.size(), "each entry has its level");
    (void)robot::changes_of(*read->robot, *plan, {});
  }
}

}  // namespace redag::fuzz
