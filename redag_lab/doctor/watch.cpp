// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/doctor/watch.hpp"

#include <algorithm>
#include <cstddef>

#include "redag/threads/clock.hpp"
#include "redag/threads/parker.hpp"

namespace redag::doctor {
namespace {

constexpr std::size_t kMostGaps = std::size_t{1} << 17U;

// Appends to `gaps`, within its capacity, the gaps until that time. They begin after `watched`, to which it adds.
void watch_until(Time until, Duration &watched, std::vector<Gap> &gaps) {
  Duration cpu = runtime::thread_cpu_now();
  Time read_at = runtime::monotonic_now();
  const Time begun = read_at;
  Time last = read_at;
  for (Time now = runtime::monotonic_now(); now < until && gaps.size() < kMostGaps;
       last = now, now = runtime::monotonic_now()) {
    const Duration length = now - last;
    if (length < kShortestGap) continue;
    const Duration used = runtime::thread_cpu_now();
    const Duration uncharged = (now - read_at) - (used - cpu);
    gaps.push_back({watched + now - begun, length, std::clamp<Duration>(length - uncharged, 0, length)});
    cpu = used;
    read_at = now = runtime::monotonic_now();
  }
  watched += last - begun;
}

}  // namespace

Loss WatchedProcessor::loss(Duration Gap::*part) const {
  std::vector<LossSample> lost;
  for (const Gap &gap : gaps) {
    if (gap.*part > 0) lost.push_back({gap.at, gap.*part});
  }
  return fit_loss(lost, watched);
}

void watch_gaps(Duration length, const std::atomic<bool> &stop, WatchedProcessor &processor) {
  constexpr Duration kBurst = 40 * kMillisecond;  // a SCHED_FIFO thread pauses after it, lest the kernel throttle it
  constexpr Duration kPause = 10 * kMillisecond;
  std::vector<Gap> gaps(kMostGaps);  // touches the pages before the measurement
  gaps.clear();
  Duration watched = processor.watched;
  const Time end = runtime::monotonic_now() + length;
  runtime::Event never;
  for (Time now = runtime::monotonic_now(); now < end && !stop.load(); now = runtime::monotonic_now()) {
    watch_until(std::min(now + kBurst, end), watched, gaps);
    // Ordinary threads pause as well, and other threads that want to run do so during the pause.
    never.wait_until(runtime::monotonic_now() + kPause);
  }
  processor.watched = watched;
  processor.gaps.insert(processor.gaps.end(), gaps.begin(), gaps.end());
}

void watch_wake_ups(Duration length, const std::atomic<bool> &stop, Histogram &latencies) {
  runtime::Event never;
  Time due = runtime::monotonic_now();
  for (const Time end = due + length; due < end && !stop.load();) {
    due += kMillisecond;
    never.wait_until(due);
    const Time woke = runtime::monotonic_now();
    latencies.add(woke - due);
    due = std::max(due, woke - kMillisecond);  // does not sleep for instants that have passed meanwhile
  }
}

}  // namespace redag::doctor
