// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The half of `compare` that compares two recorded results instead of running anything.
#pragma once

#include <string>

#include "redag_lab/cli/terminal/console.hpp"
#include "redag_lab/run/difference.hpp"

namespace redag::cli {

struct CompareRecordedOptions {
  std::string a;  // folders of results
  std::string b;
  double tolerance = 0.05;  // share by which response percentiles may differ
  bool different = false;   // of different workloads too
  bool check = false;
  bool all_tasks = false;
};

/// Compares the results and returns the exit status: 1 with `check` if a figure of B is significantly worse.
int compare_recorded(const CompareRecordedOptions &options, Console &console);

}  // namespace redag::cli
