// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The kernel's own record of which thread it ran on which processor: context switches and timer interrupts, by
// perf_event_open. Needs CAP_PERFMON, root, or kernel.perf_event_paranoid <= 0. For use by one thread.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/base/time.hpp"

namespace redag::testing {

struct SwitchEvent {
  enum class Kind : std::uint8_t {
    In,         // the thread got the processor
    Preempted,  // it lost the processor, and could have continued
    Slept,      // it gave the processor up to wait for something
    Beat,       // the processor served its timer: it executes, and could have switched
  };
  Time time = 0;  // CLOCK_MONOTONIC
  Kind kind = Kind::In;
  int cpu = 0;
  pid_t thread = 0;  // 0: the processor idles
};

/// The kernel's record of some processors, from its creation to stop().
class SwitchRecorder {
 public:
  /// Starts recording; every `beat` each processor records that it executes. Error: the kernel refuses, with a hint.
  [[nodiscard]] static Result<SwitchRecorder> start(const std::vector<int> &cpus, Duration beat);
  ~SwitchRecorder();
  SwitchRecorder(SwitchRecorder &&) noexcept;
  SwitchRecorder &operator=(SwitchRecorder &&) noexcept;

  /// Returns all events by time. Error: the kernel dropped some.
  [[nodiscard]] Result<std::vector<SwitchEvent>> stop();

 private:
  class Ring;
  explicit SwitchRecorder(std::vector<std::unique_ptr<Ring>> rings);
  std::vector<std::unique_ptr<Ring>> rings_;
};

}  // namespace redag::testing
