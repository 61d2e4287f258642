// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Numbers in the environment by which a developer repeats a failure or tries more cases (REDAG_SEED=7). Pure.
#pragma once

#include <cstdint>
#include <cstdlib>
#include <optional>

namespace redag::testing {

[[nodiscard]] inline std::optional<std::uint64_t> from_environment(const char *name) {
  const char *text = std::getenv(name);
  if (text == nullptr) return std::nullopt;
  return std::strtoull(text, nullptr, 10);
}

}  // namespace redag::testing
