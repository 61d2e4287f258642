// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What is wrong with a DAG that was built in C++, in the words of DagBuilder: which call, which argument or option. The
// rules themselves are those of model/validate.hpp. Pure functions.
#pragma once

#include <string>
#include <string_view>

#include "redag/model/workload.hpp"

namespace redag::runtime {

/// `DagBuilder("control")`, and `DagBuilder("control").timer("imu")`: where a mistake was made.
[[nodiscard]] std::string place_of(std::string_view dag);
[[nodiscard]] std::string place_of(std::string_view dag, Activation activation, std::string_view task);

/// Every mistake in `dag` on a line of its own; empty if there is none. A wcet may be unknown (0).
[[nodiscard]] std::string mistakes_of(const Dag &dag, PolicyKind policy);

}  // namespace redag::runtime
