// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/live_sample.hpp"

namespace redag::runtime {

void fill(live::TaskSample &sample, const TaskFigures &figures) {
  const sched::Accounting &jobs = figures.jobs;
  sample.released = jobs.released;
  sample.finished = jobs.finished;
  sample.skipped = jobs.skipped;
  sample.aborted = jobs.aborted;
  sample.misses = jobs.misses(figures.late);
  sample.deferred = jobs.deferred;
  sample.preemptions = figures.preemptions;
  sample.cpu = figures.usage.total;
  sample.priority = figures.priority;
  sample.active = figures.active;
  sample.away = figures.away;
  sample.ready = figures.ready;
  const std::uint64_t started_or_ready = std::uint64_t{figures.active} + figures.ready;
  const std::uint64_t in_flight = jobs.in_flight();
  sample.waiting = static_cast<std::uint32_t>(in_flight > started_or_ready ? in_flight - started_or_ready : 0);
  sample.response = figures.response;
  sample.end_to_end = figures.end_to_end;
  sample.late_end_to_end = figures.late_end_to_end;
}

void add_threads(live::Sample &sample, const Engine &engine, std::span<const TaskId> ids) {
  std::vector<ThreadFigures> threads;
  engine.figures(threads);
  for (const ThreadFigures &thread : threads) {
    live::ThreadSample &added = sample.threads.emplace_back();
    added.used = thread.used;
    if (thread.task.valid()) added.task = ids.empty() ? thread.task.value : ids[thread.task.value].value;
  }
}

void add_devices(live::Sample &sample, const Engine &engine) {
  std::vector<DeviceFigures> devices;
  engine.figures(devices);
  for (const DeviceFigures &device : devices) {
    live::DeviceSample &added = sample.devices.emplace_back();
    added.name = device.device.name;
    added.slots = device.device.slots;
    added.queued = device.queued;
    added.served = device.served;
    added.busy = device.busy;
    for (const TaskId task : device.serves) added.serves.push_back(task.value);
  }
}

std::string alert_of(const Engine &engine) {
  const std::vector<Problem> problems = engine.problems();
  return problems.empty() || !problems.front().breaks_order ? "" : problems.front().text;
}

live::PublisherOptions live_options(const std::string &name, const std::string &driver, const Mode &mode,
                                    const sched::Config &config) {
  live::PublisherOptions options;
  options.name = name;
  options.driver = driver;
  options.preemption = to_string(mode.mode);
  options.policy = to_string(config.policy);
  options.workers = config.workers;
  return options;
}

}  // namespace redag::runtime
