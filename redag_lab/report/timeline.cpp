// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/report/timeline.hpp"

#include <algorithm>

#include "redag/base/check.hpp"
#include "redag_analysis/metrics/miss.hpp"

namespace redag::report {

TimelineBuilder::TimelineBuilder(const trace::RunInfo &run, std::size_t most_bins)
    : run_(run), length_(std::max<Duration>(1, run.end - run.start)), refs_(flatten(run.workload)) {
  REDAG_CHECK(most_bins > 0, "a timeline of nothing");
  timeline_.begin = run.start;
  const auto most = static_cast<Duration>(most_bins);
  timeline_.bin = (length_ + most - 1) / most;
  if (timeline_.bin > kMicrosecond) timeline_.bin = (timeline_.bin + kMicrosecond - 1) / kMicrosecond * kMicrosecond;
  timeline_.bins = static_cast<std::size_t>((length_ + timeline_.bin - 1) / timeline_.bin);

  const std::size_t dags = run.workload.dags.size();
  timeline_.busy.assign(dags, std::vector<Duration>(timeline_.bins, 0));
  timeline_.device_busy.assign(run.workload.platform.devices.size(), std::vector<Duration>(timeline_.bins, 0));
  timeline_.released.assign(dags, std::vector<std::uint64_t>(timeline_.bins, 0));
  timeline_.missed = timeline_.released;
}

void TimelineBuilder::add(const Slice &slice) {
  fill(timeline_.busy[refs_[slice.task.value].dag.value], slice.begin, slice.end);
}

void TimelineBuilder::add(const Service &service) {
  fill(timeline_.device_busy[service.device.value], service.begin, service.end);
}

void TimelineBuilder::add(const metrics::JobRecord &job) {
  const std::size_t dag = refs_[job.task.value].dag.value;
  const std::size_t bin = bin_at(job.release);
  ++timeline_.released[dag][bin];
  if (metrics::miss_of(job, run_.end) != metrics::Miss::None) ++timeline_.missed[dag][bin];
}

std::size_t TimelineBuilder::bin_at(Time time) const {
  const Duration since = std::clamp<Duration>(time - timeline_.begin, 0, length_ - 1);
  return static_cast<std::size_t>(since / timeline_.bin);
}

void TimelineBuilder::fill(std::vector<Duration> &busy, Time begin, Time end) const {
  // A job in progress at the end may have run longer, outside the timeline.
  end = std::min(end, run_.end);
  Time from = std::max(begin, timeline_.begin);
  while (from < end) {
    const std::size_t bin = bin_at(from);
    const Time until = std::min(end, timeline_.begin + static_cast<Duration>(bin + 1) * timeline_.bin);
    busy[bin] += until - from;
    from = until;
  }
}

}  // namespace redag::report
