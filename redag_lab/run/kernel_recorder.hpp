// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Has the kernel record context switches and interrupts while a run is on, in a tracefs buffer of its own. Needs a
// mounted tracefs and the right to write there, which mostly is root's. For use by one thread, except log().
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag_analysis/metrics/kernel_record.hpp"
#include "redag_lab/run/kernel_text.hpp"

namespace redag::lab {

class KernelRecorder {
 public:
  /// Starts recording these processors. Error: there is no tracefs, or the process may not use it, with a hint.
  [[nodiscard]] static Result<std::unique_ptr<KernelRecorder>> start(const std::vector<int> &cpus);
  /// Ends the recording, and removes the buffer.
  ~KernelRecorder();
  KernelRecorder(const KernelRecorder &) = delete;
  KernelRecorder &operator=(const KernelRecorder &) = delete;

  /// Notes that the calling thread begins the body of a job. Any thread; without allocation.
  void log(TaskId task, std::uint32_t number) noexcept;

  /// Takes what the kernel recorded since the last call. Call it several times a second: a full buffer drops events.
  void collect();

  /// Returns the record, with times since `origin` of CLOCK_MONOTONIC. Call once, when no body runs.
  [[nodiscard]] metrics::KernelRecord stop(Time origin);

 private:
  explicit KernelRecorder(std::string instance);

  std::string instance_;  // folder of the buffer
  int pipe_ = -1;
  KernelText text_;
  std::map<int, std::string> own_;  // threads of this process
  std::vector<metrics::JobThread> jobs_;
  std::atomic<std::size_t> used_{0};
};

}  // namespace redag::lab
