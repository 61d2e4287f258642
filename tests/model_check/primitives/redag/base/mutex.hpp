// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Replaces redag/base/mutex.hpp.
#pragma once

#include "redag/base/pi_mutex.hpp"

namespace redag {

using Mutex = PiMutex;

}  // namespace redag
