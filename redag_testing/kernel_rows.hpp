// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A kernel's record in memory, for tests.
#pragma once

#include <span>
#include <string>

#include "redag_analysis/metrics/kernel_record.hpp"

namespace redag::testing {

/// Returns a record with these rows.
inline metrics::KernelRecord kernel_record_of(std::span<const metrics::KernelRow> rows) {
  std::string text = "{\"format\":\"redag.kernel/2\"}\n";
  for (const metrics::KernelRow &row : rows) text += metrics::kernel_line(row);
  return metrics::KernelRecord::of(text + "{\"end\":true}\n", "kernel.jsonl").value();
}

}  // namespace redag::testing
