// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Draws a run: angles over time as SVG, and frames of the scene as PNG where MuJoCo can draw without a screen.
#pragma once

#include <string>
#include <vector>

#include "experiment.hpp"

namespace closed_loop {

struct Recorded {
  std::string executor;
  std::vector<PlantResult> plants;  // with snapshots
};

/// Draws a panel for each plant with a line for each executor.
[[nodiscard]] std::string trajectories_svg(const std::vector<Recorded> &runs, const std::string &title,
                                           const std::string &subtitle);

/// True if the program was built with a renderer.
[[nodiscard]] bool can_render();

/// Draws a row for each run and a column for each time, with the scene at that time. Throws std::runtime_error on
/// failure, and where there is no renderer.
void write_frames(const std::string &path, const std::vector<Recorded> &runs, const std::vector<Time> &times);

/// Writes "0000.png" and so on into a folder: for each time the scenes of all runs, side by side. Throws as above.
void write_movie(const std::string &folder, const std::vector<Recorded> &runs, const std::vector<Time> &times);

}  // namespace closed_loop
