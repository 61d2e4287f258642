// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Lets a library that is loaded beside the executor see its events as they happen, such as the provider for LTTng
// (redag/lttng). The executor does not know who listens. Without a listener, a decision pays for one load. Any thread.
#pragma once

#include <atomic>

#include "redag/base/ids.hpp"
#include "redag/base/time.hpp"
#include "redag/model/job_event.hpp"
#include "redag/model/workload.hpp"

namespace redag::trace {

/// A listener. The executor calls it under its lock and on its real-time threads: it must neither block nor call back.
/// `executor` tells the executors of a process apart.
struct Tap {
  void (*task)(const void *executor, TaskId id, DagId dag, const Task &task) noexcept;
  void (*event)(const void *executor, const JobEvent &event) noexcept;
  /// A job finished `lateness` after its deadline.
  void (*late)(const void *executor, const JobEvent &finished, Duration lateness) noexcept;
};

namespace detail {
inline std::atomic<const Tap *> tap{nullptr};
}

/// The listener; null if there is none.
[[nodiscard]] inline const Tap *tap() noexcept { return detail::tap.load(std::memory_order_acquire); }

}  // namespace redag::trace

/// Makes `tap`, which must stay where it is, the listener. Has a plain name, by which a loaded library finds it. An
/// engine without a trace tells a listener that came later of skips and preemptions at most, and of no earlier task.
extern "C" __attribute__((visibility("default"))) void redag_set_tap(const redag::trace::Tap *tap);
