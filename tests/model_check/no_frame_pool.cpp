// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Frames without a pool, which outlives an execution and would take the explorer's locks with it into the next one.
#include <new>

#include "redag/engine/frame_pool.hpp"

namespace redag::runtime {

void *take_storage(std::size_t size) { return ::operator new(size); }
void give_back_storage(void *storage, std::size_t /*size*/) noexcept { ::operator delete(storage); }

}  // namespace redag::runtime
