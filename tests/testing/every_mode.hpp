// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Tests that run in every mode of preemption.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "redag/threads/setup.hpp"

namespace redag::testing {

/// For INSTANTIATE_TEST_SUITE_P, with mode_name.
inline auto every_mode() {
  return ::testing::Values(PreemptionMode::None, PreemptionMode::Cooperative, PreemptionMode::Os);
}
inline const auto mode_name = [](const auto &test) { return std::string(to_string(test.param)); };

/// Tests of an Executor. Where there are no real-time rights, the mode that `os` becomes there is tested.
class InEveryMode : public ::testing::TestWithParam<PreemptionMode> {
 protected:
  [[nodiscard]] static PreemptionMode mode() {
    return GetParam() == PreemptionMode::Os ? PreemptionMode::Auto : GetParam();
  }
};

}  // namespace redag::testing
