// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// How long an idle thread spins before it sleeps. Counted in spins, because a spinning thread reads no clock. Any
// thread.
#pragma once

#include <cstdint>

#include "redag/base/time.hpp"
#include "redag/threads/setup.hpp"

namespace redag::runtime {

/// Returns how many spins of Parker::park() take about `duration` (ns) on this machine. Measures it once, in less than
/// a millisecond.
[[nodiscard]] std::uint32_t spins_in(Duration duration);

/// Returns the value for EngineOptions::spins. With os it is 0, with a warning in `setup`: a real-time thread that
/// spins would keep others off its processor.
[[nodiscard]] std::uint32_t spins_before_sleep(Setup &setup, Duration spin);

}  // namespace redag::runtime
