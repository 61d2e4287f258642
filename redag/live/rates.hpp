// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Rates and shares from the figures of a frame over its window. Pure functions.
#pragma once

#include "redag/live/frame.hpp"

namespace redag::live {

/// Jobs that finished, per second.
[[nodiscard]] double rate_of(const page::Figures &figures, const Frame &frame);
/// Processor time as a share of one processor.
[[nodiscard]] double cpu_of(const page::Figures &figures, const Frame &frame);
[[nodiscard]] double share_of(const ThreadFrame &thread, const Frame &frame);
/// Time of the services of a device as a share of all its slots.
[[nodiscard]] double share_of(const DeviceFrame &device, const Frame &frame);
/// Services that ended, per second.
[[nodiscard]] double rate_of(const DeviceFrame &device, const Frame &frame);

}  // namespace redag::live
