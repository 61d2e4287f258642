// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The rules for the edges of a DAG: predecessors that exist, no cycles, periods as inherited. Part of validate.cpp.
#pragma once

#include <cstdint>

#include "redag/loader/finding_list.hpp"

namespace redag {

/// Checks the predecessors of a task, at the place that is set. True if they exist, differ from each other and from the
/// task, and a data task has one.
bool check_edges(const Dag &dag, std::uint32_t task, FindingList &findings);

/// Checks the DAG as a whole: cycles and, if all edges are sound, inherited periods.
void check_graph(const Dag &dag, DagId id, bool sound_edges, FindingList &findings);

}  // namespace redag
