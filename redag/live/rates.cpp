// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/live/rates.hpp"

namespace redag::live {
namespace {

double per_second(double amount, const Frame &frame) {
  return frame.window > 0 ? amount * 1e9 / static_cast<double>(frame.window) : 0;
}

}  // namespace

double rate_of(const page::Figures &figures, const Frame &frame) {
  return per_second(static_cast<double>(figures.recent_jobs), frame);
}

double cpu_of(const page::Figures &figures, const Frame &frame) {
  return per_second(static_cast<double>(figures.recent_cpu) / 1e9, frame);
}

double share_of(const ThreadFrame &thread, const Frame &frame) {
  return per_second(static_cast<double>(thread.recent_used) / 1e9, frame);
}

double share_of(const DeviceFrame &device, const Frame &frame) {
  return per_second(static_cast<double>(device.recent_busy) / 1e9 / device.slots, frame);
}

double rate_of(const DeviceFrame &device, const Frame &frame) {
  return per_second(static_cast<double>(device.recent_served), frame);
}

}  // namespace redag::live
