// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Rates and shares from the figures of a frame, of its window or since the executor's start. Pure functions.
#pragma once

#include "redag/live/frame.hpp"

namespace redag::live {

/// Jobs that finished, per second.
[[nodiscard]] double rate_of(const page::Figures &figures, const Frame &frame, bool since_start);
/// Processor time as a share of one processor.
[[nodiscard]] double cpu_of(const page::Figures &figures, const Frame &frame, bool since_start);
[[nodiscard]] double share_of(const ThreadFrame &thread, const Frame &frame, bool since_start);
/// Time of the services of a device as a share of all its slots.
[[nodiscard]] double share_of(const DeviceFrame &device, const Frame &frame, bool since_start);
/// Services that ended, per second.
[[nodiscard]] double rate_of(const DeviceFrame &device, const Frame &frame, bool since_start);

}  // namespace redag::live
