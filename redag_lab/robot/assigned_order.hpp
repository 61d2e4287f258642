// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Audsley's assignment for a robot (policy `audsley`): the bounds of the union decide which level of which process
// comes before which. Each process keeps the order of its own levels, because its executor can follow no other with
// REDAG_LEVELS. The search merges these chains, and Audsley's argument holds for
// such orders: the last level of a chain can move below all others. Links count the sender's deadline, because its
// response depends on the order that is searched. Pure.
#pragma once

#include "redag/base/result.hpp"
#include "redag_lab/robot/robot.hpp"

namespace redag::robot {

struct OrderSearch {
  AssignedOrder order;
  Diagnostics warnings;  // where no order keeps all deadlines: which unit has no place, at its process
};

/// Searches an order of `robot`, each CPU set for itself. Errors: what union_of() refuses; no bound of the union is a
/// test that Audsley's assignment can use; an entry of threads has a rate where no task runs.
[[nodiscard]] Result<OrderSearch> search_order(const Robot &robot);

}  // namespace redag::robot
