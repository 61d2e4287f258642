// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Opens bags with rosbag2's own reader. Hence every storage and compression works whose plugin is installed.
#pragma once

#include <memory>
#include <set>
#include <string>

#include "recording.hpp"

namespace redag_rclcpp::lab {

/// `path`: the folder of a bag, or one of its files. `topics`: those to read; empty: all but /clock. Messages come one
/// at a time, hence the memory does not depend on the length of the bag. A message that rosbag2 returns after later
/// ones (files of a split bag can overlap by the recorder's cache) gets their time, so that time never goes back.
[[nodiscard]] redag::Result<std::unique_ptr<Recording>> open_bag(const std::string &path,
                                                                 const std::set<std::string> &topics);

}  // namespace redag_rclcpp::lab
