// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Tests that can do more than they do by default: how much, and from which seed, stands in the environment.
#pragma once

#include <cstdint>
#include <cstdlib>

namespace redag_rclcpp {

inline std::uint64_t from_environment(const char *name, std::uint64_t otherwise) {
  const char *value = std::getenv(name);
  return value == nullptr ? otherwise : std::strtoull(value, nullptr, 10);
}

}  // namespace redag_rclcpp
