// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/base/check.hpp"
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
  if (read->robot) {
    REDAG_CHECK(!has_errors(validate(read->loaded.workload)), "the union of a sound robot has no mistakes");
  }
}

}  // namespace redag::fuzz
