// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Storage of what a job that waits leaves behind: frames of coroutines. Storage that is given back is kept for the next
// frame of about its size, for the life of the process. Any thread; the locks inherit priority.
#pragma once

#include <cstddef>

namespace redag::runtime {

/// Allocates only if no storage of this size is left over. Sizes are rounded up to a power of two. Those above 1 MiB
/// are allocated each time. Throws std::bad_alloc.
[[nodiscard]] void *take_storage(std::size_t size);
/// `size` as in take_storage().
void give_back_storage(void *storage, std::size_t size) noexcept;

}  // namespace redag::runtime
