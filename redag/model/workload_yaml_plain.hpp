// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Parses the plain part of YAML in which workload files are mostly written, in one pass. It knows block and flow maps
// and lists, plain and quoted scalars of one line, and comments. It has no messages: all other text, whether it is YAML
// or not, is for yaml-cpp (workload_yaml_tree.hpp). A pure function.
#pragma once

#include <optional>
#include <string_view>

#include "redag/model/workload_yaml_tree.hpp"

namespace redag::yaml {

/// Returns the tree that parse() returns for this text, or nothing if the text leaves the plain part of YAML.
[[nodiscard]] std::optional<Node> parse_plain(std::string_view text);

}  // namespace redag::yaml
