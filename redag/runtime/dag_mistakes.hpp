// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Words the mistakes of a DAG that was built in C++ in the terms of DagBuilder: which call, which argument or option.
// The rules themselves are those of model/validate.hpp. Pure functions.
#pragma once

#include <string>
#include <string_view>

#include "redag/model/workload.hpp"

namespace redag::runtime {

/// The place of a mistake: `DagBuilder("control")` or `DagBuilder("control").timer("imu")`.
[[nodiscard]] std::string place_of(std::string_view dag);
[[nodiscard]] std::string place_of(std::string_view dag, std::string_view call, std::string_view task);

/// Returns each mistake in `dag` on a line of its own; empty if there is none. A wcet may be unknown (0).
[[nodiscard]] std::string mistakes_of(const Dag &dag, PolicyKind policy);

}  // namespace redag::runtime
