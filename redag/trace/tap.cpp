// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/trace/tap.hpp"

void redag_set_tap(const redag::trace::Tap *tap) { redag::trace::detail::tap.store(tap, std::memory_order_release); }
