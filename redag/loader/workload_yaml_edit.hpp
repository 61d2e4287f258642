// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Changes a workload file in place: comments, layout and the writing of all other values stay. Finds lines in it. Pure.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

#include "redag/loader/workload_yaml.hpp"

namespace redag {

/// Returns `text`, a workload file, changed to state `wanted`: byte for byte the same if it already does. In place are
/// changed the number of workers, and fields that stand alone (fields.hpp). For another difference, and for text that
/// is no workload, returns to_yaml(wanted). Requires that `wanted` is valid.
[[nodiscard]] std::string edit_yaml(std::string_view text, const Workload &wanted, LoadOptions options = {});

/// Returns the line, from 1, on which `text` states a key of a DAG, or of its task with the number `task` in that DAG.
/// 0 if the text states no such key, or states its DAGs elsewhere, as robot files do.
[[nodiscard]] int line_of(std::string_view text, DagId dag, std::optional<std::size_t> task, std::string_view key);

}  // namespace redag
