// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// All that is ordered on a robot as one workload: all processes share the processors of their CPU set, so that m is the
// number of these. Analysis and simulation then see the whole robot. Refuses robots whose kernel would schedule them
// differently from that workload. Pure.
#pragma once

#include "redag/base/result.hpp"
#include "redag/loader/workload_yaml.hpp"
#include "redag_lab/robot/robot.hpp"

namespace redag::robot {

// Why its bounds hold. Take any instant, and a job that is ready and not delayed by a group or a bound of its process.
// If its executor has not started it, the executor has at least m started jobs that are no less urgent. If it has, its
// thread is runnable at the priority of its level. In both cases the kernel runs m threads that are no less urgent, or
// the job itself: the bounds for m workers assume no more of a scheduler. A release that is due and not made yet is no
// exception, because its thread is above all tasks of its process. A bound (`max_active`) and a group act within one
// executor, as they do in the union. On one processor, though, the bounds for one worker count a less urgent job with a
// group once. Each of several executors starts jobs that the processor does not run yet. Such a job takes its group, is
// run when a more urgent one waits for the group, and this can happen again for each of these. The bounds for several
// workers count that, and with groups apply to one processor as well. A job that has just started can be preempted
// before its first instruction: each less urgent job may delay by 1 ns more than the bounds count.

/// DAGs and groups have the name of their process before them: "base/control". Threads that can delay tasks are DAGs
/// "threads/NAME". If the order is not the policy's alone, the union's policy is `fixed`. Errors: what analysis cannot
/// cover, each at its entry.
[[nodiscard]] Result<LoadedWorkload> union_of(const Robot &robot, LoadOptions options = {});

}  // namespace redag::robot
