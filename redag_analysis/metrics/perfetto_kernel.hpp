// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The kernel's record of a run, as Perfetto draws it: a track for each processor with its threads and interrupts, and
// the states of threads. Writes the kernel's own events (ftrace), on the clock of the jobs.
#pragma once

#include <string>

#include "redag_analysis/metrics/kernel_record.hpp"
#include "redag_analysis/metrics/perfetto_packets.hpp"

namespace redag::metrics::perfetto {

/// The process that ran the jobs: its first thread has its number. 0: the record names none of its threads.
[[nodiscard]] int process_of(const KernelRecord &record);

/// "redag-0"; "thread 17" if the record does not name it.
[[nodiscard]] std::string thread_name(const KernelRecord &record, int thread);

/// Writes the record from `start` on, which is time 0 of the file. `program` names the process.
void write_kernel(PacketWriter &writer, const KernelRecord &record, Time start, const std::string &program);

}  // namespace redag::metrics::perfetto
