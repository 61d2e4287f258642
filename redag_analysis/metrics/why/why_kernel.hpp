// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Looks up in the kernel's record what ran instead of a thread, and why. Reads the record as far as its caller has read
// the run, and forgets the oldest parts, so that memory does not grow with the run. Internal to metrics/.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "redag_analysis/metrics/why/kernel_record.hpp"
#include "redag_analysis/metrics/why/why_cause.hpp"

namespace redag::metrics {

class KernelView {
 public:
  /// A stretch of a thread's time. Cause::Execution: it executed. Cause::Unknown: the record does not tell.
  struct Stretch {
    Cause cause = Cause::Unknown;
    std::string program;
    Time begin = 0;
    Time end = 0;
  };

  explicit KernelView(KernelReader reader) : reader_(std::move(reader)) {}

  /// Reads on, a little beyond `time`. The other functions know what happened until then. Error: a damaged file.
  [[nodiscard]] Result<void> read_until(Time time);

  /// How many events are missing, as far as the record was read.
  [[nodiscard]] std::uint64_t lost() const { return reader_.lost(); }

  /// Returns true if the record, as far as it was read, has an event in [begin, end].
  [[nodiscard]] bool covers(Time begin, Time end) const { return begun_ && *begun_ <= end && last_ >= begin; }

  /// The thread that ran a body in [begin, end): the only worker thread with a processor at both ends. Of several the
  /// only one that used this much processor time; kNever: not known.
  [[nodiscard]] std::optional<int> thread_of(Time begin, Time end, Duration processor) const;

  /// The executor's thread with this name, if it is the only one.
  [[nodiscard]] std::optional<int> thread_named(const std::string &name) const;

  /// Returns what the thread did in [begin, end), without gaps.
  [[nodiscard]] std::vector<Stretch> follow(int thread, Time begin, Time end) const;

  /// Returns what ran in [begin, end) on the processor where the thread executes at `end`, until it got that processor:
  /// it was to begin there. Stretches in which nothing of another program ran are Cause::Unknown.
  [[nodiscard]] std::vector<Stretch> before(int thread, Time begin, Time end) const;

  /// The most slices and interrupts that are kept, at about 40 bytes each.
  static constexpr std::size_t kMostKept = std::size_t{1} << 21U;

 private:
  struct Slice {  // a thread on a processor
    Time begin = 0;
    Time end = kNever;  // kNever: it goes on
    int cpu = 0;
    int thread = 0;
    int priority = 0;
    bool runnable = false;  // at its end
  };
  using Slices = std::deque<Slice>;

  void add(const KernelSwitch &event);
  [[nodiscard]] bool is_own(int thread) const;
  static void end_last(Slices &slices, const KernelSwitch &event, bool is_whole);
  void end();
  void forget();
  void occupants(int cpu, int priority, Time begin, Time end, std::vector<Stretch> &out) const;
  void executed(const Slice &slice, Time begin, Time end, std::vector<Stretch> &out) const;

  KernelReader reader_;
  std::unordered_map<int, std::string> names_;
  std::map<int, Slices> by_cpu_;
  std::map<int, Slices> by_thread_;  // those of the executor's threads
  std::map<int, std::deque<KernelInterrupt>> interrupts_;
  std::optional<Time> begun_;  // of the first row
  std::optional<Time> first_;  // the earliest time that is kept
  Time last_ = 0;              // of the last row
  std::size_t kept_ = 0;
  bool is_over_ = false;
};

}  // namespace redag::metrics
