// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/base/check.hpp"
#include "redag_lab/experiment/acceptance.hpp"
#include "redag_lab/experiment/acceptance_results.hpp"
#include "redag_lab/experiment/unit_store.hpp"
#include "tests/fuzz/scratch_file.hpp"
#include "tests/fuzz/targets.hpp"

namespace redag::fuzz {

void units_target(std::string_view input) {
  using namespace experiment;
  constexpr std::string_view kSubject = "fuzz";
  static const Acceptance acceptance = [] {
    AcceptancePlan plan;
    plan.utilization = {100'000, 200'000};
    plan.sets = 2;
    return Acceptance(plan);
  }();
  const std::string path = scratch_file("units.db", input);
  if (const auto store = UnitStore::read(path, kSubject)) {
    AcceptanceCounter counter(acceptance);
    Result<UnitCursor> cursor = store->units();
    for (Result<bool> more = true; cursor && more && *more;) {
      more = cursor->next();
      if (more && *more && !counter.add(cursor->unit().unit, cursor->unit().result)) break;
    }
    (void)to_csv(acceptance, counter.results());
    (void)to_svg(acceptance, counter.results());
  }
  // What is there can be continued, or the refusal says why.
  Result<UnitStore> store = UnitStore::open(path, kSubject);
  if (!store) {
    REDAG_CHECK(!store.error().empty(), "a refusal says why");
    return;
  }
  const Result<void> added = store->append(1, "00");
  REDAG_CHECK(added || !added.error().empty(), "a refusal says why");
}

}  // namespace redag::fuzz
