// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Has the kernel record context switches and interrupts while a run is on, in a tracefs buffer of its own. Needs a
// mounted tracefs and the right to write there, which mostly is root's. For use by one thread, except log().
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/trace/trace.hpp"
#include "redag_analysis/metrics/kernel_record.hpp"
#include "redag_lab/run/job_log.hpp"
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

  /// Notes that the calling thread begins the body of a job. Any thread; without a lock or an allocation.
  void log(TaskId task, std::uint32_t number) noexcept { jobs_.push({task, number, this_thread()}); }

  /// Has the record written to a file, with times since `origin` of CLOCK_MONOTONIC. Call it once, before collect().
  [[nodiscard]] Result<void> write_to(const std::string &path, const trace::RunInfo &run, Time origin);

  /// Writes what the kernel recorded since the last call. Call it several times a second: a full buffer drops events.
  void collect();

  /// Ends the recording, and returns the file, which is not yet complete. Call it once, when no body runs.
  [[nodiscard]] metrics::KernelWriter stop();

 private:
  explicit KernelRecorder(std::string instance);

  static int this_thread() noexcept;
  void read_pipe();
  void write_threads();
  void write(const metrics::JobThread &job);
  void write(std::vector<metrics::KernelRow> rows);

  std::string instance_;  // folder of the buffer
  int pipe_ = -1;
  Time origin_ = 0;
  KernelText text_;
  JobLog jobs_;
  std::map<int, std::string> own_;  // threads of this process
  std::optional<metrics::KernelWriter> writer_;
};

}  // namespace redag::lab
