// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/response_split.hpp"

#include <algorithm>
#include <numeric>

namespace redag::metrics {

const char *to_string(Stay stay) {
  switch (stay) {
    case Stay::NotReady: return "not_ready";
    case Stay::Ready: return "ready";
    case Stay::OnWorker: return "on_worker";
    case Stay::Preempted: return "preempted";
    case Stay::DeviceQueue: return "device_queue";
    case Stay::Device: return "device";
    case Stay::Waits: return "waits";
  }
  return "?";
}

Duration ResponseSplit::sum() const { return std::accumulate(length.begin(), length.end(), Duration{0}); }

void ResponseSplit::add(const ResponseSplit &other) {
  for (std::size_t i = 0; i < kStays; ++i) length[i] += other.length[i];
}

void StayClock::move(Stay stay, Time now) {
  if (now > since_) {
    split_[stay_] += now - since_;
    since_ = now;
  }
  stay_ = stay;
}

void StayClock::end(Time now) {
  move(stay_, now);
  // What was counted beyond the end, of time on a worker first.
  Duration beyond = since_ - now;
  for (const Stay stay :
       {Stay::OnWorker, Stay::Preempted, Stay::Ready, Stay::Waits, Stay::Device, Stay::DeviceQueue, Stay::NotReady}) {
    const Duration less = std::min(beyond, split_[stay]);
    split_[stay] -= less;
    beyond -= less;
  }
}

void ResponseSplits::add(const ResponseSplit &split) {
  if (jobs == 0 || split.sum() > longest.sum()) longest = split;
  total.add(split);
  ++jobs;
}

void ResponseSplits::add(const ResponseSplits &other) {
  if (other.jobs == 0) return;
  if (jobs == 0 || other.longest.sum() > longest.sum()) longest = other.longest;
  total.add(other.total);
  jobs += other.jobs;
}

}  // namespace redag::metrics
