// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// How long an idle thread looks for a job before it sleeps: counted in looks, so that an idle thread reads no clock.
#pragma once

#include <cstdint>

#include "redag/base/time.hpp"
#include "redag/runtime/setup.hpp"

namespace redag::runtime {

/// Looks of Parker::park() that take about `duration` (ns) on this machine: measured once, in less than a millisecond.
[[nodiscard]] std::uint32_t looks_in(Duration duration);

/// For EngineOptions::looks. With os none, and a warning in `setup`: a real-time thread that looks for a job would keep
/// others off its processor.
[[nodiscard]] std::uint32_t looks_before_sleep(Setup &setup, Duration spin);

}  // namespace redag::runtime
