// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <filesystem>

#include "redag/base/check.hpp"
#include "redag_lab/experiment/acceptance.hpp"
#include "redag_lab/experiment/unit_store.hpp"
#include "tests/fuzz/scratch_file.hpp"
#include "tests/fuzz/targets.hpp"

namespace redag::fuzz {

void units_target(std::string_view input) {
  using namespace experiment;
  AcceptancePlan plan;
  plan.utilization = {100'000, 200'000};
  plan.sets = 2;
  Acceptance acceptance(plan);
  const std::filesystem::path path = scratch_file("units.csv", input);
  const auto add = [&acceptance](std::uint64_t unit, const std::string &result) {
    return acceptance.add(unit, result);
  };
  // What is there can be continued, or the refusal says why.
  Result<UnitStore> store = UnitStore::open(path.parent_path(), "fuzz", add);
  if (!store) {
    REDAG_CHECK(!store.error().empty(), "a refusal says why");
    return;
  }
  REDAG_CHECK(store->append(1, "00"), "there is room");
}

}  // namespace redag::fuzz
