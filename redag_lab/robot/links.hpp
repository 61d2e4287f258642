// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Bounds when the data of other processes arrive. A job of a link's `to` is released by the end of a job of `from`, so
// that the bound on `from`, and `transport`, are the release jitter of `to`, on which further bounds depend: a fixed
// point (K. Tindell, J. Clark, "Holistic schedulability analysis for distributed hard real-time systems", 1994). Pure.
#pragma once

#include <vector>

#include "redag/base/result.hpp"
#include "redag_analysis/core/task_set.hpp"
#include "redag_lab/robot/robot.hpp"

namespace redag::robot {

// Proof. Suppose that some bound or some jitter does not hold, and take the first instant at which one fails. All
// releases before it are within their jitter, and what was released by then decides the schedule up to it. A schedule
// in which all later releases are within their jitter, too, is the same up to that instant. So no bound fails in it,
// and data come late only after a bound failed.

/// Sets the jitter of every `to` in `united`, the union of the robot on this platform; `first_task` is the TaskId there
/// of each process's first task. Errors, each at its link: nothing bounds `from`; data can arrive a period late or
/// more.
[[nodiscard]] Result<void> set_jitter_of_links(const Robot &robot, const std::vector<std::size_t> &first_task,
                                               const analysis::AnalysisPlatform &platform, Workload &united);

}  // namespace redag::robot
