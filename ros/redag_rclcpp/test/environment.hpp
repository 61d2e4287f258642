// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Environment variables set the amount and the seed of tests that can do more than by default.
#pragma once

#include <cstdint>
#include <cstdlib>

namespace redag_rclcpp {

inline std::uint64_t from_environment(const char *name, std::uint64_t otherwise) {
  const char *value = std::getenv(name);
  return value == nullptr ? otherwise : std::strtoull(value, nullptr, 10);
}

}  // namespace redag_rclcpp
