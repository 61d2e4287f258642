// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The atomics that threads agree through. An alias, in a header of its own so that tests/model_check can put another
// type in its place and try every interleaving of the code that uses it. What is only counted, or only read by a
// program's own signal handler, is plain std::atomic.
#pragma once

#include <atomic>

namespace redag {

template <class T>
using Atomic = std::atomic<T>;

}  // namespace redag
