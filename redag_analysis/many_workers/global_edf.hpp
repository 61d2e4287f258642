// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Independent tasks under global EDF on m workers. Pure functions.
#pragma once

#include "redag_analysis/core/bound.hpp"

namespace redag::analysis {

/// Accepts if sum C_i / D_i <= m - (m - 1) max C_i / D_i, under full preemption. J. Goossens, S. Funk, S. Baruah,
/// Real-Time Systems 25, 2003 (D = T); M. Bertogna, M. Cirinei, G. Lipari, ECRTS 2005 (D <= T). With jitter D_i - J_i
/// stands for D_i: docs/analysis.md, "EDF on several workers".
[[nodiscard]] Method edf_global_density();

/// R_k = C_k + floor(sum min(W_i(R_k), E_i, R_k - C_k + 1) / m), where E_i is the work of i's jobs whose deadlines are
/// not after that of k's. M. Bertogna, M. Cirinei, RTSS 2007 (after M. Bertogna, M. Cirinei, G. Lipari, ECRTS 2005).
/// For jobs that run to completion, blocking by jobs of later deadlines is added. Proof: ibid.
[[nodiscard]] Method edf_global_response();

}  // namespace redag::analysis
