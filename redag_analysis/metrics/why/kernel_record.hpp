// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What the kernel recorded during a run: context switches and interrupts, as the text of 'trace-cmd report',
// 'perf script' or tracefs. Its times are those of CLOCK_MONOTONIC; rows have the run's own. Not thread-safe.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>

#include "redag/base/result.hpp"
#include "redag/base/time.hpp"
#include "redag/trace/input_file.hpp"

namespace redag::metrics {

/// A processor goes from one thread to another. Thread 0: it idles.
struct KernelSwitch {
  Time time = 0;
  int cpu = 0;
  int from = 0;
  bool runnable = false;  // `from` could have continued; otherwise it waits for something
  int to = 0;
  int to_priority = 0;  // the kernel's: below 100 for real-time threads, smaller is more urgent
  std::string to_name;

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

using KernelRow = std::variant<KernelSwitch, KernelInterrupt>;

/// When the row's event was over.
[[nodiscard]] Time time_of(const KernelRow &row);

/// True for the priority of a SCHED_FIFO, SCHED_RR or SCHED_DEADLINE thread, as the kernel counts.
[[nodiscard]] constexpr bool is_realtime_priority(int priority) { return priority < 100; }

/// Reads a record row by row. Holds a line of it, and interrupts that have not ended.
class KernelReader {
 public:
  KernelReader(trace::InputFile file, std::shared_ptr<const std::string> bytes, Time origin)
      : bytes_(std::move(bytes)), file_(std::move(file)), origin_(origin) {}

  /// The next row; nothing after the last one. Lines that it does not know are ignored. Error: what the system refuses.
  [[nodiscard]] Result<std::optional<KernelRow>> next();

  /// Events that the kernel dropped, and events that stand behind later ones, which are left out.
  [[nodiscard]] std::uint64_t lost() const { return lost_; }

 private:
  [[nodiscard]] Result<std::optional<std::string_view>> next_line();
  std::optional<KernelRow> read(std::string_view line);
  std::optional<KernelRow> read_interrupt(std::string_view event, Time time, int cpu, std::string_view fields);

  std::shared_ptr<const std::string> bytes_;  // of `file_`, if it is in memory
  trace::InputFile file_;
  Time origin_;
  std::uint64_t offset_ = 0;                              // in the file
  std::string text_;                                      // some of the lines
  std::size_t at_ = 0;                                    // in the text: the next line
  std::map<std::pair<int, bool>, KernelInterrupt> open_;  // by processor, and true for a softirq
  std::optional<Time> last_;
  std::uint64_t lost_ = 0;
};

/// A record that can be read several times.
class KernelRecord {
 public:
  /// `origin` is CLOCK_MONOTONIC at time 0 of the run. Error: what the system refuses.
  [[nodiscard]] static Result<KernelRecord> open(const std::string &path, Time origin);
  /// The same for a text in memory.
  [[nodiscard]] static KernelRecord of(std::string text, Time origin);

  [[nodiscard]] const std::string &path() const { return path_; }

  /// Begins with the first row.
  [[nodiscard]] Result<KernelReader> read() const;

 private:
  std::string path_;
  std::shared_ptr<const std::string> bytes_;  // null: of the file
  Time origin_ = 0;
};

}  // namespace redag::metrics
