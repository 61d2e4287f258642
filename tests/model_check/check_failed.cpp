// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Replaces redag/base/check.cpp: a broken invariant ends the exploration and reports the run that breaks it.
#include "redag/base/check.hpp"

#include <string>

#include "tests/testing/explorer.hpp"

namespace redag::detail {

void check_failed(const char *condition, const char *message, const char *file, int line) noexcept {
  testing::explored::fail(std::string(message) + " [" + condition + "] " + file + ":" + std::to_string(line));
}

}  // namespace redag::detail
