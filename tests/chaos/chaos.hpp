// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// One run of each kind of chaos, from a seed. Returns what broke, or nothing; `survived` counts faults by kind.
#pragma once

#include <cstdint>
#include <map>
#include <string>

namespace redag::chaos {

using Survived = std::map<std::string, std::uint64_t>;

/// A random workload in virtual time: jobs that run for up to 100 times their wcet, releases near the ends of time,
/// runs that are broken off, every executor.
std::string simulator_run(std::uint64_t seed, Survived &survived);

/// An executor with bodies that throw, sleep, block, lock, overrun, call the executor, add DAGs and remove their own,
/// while DAGs come and go, processors do, and it is stopped from anywhere.
std::string executor_run(std::uint64_t seed, Survived &survived);

}  // namespace redag::chaos
