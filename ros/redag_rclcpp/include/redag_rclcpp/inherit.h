// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

/* The interface of libredag_pi.so, which makes the mutexes of a process inherit priority (PTHREAD_PRIO_INHERIT).
 *
 * The library must come before libc in the search for symbols: preload it (LD_PRELOAD), or link the program against
 * it. The environment variable REDAG_PI=0 turns it off. docs/ros2.md, "Locks of the middleware", states the limits. */
#ifndef REDAG_RCLCPP_INHERIT_H
#define REDAG_RCLCPP_INHERIT_H

#ifdef __cplusplus
extern "C" {
#endif

/* Returns 1 if a mutex that is first used from now on inherits priority. Returns 0 if the library was turned off, or if
 * the kernel has no priority-inheriting futexes. Any thread may call it. */
int redag_pi_enabled(void);

/* Turns the library off for mutexes that have not been used yet. Call it while the process has only one thread. */
void redag_pi_disable(void);

#ifdef __cplusplus
}
#endif

#endif
