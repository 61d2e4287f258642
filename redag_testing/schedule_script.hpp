// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A random sequence of what can happen to a scheduler, and two schedulers driven by the same sequence side by side: the
// engine of differential_test.cpp. Virtual time; deterministic.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "redag/model/workload.hpp"
#include "redag/sched/scheduler.hpp"

namespace redag::testing {

/// One happening. What it means depends on the state that it finds, so every sequence of these is a legal one, and so
/// is what is left of it when some are taken out.
struct ScriptStep {
  enum class Kind : std::uint8_t {
    Advance,
    Release,
    Miss,
    Complete,
    PreemptionPoint,
    Exceed,  // a budget, or a wcet_low
    Dispatch,
    DispatchSome,  // with a limit
    AddDag,
    RemoveDag,
    AddTask,
    RemoveTask,
    SetTiming,
  };
  Kind kind = Kind::Advance;
  std::uint8_t choice = 0;  // which task, job or DAG; how far

  friend bool operator==(const ScriptStep &, const ScriptStep &) = default;
};

using Script = std::vector<ScriptStep>;

/// `reconfigure`: DAGs and tasks are also added and removed, and get other periods.
[[nodiscard]] Script random_script(std::uint64_t seed, std::size_t length, bool reconfigure);

[[nodiscard]] std::string describe(const Script &script);

/// The first difference between the decisions of `tested` and of `expected`, in words; nothing where they are equal.
/// After every dispatch the events, the accounting of all tasks and the levels of the jobs in progress are compared.
/// Free to choose are the order of neighbouring Resumed events and of the Skipped ones of a removed DAG, and whether a
/// job that waits for its group or a thread is found to be deferred as well.
[[nodiscard]] std::optional<std::string> find_difference(sched::Scheduler &tested, sched::Scheduler &expected,
                                                         const Workload &workload, const sched::Config &config,
                                                         const Script &script);

}  // namespace redag::testing
