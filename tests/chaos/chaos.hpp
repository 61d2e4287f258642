// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// One run of each kind of chaos, from a seed. Returns a description of what broke, or "". `survived` counts faults by
// kind.
#pragma once

#include <cstdint>
#include <map>
#include <string>

namespace redag::chaos {

using Survived = std::map<std::string, std::uint64_t>;

/// Simulates a random workload: jobs run for up to 100 times their wcet, releases lie near the ends of time, and runs
/// are broken off. Uses every executor.
std::string simulator_run(std::uint64_t seed, Survived &survived);

/// Runs an executor on threads. Bodies throw, sleep, block, lock, overrun, call the executor, add DAGs and remove their
/// own. Meanwhile DAGs and processors come and go, and any thread may stop the executor.
std::string executor_run(std::uint64_t seed, Survived &survived);

}  // namespace redag::chaos
