// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/live/rates.hpp"

namespace redag::live {
namespace {

double per_second(double amount, const Frame &frame, bool since_start) {
  const Duration time = since_start ? frame.published - frame.began : frame.window;
  return time > 0 ? amount * 1e9 / static_cast<double>(time) : 0;
}

}  // namespace

double rate_of(const page::Figures &figures, const Frame &frame, bool since_start) {
  return per_second(static_cast<double>(since_start ? figures.finished : figures.recent_jobs), frame, since_start);
}

double cpu_of(const page::Figures &figures, const Frame &frame, bool since_start) {
  return per_second(static_cast<double>(since_start ? figures.cpu : figures.recent_cpu) / 1e9, frame, since_start);
}

double share_of(const ThreadFrame &thread, const Frame &frame, bool since_start) {
  return per_second(static_cast<double>(since_start ? thread.used : thread.recent_used) / 1e9, frame, since_start);
}

double share_of(const DeviceFrame &device, const Frame &frame, bool since_start) {
  return per_second(static_cast<double>(since_start ? device.busy : device.recent_busy) / 1e9 / device.slots, frame,
                    since_start);
}

double rate_of(const DeviceFrame &device, const Frame &frame, bool since_start) {
  return per_second(static_cast<double>(since_start ? device.served : device.recent_served), frame, since_start);
}

}  // namespace redag::live
