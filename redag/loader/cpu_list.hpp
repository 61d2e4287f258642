// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Lists of processors as text, as the kernel writes them: "0,2-5". Pure functions.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace redag {

inline constexpr int kMaxCpu = 4095;  // above the limit of today's Linux

/// Parses "0,2-5" into {0, 2, 3, 4, 5}: ascending, each once.
[[nodiscard]] std::optional<std::vector<int>> parse_cpu_list(std::string_view text);

/// The shortest text that parse_cpu_list() reads as `cpus`, which must be ascending.
[[nodiscard]] std::string format_cpu_list(const std::vector<int> &cpus);

}  // namespace redag
