// Response times of DAGs whose tasks share exclusive groups, run to completion on m workers. Within a group jobs run
// one after the other, so what a DAG's critical path waits for its groups counts in full, not divided by m. Pure
// functions.
#pragma once

#include "redag/analysis/bound.hpp"

namespace redag::analysis {

/// R = len + floor((vol - len + sum W_j(R) + Delta^m + p Delta^(m-1)) / m) + waits for groups. Proof: docs/analysis.md,
/// "Exclusive groups". Not for preemption: there a holder can wait at an inherited priority, and who waits for whom is
/// no longer decided by the groups of the critical path alone.
[[nodiscard]] Method dag_groups();

}  // namespace redag::analysis
