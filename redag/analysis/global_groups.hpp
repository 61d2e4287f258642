// Response times of DAGs whose tasks share exclusive groups, on m workers. Within a group jobs run one after the other,
// so what a DAG's critical path waits for its groups counts in full, not divided by m. Pure functions.
#pragma once

#include "redag/analysis/bound.hpp"

namespace redag::analysis {

/// R = len + floor((vol - len + sum W_j(R) + B) / m) + waits for groups. Run to completion, B = Delta^m + p
/// Delta^(m-1); with full preemption, less urgent jobs at inherited priorities: one holder for each own or more urgent
/// job of a group. Proof: docs/analysis.md, "Exclusive groups".
[[nodiscard]] Method dag_groups();

}  // namespace redag::analysis
