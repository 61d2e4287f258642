// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/report/timeline.hpp"

#include <algorithm>

#include "redag/base/check.hpp"
#include "redag_analysis/metrics/miss.hpp"

namespace redag::report {
namespace {

using metrics::JobRecord;

}  // namespace

Timeline timeline_of(const trace::Trace &trace, std::span<const Slice> slices, std::span<const Service> services,
                     std::span<const JobRecord> jobs, std::size_t most_bins) {
  REDAG_CHECK(most_bins > 0, "a timeline of nothing");
  Timeline timeline;
  timeline.begin = trace.info.start;
  const Duration length = std::max<Duration>(1, trace.info.end - trace.info.start);
  const auto most = static_cast<Duration>(most_bins);
  timeline.bin = (length + most - 1) / most;
  if (timeline.bin > kMicrosecond) timeline.bin = (timeline.bin + kMicrosecond - 1) / kMicrosecond * kMicrosecond;
  timeline.bins = static_cast<std::size_t>((length + timeline.bin - 1) / timeline.bin);

  const std::size_t dags = trace.info.workload.dags.size();
  timeline.busy.assign(dags, std::vector<Duration>(timeline.bins, 0));
  timeline.device_busy.assign(trace.info.workload.platform.devices.size(), std::vector<Duration>(timeline.bins, 0));
  timeline.released.assign(dags, std::vector<std::uint64_t>(timeline.bins, 0));
  timeline.missed = timeline.released;
  const auto bin_at = [&](Time time) {
    const Duration since = std::clamp<Duration>(time - timeline.begin, 0, length - 1);
    return static_cast<std::size_t>(since / timeline.bin);
  };
  const auto fill = [&](std::vector<Duration> &busy, Time begin, Time end) {
    // A job in progress at the end may have run longer, outside the timeline.
    end = std::min(end, trace.info.end);
    Time from = std::max(begin, timeline.begin);
    while (from < end) {
      const std::size_t bin = bin_at(from);
      const Time until = std::min(end, timeline.begin + static_cast<Duration>(bin + 1) * timeline.bin);
      busy[bin] += until - from;
      from = until;
    }
  };
  const std::vector<TaskRef> refs = flatten(trace.info.workload);
  for (const Slice &slice : slices) {
    fill(timeline.busy[refs[slice.task.value].dag.value], slice.begin, slice.end);
  }
  for (const Service &service : services) {
    fill(timeline.device_busy[service.device.value], service.begin, service.end);
  }
  for (const JobRecord &job : jobs) {
    const std::size_t dag = refs[job.task.value].dag.value;
    const std::size_t bin = bin_at(job.release);
    ++timeline.released[dag][bin];
    if (metrics::miss_of(job, trace.info.end) != metrics::Miss::None) ++timeline.missed[dag][bin];
  }
  return timeline;
}

}  // namespace redag::report
