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
/// J = P - Q + 2 t / U - t. The least k is chosen with which its job ends by its deadline: J + kQ <= kP.
///
/// Proof. Let E be what the thread has executed since the beginning a of the interval, q what is left of its budget
/// (negative after an overrun), and d its deadline. The kernel keeps E + q <= U (d - a). At first E is 0, and
/// q <= U (d - a) for a thread that executes, since a thread that wakes with more gets a new deadline. Executing leaves
/// the left side as it is. When a budget is used up, d grows by P once or more, and q by Q each time, until q is
/// positive. A thread that wakes with q > U (d - now) or d < now gets q = Q and d = now + P, and E <= U (now - a)
/// followed before. Let r be the last change of d in the interval. It made d at most r + jP, and q = jQ - o, for an
/// overrun o <= t and the least j with jQ > o. So until r, E <= U (r - a) + o. From r on, the thread executes
/// x <= q + t <= Q + t, and L >= r - a + x. Together E <= U (L - x) + t + x, which grows with x:
/// E <= UL + (1 - U) (Q + t) + t. If d does not change, E <= Q + t and E <= L, which gives less.
[[nodiscard]] ReservedLoad load_of(const Reservation &reservation);

}  // namespace redag::robot
