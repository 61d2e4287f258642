// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A random sequence of events for a scheduler, and two schedulers driven by the same sequence side by side. The engine
// of differential_test.cpp. Virtual time; deterministic.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "redag/model/workload.hpp"
#include "redag/sched/scheduler.hpp"

namespace redag::testing {

/// One event. Its meaning depends on the state that it meets. Every sequence of steps is therefore legal, and stays
/// legal when steps are removed.
struct ScriptStep {
  enum class Kind : std::uint8_t {
    Advance,
    Release,
    Miss,
    Complete,
    Finish,  // completes a job and dispatches: the tested scheduler in one call, the expected one in two
    PreemptionPoint,
    Exceed,  // of a budget, or of a wcet_low
    Wait,    // for a device or for something else
    Wake,
    Dispatch,
    DispatchSome,  // with a limit
    AddDag,
    RemoveDag,
    AddTask,
    RemoveTask,
    SetTiming,
  };
  Kind kind = Kind::Advance;
  std::uint8_t choice = 0;  // which task, job or DAG, or how far to advance

  friend bool operator==(const ScriptStep &, const ScriptStep &) = default;
};

using Script = std::vector<ScriptStep>;

/// With `reconfigure`, DAGs and tasks are also added and removed, and get other periods.
[[nodiscard]] Script random_script(std::uint64_t seed, std::size_t length, bool reconfigure);

[[nodiscard]] std::string describe(const Script &script);

/// Returns the first difference between the decisions of `tested` and of `expected`, in words; empty if they are equal.
/// After every dispatch the events, the accounting of all tasks and the levels of the jobs in progress are compared.
/// The order of neighbouring Resumed events may differ, and that of the Skipped ones of a removed DAG. A job that waits
/// for its group or a thread may also count as deferred on one side alone.
[[nodiscard]] std::optional<std::string> find_difference(sched::Scheduler &tested, sched::Scheduler &expected,
                                                         const Workload &workload, const sched::Config &config,
                                                         const Script &script);

}  // namespace redag::testing
