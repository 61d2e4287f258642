// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Changes a workload file in place: comments, layout and the writing of all other values stay. Pure.
#pragma once

#include <string>
#include <string_view>

#include "redag/loader/workload_yaml.hpp"

namespace redag {

/// Returns `text`, a workload file, changed to state `wanted`: byte for byte the same if it already does. In place are
/// changed: workers and preemption of the platform, policy, ties, and max_active, clusters and priorities. For another
/// difference, and for text that is no workload, returns to_yaml(wanted). Requires that `wanted` is valid.
[[nodiscard]] std::string edit_yaml(std::string_view text, const Workload &wanted, LoadOptions options = {});

}  // namespace redag
