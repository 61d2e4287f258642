// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// How much processor time a thread with a reservation of Linux (SCHED_DEADLINE) can take from others. Pure.
#pragma once

#include "redag_lab/robot/robot.hpp"

namespace redag::robot {

/// A task more urgent than all others that interferes with them at least as much as such a thread.
struct ReservedLoad {
  Duration wcet = 0;
  Duration period = 0;
  Duration jitter = 0;
};

/// Requires 0 < budget <= period and tick >= 0, and that the thread has a processor whenever it may run. With budget Q,
/// period P, U = Q/P and a tick t, it executes in any interval of length L at most
///   U L + (1 - U) Q + (2 - U) t.
/// A task of wcet kQ, period kP and jitter J is taken to execute U (L + J) or more, which is no less for
/// J = P - Q + 2 t / U - t. The least k is chosen with which its job ends by its deadline: J + kQ <= kP. docs/robot.md
/// has the proof.
[[nodiscard]] ReservedLoad load_of(const Reservation &reservation);

}  // namespace redag::robot
