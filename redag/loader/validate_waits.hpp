// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The rules for devices and for tasks that wait without a worker. Part of validate.cpp.
#pragma once

#include "redag/loader/finding_list.hpp"

namespace redag {

/// Checks the platform's devices, at the place of the workload.
void check_devices(const Workload &workload, FindingList &findings);

/// Checks the waits of a task, at the place that is set. With `allowed` false, any wait is an error.
void check_waits(const Workload &workload, const Task &task, bool allowed, FindingList &findings);

}  // namespace redag
