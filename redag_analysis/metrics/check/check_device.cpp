// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/check/check_device.hpp"

#include <algorithm>

#include "redag/derived/waits.hpp"

namespace redag::metrics {

using State = LiveJob::State;

void DeviceRules::before(const JobEvent &event) {
  const LiveJob *job = context_.replay.find(event.task, event.job);
  if (job == nullptr) return;  // the replay reports it
  switch (event.kind) {
    case JobEventKind::Waits: waits(event, *job); break;
    case JobEventKind::Served: served(event, *job); break;
    case JobEventKind::Woken: woken(event, *job); break;
    case JobEventKind::Finished:
    case JobEventKind::Aborted: ended(event, *job); break;
    default: break;
  }
}

DeviceRules::DeviceState *DeviceRules::device_of(std::int64_t index) {
  return index >= 0 && index < static_cast<std::int64_t>(devices_.size()) ? &devices_[static_cast<std::size_t>(index)]
                                                                          : nullptr;
}

void DeviceRules::waits(const JobEvent &event, const LiveJob &job) {
  changed_ = true;
  const Waiting waiting{{event.task, event.job}, event.time, job.waits};
  DeviceState *device = device_of(event.value);
  context_.expect(Rule::Device, device != nullptr || event.value == -1, event.task, event.job,
                  [] { return std::string("it waits for a device that the platform does not have"); });
  (device == nullptr ? away_ : device->queue).push_back(waiting);
  if (!is_simulated()) return;
  const Task &task = context_.replay.task(event.task);
  const bool has_wait = job.waits < task.waits.size();
  context_.expect(Rule::Device, has_wait, event.task, event.job,
                  [&] { return "it waits more than " + std::to_string(task.waits.size()) + " times"; });
  if (!has_wait) return;
  const DeviceId expected = task.waits[job.waits].device;
  context_.expect(Rule::Device, event.value == (expected.valid() ? std::int64_t{expected.value} : -1), event.task,
                  event.job, [] { return std::string("it waits for another device than its task does"); });
  if (!context_.info.overheads.empty()) return;
  const Duration point = wait_point(task, job.waits, context_.demand_of(event.task, event.job));
  const Duration executed = job.executed + (event.time - job.on_worker_since);
  context_.expect(Rule::Device, executed == point, event.task, event.job, [&] {
    return "it waits after " + format_duration(executed) + " of execution; expected " + format_duration(point);
  });
}

void DeviceRules::served(const JobEvent &event, const LiveJob &job) {
  changed_ = true;
  DeviceState *device = device_of(event.value);
  if (device == nullptr || job.device != event.value) return;  // the replay reports it
  const Replay::JobRef ref{event.task, event.job};
  const auto chosen = std::find_if(device->queue.begin(), device->queue.end(),
                                   [&](const Waiting &waiting) { return waiting.job == ref; });
  if (chosen == device->queue.end()) return;
  const Device &rules = device_at(event.value);
  context_.expect(Rule::Device, device->used < rules.slots, event.task, event.job,
                  [&] { return "device " + rules.name + " serves " + std::to_string(device->used) + " jobs already"; });
  if (rules.queue == Device::Queue::Fifo) {
    context_.expect(Rule::Device, chosen == device->queue.begin(), event.task, event.job, [&] {
      return context_.job_name(device->queue.front().job.task, device->queue.front().job.number) +
             " had asked device " + rules.name + " before it";
    });
  }
  for (const Waiting &other : device->queue) {
    if (rules.queue == Device::Queue::Fifo) break;
    // What a job inherited may be more than the scheduler has seen, never less.
    const LiveJob *waiting = context_.replay.find(other.job.task, other.job.number);
    const bool goes_first = waiting != nullptr && waiting->own < job.raised;
    context_.expect(Rule::Device, !goes_first, other.job.task, other.job.number, [&] {
      return "it waits for device " + rules.name + " and is more urgent, but " +
             context_.job_name(event.task, event.job) + " is served";
    });
  }
  away_.push_back(*chosen);
  away_.back().since = event.time;
  device->queue.erase(chosen);
  ++device->used;
}

void DeviceRules::woken(const JobEvent &event, const LiveJob &job) {
  changed_ = true;
  const Replay::JobRef ref{event.task, event.job};
  const auto found =
      std::find_if(away_.begin(), away_.end(), [&](const Waiting &waiting) { return waiting.job == ref; });
  if (found == away_.end()) return;  // the replay reports it
  if (DeviceState *device = device_of(job.device)) --device->used;
  const Waiting waiting = *found;
  away_.erase(found);
  const Task &task = context_.replay.task(event.task);
  if (!is_simulated() || waiting.wait >= task.waits.size()) return;
  const Duration length = context_.wait_of(event.task, event.job, waiting.wait);
  context_.expect(Rule::Device, event.time - waiting.since == length, event.task, event.job, [&] {
    return "its wait took " + format_duration(event.time - waiting.since) + "; expected " + format_duration(length);
  });
}

void DeviceRules::ended(const JobEvent &event, const LiveJob &job) {
  const Replay::JobRef ref{event.task, event.job};
  if (job.is_waiting()) {
    changed_ = true;
    const auto is_it = [&](const Waiting &waiting) { return waiting.job == ref; };
    DeviceState *device = device_of(job.device);
    if (device != nullptr && job.state == State::AtDevice) std::erase_if(device->queue, is_it);
    if (job.state == State::Away && std::erase_if(away_, is_it) > 0 && device != nullptr) --device->used;
  }
  if (!is_simulated() || event.kind != JobEventKind::Finished) return;
  const Task &task = context_.replay.task(event.task);
  context_.expect(Rule::Device, job.waits == task.waits.size(), event.task, event.job, [&] {
    return "it ended after " + std::to_string(job.waits) + " of " + std::to_string(task.waits.size()) + " waits";
  });
}

void DeviceRules::end_of_instant() {
  if (!changed_) return;
  changed_ = false;
  for (std::size_t d = 0; d < devices_.size(); ++d) {
    const DeviceState &state = devices_[d];
    const Device &device = device_at(static_cast<std::int64_t>(d));
    const Replay::JobRef first = state.queue.empty() ? Replay::JobRef{} : state.queue.front().job;
    const bool is_used = state.used >= device.slots || device.others > 0;  // perhaps by another cluster
    context_.expect(Rule::Device, state.queue.empty() || is_used, first.task, first.number,
                    [&] { return "it waits for device " + device.name + ", which has a free slot"; });
  }
}

// The wait of a simulated job that still waits when the run ends must not be over.
void DeviceRules::end_of_trace() {
  if (!is_simulated()) return;
  for (const Waiting &waiting : away_) {
    const Task &task = context_.replay.task(waiting.job.task);
    if (waiting.wait >= task.waits.size()) continue;
    const Duration length = context_.wait_of(waiting.job.task, waiting.job.number, waiting.wait);
    context_.expect(Rule::Device, context_.info.end - waiting.since < length, waiting.job.task, waiting.job.number,
                    [&] { return "it was never woken, although its wait takes only " + format_duration(length); });
  }
}

}  // namespace redag::metrics
