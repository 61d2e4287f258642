// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Which executors of a workload have a HI mode of their own (docs/model.md, "Criticality"). Pure functions.
#pragma once

#include <cstdint>
#include <set>
#include <string_view>

#include "redag/base/result.hpp"
#include "redag/model/workload.hpp"

namespace redag {

/// The executors (Dag::executor) of which a job can begin HI mode.
[[nodiscard]] std::set<std::uint32_t> executors_with_modes(const Workload &workload);

/// True if one of several executors has a HI mode, of which the others never learn. Of a workload without clusters.
[[nodiscard]] bool has_separate_modes(const Workload &workload);

/// For what knows one HI mode only: an error that names it if a cluster of the workload has separate ones.
[[nodiscard]] Result<void> refuse_separate_modes(const Workload &workload, std::string_view who);

}  // namespace redag
