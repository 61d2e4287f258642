// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

/* The interface of libredag_pi.so, which makes the mutexes of a process inherit priority (PTHREAD_PRIO_INHERIT).
 *
 * The library stands before libc when symbols are looked up: preload it (LD_PRELOAD) or link the program against it.
 * The environment REDAG_PI=0 turns it off. docs/ros2.md, "Locks of the middleware", states the limits. */
#ifndef REDAG_RCLCPP_INHERIT_H
#define REDAG_RCLCPP_INHERIT_H

#ifdef __cplusplus
extern "C" {
#endif

/* 1 if a mutex that is used for the first time from now on inherits priority, otherwise 0: it was turned off, or the
 * kernel has no priority-inheriting futexes. Any thread. */
int redag_pi_enabled(void);

/* Turns it off for mutexes that have not been used yet. While the process has one thread only. */
void redag_pi_disable(void);

#ifdef __cplusplus
}
#endif

#endif
