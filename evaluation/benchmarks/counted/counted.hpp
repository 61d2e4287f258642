// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The main function of programs whose instructions tools/count_instructions counts:
//
//   PROGRAM --list         prints what the counts depend on besides the sources, then the names of the cases
//   PROGRAM CASE LEAST     runs at least LEAST operations, and prints how many; exit code 3: it cannot run here
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace redag::benchmarks {

struct Case {
  std::string name;
  /// Runs at least `least` operations. Returns how many; 0: the case cannot run here, as it has said on stderr.
  std::function<std::uint64_t(std::uint64_t least)> run;
};

/// `environment`: what the counts depend on besides compiler, flags and C library; can be empty.
[[nodiscard]] int run_counted(int argc, char **argv, const std::vector<Case> &cases, std::string_view environment = {});

}  // namespace redag::benchmarks
