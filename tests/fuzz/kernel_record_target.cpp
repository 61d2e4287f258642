// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/base/check.hpp"
#include "redag_analysis/metrics/why/kernel_record.hpp"
#include "redag_analysis/metrics/why/why_kernel.hpp"
#include "tests/fuzz/targets.hpp"

namespace redag::fuzz {

void kernel_record_target(std::string_view input) {
  const metrics::KernelRecord record = metrics::KernelRecord::of(std::string(input), kSecond);
  metrics::KernelView view(record.read().value());
  REDAG_CHECK(view.read_until(kNever).has_value(), "a text in memory can be read");
  for (const int thread : {77, 99}) {
    Time at = 0;
    for (const auto &stretch : view.follow(thread, 0, kSecond)) {
      REDAG_CHECK(stretch.begin == at && stretch.end > at, "stretches without gaps");
      at = stretch.end;
    }
    REDAG_CHECK(at == kSecond, "stretches until the end");
  }
  static_cast<void>(view.thread_of(0, kSecond, kMillisecond));
}

}  // namespace redag::fuzz
