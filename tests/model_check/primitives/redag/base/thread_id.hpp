// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Replaces redag/base/thread_id.hpp: the explorer's threads are fibers of one thread of the kernel.
#pragma once

#include "tests/testing/explorer.hpp"

namespace redag {

[[nodiscard]] inline std::uint32_t this_thread_id() noexcept {
  return testing::explored::active() ? testing::explored::self() + 1 : 1;
}

}  // namespace redag
