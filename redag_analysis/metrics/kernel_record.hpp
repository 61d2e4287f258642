// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The kernel's record of a run on threads: which thread had which processor, and interrupts. Times are those of the
// run's trace. It is the file kernel.jsonl.gz beside the trace (docs/results_format.md). Neither side holds more of it
// than some lines. redag_lab/run/ records it. Not thread-safe.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include "redag/base/ids.hpp"
#include "redag/base/provenance.hpp"
#include "redag/base/result.hpp"
#include "redag/base/time.hpp"
#include "redag/trace/trace.hpp"

namespace redag::metrics {

/// A processor goes from one thread to another. Thread 0: it idles.
struct KernelSwitch {
  Time time = 0;
  int cpu = 0;
  int from = 0;
  bool runnable = false;  // `from` could have continued; otherwise it waits for something
  int to = 0;
  int to_priority = 0;  // the kernel's: below 100 for real-time threads, smaller is more urgent

  friend bool operator==(const KernelSwitch &, const KernelSwitch &) = default;
};

/// A processor has served an interrupt.
struct KernelInterrupt {
  Time begin = 0;
  Time end = 0;
  int cpu = 0;
  std::string name;

  friend bool operator==(const KernelInterrupt &, const KernelInterrupt &) = default;
};

/// A process that ran jobs. It has the number of its first thread.
struct KernelProcess {
  int process = 0;
  std::string name;

  friend bool operator==(const KernelProcess &, const KernelProcess &) = default;
};

/// The name of a thread from here on.
struct KernelThread {
  int thread = 0;
  std::string name;
  int process = 0;  // one that ran jobs; 0: of another program, or of the kernel

  friend bool operator==(const KernelThread &, const KernelThread &) = default;
};

/// The thread that ran a job's body. It stands before what the kernel did a moment after the body began.
struct JobThread {
  TaskId task;
  std::uint32_t number = 0;
  int thread = 0;

  friend bool operator==(const JobThread &, const JobThread &) = default;
};

/// The kernel dropped events.
struct KernelLoss {
  std::uint64_t events = 0;

  friend bool operator==(const KernelLoss &, const KernelLoss &) = default;
};

using KernelRow = std::variant<KernelSwitch, KernelInterrupt, KernelProcess, KernelThread, JobThread, KernelLoss>;

/// When the row's event was over; nothing for rows that have no time.
[[nodiscard]] std::optional<Time> time_of(const KernelRow &row);

/// The row as a line of the file, with its line feed.
[[nodiscard]] std::string kernel_line(const KernelRow &row);

/// True for the priority of a SCHED_FIFO, SCHED_RR or SCHED_DEADLINE thread, as the kernel counts.
[[nodiscard]] constexpr bool is_realtime_priority(int priority) { return priority < 100; }

/// The name of the file in a folder of results.
inline constexpr std::string_view kKernelFile = "kernel.jsonl.gz";

/// Writes a record row by row, compressed.
class KernelWriter {
 public:
  /// `run` is the provenance of the run, as in its trace. Error: an unwritable place.
  [[nodiscard]] static Result<KernelWriter> create(const std::string &path, const Provenance &run);

  KernelWriter(KernelWriter &&) noexcept;
  KernelWriter &operator=(KernelWriter &&) noexcept;
  ~KernelWriter();

  /// Requires rows in the order of time_of().
  void add(const KernelRow &row);

  /// Completes the file. Until then it does not exist.
  [[nodiscard]] Result<void> commit();

 private:
  class Impl;
  explicit KernelWriter(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// Reads a record row by row.
class KernelReader {
 public:
  KernelReader(KernelReader &&) noexcept;
  KernelReader &operator=(KernelReader &&) noexcept;
  ~KernelReader();

  /// The next row; nothing after the last one. Errors name the line: no row, one out of order, an incomplete file.
  [[nodiscard]] Result<std::optional<KernelRow>> next();

 private:
  friend class KernelRecord;
  class Impl;
  explicit KernelReader(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

/// A file that can be read several times.
class KernelRecord {
 public:
  /// Opens a file, compressed or not, and reads its first line. Errors name file and line.
  [[nodiscard]] static Result<KernelRecord> open(const std::string &path);
  /// The same for bytes in memory; `file` is their name in errors.
  [[nodiscard]] static Result<KernelRecord> of(std::string bytes, const std::string &file);
  /// Opens the record beside a trace. Nothing if there is none, or that of another run than `run`.
  [[nodiscard]] static Result<std::optional<KernelRecord>> beside(const std::string &trace, const trace::RunInfo &run);

  [[nodiscard]] const std::string &path() const { return path_; }
  [[nodiscard]] const Provenance &run() const { return run_; }

  /// Begins with the first row. Error: the file is gone, or is another one now.
  [[nodiscard]] Result<KernelReader> read() const;

 private:
  [[nodiscard]] static Result<KernelRecord> opened(KernelRecord record);
  [[nodiscard]] Result<KernelReader> begin() const;

  std::string path_;
  std::shared_ptr<const std::string> bytes_;  // null: of the file
  Provenance run_;
};

}  // namespace redag::metrics
