// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The type of the atomics by which threads coordinate. It has a header of its own so that tests/model_check can replace
// the type and try every interleaving of the code that uses it. Plain counters, and values that only a program's own
// signal handler reads, are std::atomic instead.
#pragma once

#include <atomic>

namespace redag {

template <class T>
using Atomic = std::atomic<T>;

}  // namespace redag
