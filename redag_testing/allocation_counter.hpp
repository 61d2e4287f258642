// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Counts heap allocations of the calling thread. Linking this file replaces the global operator new.
#pragma once

#include <cstdint>

namespace redag::testing {

/// The number of allocations by this thread up to now.
[[nodiscard]] std::uint64_t allocation_count();

}  // namespace redag::testing
