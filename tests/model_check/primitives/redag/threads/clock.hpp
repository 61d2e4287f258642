// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Replaces redag/threads/clock.hpp by the explorer's time. Processor time stands still.
#pragma once

#include <ctime>

#include "redag/base/time.hpp"
#include "tests/testing/explorer.hpp"

namespace redag::runtime {

[[nodiscard]] inline Time monotonic_now() noexcept { return testing::explored::now(); }
[[nodiscard]] inline Duration thread_cpu_now() noexcept { return 0; }

/// The processor time that a watchdog reads for other threads.
inline Duration cpu_of_others = 0;
[[nodiscard]] inline Duration cpu_now(clockid_t) noexcept { return cpu_of_others; }

}  // namespace redag::runtime
