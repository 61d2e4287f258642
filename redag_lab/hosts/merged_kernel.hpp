// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The kernel's records of several hosts as one, on the clock of their merged run. Processors and threads of each host
// have numbers of their own there. Not thread-safe.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag_analysis/metrics/kernel_record.hpp"
#include "redag_lab/hosts/merged_run.hpp"

namespace redag::hosts {

/// The record of one host, and what its numbers become in the merged one.
struct HostKernel {
  const Host *host = nullptr;  // of the merged run
  metrics::KernelRecord record;
  int first_cpu = 0;     // added to numbers of processors
  int first_thread = 0;  // added to numbers of threads, except 0

  /// Its row in the merged record.
  [[nodiscard]] metrics::KernelRow merged(metrics::KernelRow row) const;
};

/// Opens the records beside the hosts' events, and counts their processors, for which it reads them. Hosts without one
/// are left out. `merged` must outlive the result. Errors: those of the readers, too many processors.
[[nodiscard]] Result<std::vector<HostKernel>> open_kernel_records(const MergedRun &merged);

/// Writes the rows of all records up to the end of the merged run, in order of time. `is_stopped` is asked now and
/// then, and makes it an error. Errors: those of the readers.
[[nodiscard]] Result<void> merge_kernel_records(const MergedRun &merged, const std::vector<HostKernel> &kernels,
                                                const std::function<bool()> &is_stopped, metrics::KernelWriter &writer);

}  // namespace redag::hosts
