// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/base/check.hpp"
#include "redag_analysis/metrics/kernel_record.hpp"
#include "redag_analysis/metrics/why_kernel.hpp"
#include "tests/fuzz/scratch_file.hpp"
#include "tests/fuzz/targets.hpp"

namespace redag::fuzz {

void kernel_record_target(std::string_view input) {
  const Result<metrics::KernelRecord> record = metrics::parse_kernel_record(input, "kernel.jsonl");
  if (!record) {
    REDAG_CHECK(!record.error().empty(), "a refusal says why");
    return;
  }
  const metrics::KernelView view(*record);
  for (const metrics::JobThread &job : record->jobs) {
    Time at = 0;
    for (const auto &stretch : view.follow(job.thread, 0, kSecond)) {
      REDAG_CHECK(stretch.begin == at && stretch.end > at, "stretches without gaps");
      at = stretch.end;
    }
    REDAG_CHECK(at == kSecond, "stretches until the end");
  }
  const std::string path = scratch_folder() + "/kernel.jsonl";
  REDAG_CHECK(metrics::write_kernel_record(path, *record).has_value(), "kernel.jsonl");
  REDAG_CHECK(metrics::read_kernel_record(path).has_value(), "what was written can be read");
}

}  // namespace redag::fuzz
