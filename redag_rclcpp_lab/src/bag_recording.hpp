// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Opens bags of rosbag2 in its SQLite storage (.db3), without rosbag2.
#pragma once

#include <memory>
#include <set>
#include <string>

#include "recording.hpp"

namespace redag_rclcpp::lab {

/// `path`: a .db3 file, or the folder of a bag. `topics`: those to read; empty: all but /clock. Errors say what to do:
/// other storages and compressed bags can be converted.
[[nodiscard]] redag::Result<std::unique_ptr<Recording>> open_bag(const std::string &path,
                                                                 const std::set<std::string> &topics);

}  // namespace redag_rclcpp::lab
