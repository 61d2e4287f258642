// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <filesystem>

#include "redag/base/check.hpp"
#include "redag_lab/cli/run/recorded_runs.hpp"
#include "tests/fuzz/scratch_file.hpp"
#include "tests/fuzz/targets.hpp"

namespace redag::fuzz {

void comparison_target(std::string_view input) {
  static const bool once = [] {
    for (const char *executor : {"redag", "mte"}) {
      std::filesystem::create_directory(scratch_folder() + "/" + executor);
      scratch_file(std::string(executor) + "/events.redag", "");
    }
    return true;
  }();
  (void)once;
  scratch_file("comparison.json", input);
  const auto found = cli::find_recorded_runs({scratch_folder()});
  if (!found) {
    REDAG_CHECK(!found.error().empty(), "a refusal says why");
  } else {
    REDAG_CHECK(found->traces() == 2, "every trace is found");
  }
}

}  // namespace redag::fuzz
