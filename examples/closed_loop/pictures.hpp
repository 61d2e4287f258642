// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What a run looked like: angles over time as SVG, and frames of the scene as PNG where MuJoCo can draw without a
// screen.
#pragma once

#include <string>
#include <vector>

#include "experiment.hpp"

namespace closed_loop {

struct Recorded {
  std::string executor;
  std::vector<PlantResult> plants;  // with snapshots
};

/// A panel for each plant, a line for each executor.
[[nodiscard]] std::string trajectories_svg(const std::vector<Recorded> &runs, const std::string &title,
                                           const std::string &subtitle);

/// Was it built with a renderer?
[[nodiscard]] bool can_render();

/// A row for each run, a column for each time: the scene as it was then. Throws std::runtime_error, also where there is
/// no renderer.
void write_frames(const std::string &path, const std::vector<Recorded> &runs, const std::vector<Time> &times);

}  // namespace closed_loop
