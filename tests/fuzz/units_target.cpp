// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/base/check.hpp"
#include "redag_lab/experiment/acceptance.hpp"
#include "redag_lab/experiment/acceptance_results.hpp"
#include "redag_lab/experiment/journal.hpp"
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
  const std::string path = scratch_file("units.csv", input);
  const auto read = read_journal(path, kSubject);
  if (read) {
    AcceptanceCounter counter(acceptance);
    for (const FinishedUnit &unit : *read) {
      if (!counter.add(unit.unit, unit.result)) break;
    }
    (void)to_csv(acceptance, counter.results());
    (void)to_svg(acceptance, counter.results());
  }
  // An accepted journal must be accepted again, with the same content, before it is continued.
  Result<Journal> journal = Journal::open(path, kSubject);
  if (!journal) {
    REDAG_CHECK(!journal.error().empty(), "a refusal says why");
    return;
  }
  if (read) REDAG_CHECK(journal->found() == *read, "both ways of reading find the same");
}

}  // namespace redag::fuzz
