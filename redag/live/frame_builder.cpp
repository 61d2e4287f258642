// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/live/frame_builder.hpp"

#include <algorithm>
#include <numeric>
#include <utility>

#include "redag/base/check.hpp"

namespace redag::live {
namespace {

void set_response(page::Figures &figures, const HistogramCounts &all, const HistogramCounts &recent) {
  figures.response_p50 = all.quantile(0.5);
  figures.response_p99 = all.quantile(0.99);
  figures.response_max = all.longest();
  figures.recent_p50 = recent.quantile(0.5);
  figures.recent_p99 = recent.quantile(0.99);
  figures.recent_max = recent.quantile(1.0);
}

void add(page::Figures &sum, const page::Figures &task) {
  sum.released += task.released;
  sum.finished += task.finished;
  sum.skipped += task.skipped;
  sum.aborted += task.aborted;
  sum.misses += task.misses;
  sum.deferred += task.deferred;
  sum.preemptions += task.preemptions;
  sum.cpu += task.cpu;
  sum.recent_jobs += task.recent_jobs;
  sum.recent_misses += task.recent_misses;
  sum.recent_preemptions += task.recent_preemptions;
  sum.recent_cpu += task.recent_cpu;
  sum.active += task.active;
  sum.ready += task.ready;
  sum.waiting += task.waiting;
  sum.away += task.away;
}

void set_counts(std::uint32_t (&counts)[page::kClasses], const HistogramCounts &histogram) {
  // Half an octave has four buckets of the histogram, in which 1024 ns begins the sixteenth half.
  constexpr std::size_t kHalf = std::size_t{1} << (HistogramCounts::kBits - 1);
  constexpr std::size_t kFirst = 16 * kHalf;
  const auto clamped = [](std::uint64_t count) {
    return static_cast<std::uint32_t>(std::min<std::uint64_t>(count, ~std::uint32_t{0}));
  };
  for (std::size_t i = 0; i < page::kClasses; ++i) {
    const std::size_t first = i == 0 ? 0 : kFirst + i * kHalf;
    const std::size_t last = i + 1 == page::kClasses ? HistogramCounts::kBuckets : kFirst + (i + 1) * kHalf;
    counts[i] = clamped(histogram.count_in(first, last));
  }
}

/// Adds the answers of a sink to its DAG's row. Those of several sinks are not mixed.
void add_answers(DagFrame &dag, const HistogramCounts &all, const HistogramCounts &recent) {
  page::Figures of_sink{};
  set_response(of_sink, all, recent);
  page::Figures &worst = dag.figures;
  if (of_sink.response_p99 > worst.response_p99) set_counts(dag.spread.all, all);
  worst.response_p50 = std::max(worst.response_p50, of_sink.response_p50);
  worst.response_p99 = std::max(worst.response_p99, of_sink.response_p99);
  worst.response_max = std::max(worst.response_max, of_sink.response_max);
  worst.recent_p50 = std::max(worst.recent_p50, of_sink.recent_p50);
  worst.recent_p99 = std::max(worst.recent_p99, of_sink.recent_p99);
  worst.recent_max = std::max(worst.recent_max, of_sink.recent_max);
}

}  // namespace

FrameBuilder::FrameBuilder(Time began, Duration window)
    : began_(began), window_(window), base_at_(began), next_at_(began) {}

void FrameBuilder::build(const Sample &sample, Time now, Frame &frame) {
  const bool turns = now - next_at_ >= window_;
  ++builds_;
  frame.began = began_;
  frame.published = now;
  frame.window = now - base_at_;
  frame.alert = sample.alert;
  frame.dags.clear();
  frame.tasks.clear();
  for (const DagSample &dag : sample.dags) {
    frame.dags.push_back(DagFrame{.name = dag.name, .max_active = dag.max_active, .deadline = dag.deadline});
  }
  build_tasks(sample, turns, frame);
  build_threads(sample, turns, frame);
  build_devices(sample, turns, frame);
  if (turns) {
    base_at_ = next_at_;
    next_at_ = now;
  }
  std::erase_if(histories_, [this](const auto &entry) { return entry.second.seen != builds_; });
}

void FrameBuilder::build_tasks(const Sample &sample, bool turns, Frame &frame) {
  std::vector<std::pair<TaskFrame, std::uint64_t>> rows;  // with their keys
  for (const TaskSample &task : sample.tasks) {
    REDAG_CHECK(task.dag < sample.dags.size(), "a task of a DAG that is not there");
    DagFrame &dag = frame.dags[task.dag];
    History &history = histories_[task.key];
    Mark current{task.finished, task.misses, task.preemptions, task.cpu, task.late_end_to_end, {}, {}};
    if (task.response) current.response = task.response->counts();
    if (task.end_to_end) current.end_to_end = task.end_to_end->counts();
    const bool is_another = history.histogram != task.response || task.finished < history.next.finished;
    if (is_another) history = History{};
    history.histogram = task.response;
    history.seen = builds_;

    HistogramCounts recent = current.response;
    recent -= history.base.response;
    TaskFrame row{.name = task.name,
                  .dag = task.dag,
                  .period = task.period,
                  .deadline = task.deadline,
                  .bound = task.bound,
                  .figures = figures_of(task, current, recent, history.base),
                  .priority = task.priority};
    set_counts(row.spread.all, current.response);
    add(dag.figures, row.figures);
    if (task.end_to_end) {
      HistogramCounts recent_answers = current.end_to_end;
      recent_answers -= history.base.end_to_end;
      add_answers(dag, current.end_to_end, recent_answers);
      dag.late += task.late_end_to_end;
      dag.recent_late += task.late_end_to_end - history.base.late_end_to_end;
    }
    rows.emplace_back(std::move(row), task.key);
    if (turns) {
      history.base = history.next;
      history.next = current;
    }
  }
  std::stable_sort(rows.begin(), rows.end(), [](const auto &a, const auto &b) { return a.first.dag < b.first.dag; });
  row_of_.clear();
  for (auto &[row, key] : rows) {
    row_of_.emplace(key, static_cast<std::uint32_t>(frame.tasks.size()));
    frame.tasks.push_back(std::move(row));
  }
}

void FrameBuilder::build_threads(const Sample &sample, bool turns, Frame &frame) {
  frame.threads.clear();
  frame.threads_in_all = static_cast<std::uint32_t>(sample.threads.size());
  threads_.resize(sample.threads.size());
  for (std::size_t i = 0; i < sample.threads.size(); ++i) {
    const ThreadSample &thread = sample.threads[i];
    ThreadHistory &history = threads_[i];
    frame.threads.push_back({.index = static_cast<std::uint32_t>(i),
                             .used = thread.used,
                             .recent_used = thread.used - history.base,
                             .task = thread.task ? row_of(*thread.task) : std::nullopt});
    if (turns) history = {history.next, thread.used};
  }
  if (frame.threads.size() <= page::kThreads) return;
  const auto busier = [](const ThreadFrame &a, const ThreadFrame &b) { return a.recent_used > b.recent_used; };
  std::stable_sort(frame.threads.begin(), frame.threads.end(), busier);
  frame.threads.resize(page::kThreads);
  std::sort(frame.threads.begin(), frame.threads.end(),
            [](const ThreadFrame &a, const ThreadFrame &b) { return a.index < b.index; });
}

void FrameBuilder::build_devices(const Sample &sample, bool turns, Frame &frame) {
  frame.devices.clear();
  frame.devices_in_all = static_cast<std::uint32_t>(sample.devices.size());
  devices_.resize(sample.devices.size());
  for (std::size_t d = 0; d < sample.devices.size(); ++d) {
    const DeviceSample &device = sample.devices[d];
    DeviceHistory &history = devices_[d];
    // A service that ends while the sample is taken may have been counted a little longer before.
    const DeviceMark now{std::max(device.busy, history.next.busy), device.served};
    DeviceFrame &row = frame.devices.emplace_back();
    row.name = device.name;
    row.slots = device.slots;
    row.used = static_cast<std::uint32_t>(device.serves.size());
    row.queued = device.queued;
    row.served = now.served;
    row.recent_served = now.served - history.base.served;
    row.busy = now.busy;
    row.recent_busy = now.busy - history.base.busy;
    for (const std::uint64_t key : device.serves) {
      const auto task = row_of(key);
      if (task && row.tasks.size() < page::kServices) row.tasks.push_back(*task);
    }
    if (turns) history = {history.next, now};
  }
  if (frame.devices.size() <= page::kDevices) return;
  std::vector<std::size_t> kept(frame.devices.size());
  std::iota(kept.begin(), kept.end(), std::size_t{0});
  std::stable_sort(kept.begin(), kept.end(), [&](std::size_t a, std::size_t b) {
    return frame.devices[a].recent_busy > frame.devices[b].recent_busy;
  });
  kept.resize(page::kDevices);
  std::sort(kept.begin(), kept.end());
  for (std::size_t i = 0; i < kept.size(); ++i) frame.devices[i] = frame.devices[kept[i]];
  frame.devices.resize(kept.size());
}

std::optional<std::uint32_t> FrameBuilder::row_of(std::uint64_t key) const {
  const auto row = row_of_.find(key);
  return row == row_of_.end() ? std::nullopt : std::optional(row->second);
}

page::Figures FrameBuilder::figures_of(const TaskSample &task, const Mark &now, const HistogramCounts &recent,
                                       const Mark &base) {
  page::Figures figures{};
  figures.released = task.released;
  figures.finished = task.finished;
  figures.skipped = task.skipped;
  figures.aborted = task.aborted;
  figures.misses = task.misses;
  figures.deferred = task.deferred;
  figures.preemptions = task.preemptions;
  figures.cpu = task.cpu;
  figures.recent_jobs = now.finished - base.finished;
  figures.recent_misses = now.misses - base.misses;
  figures.recent_preemptions = now.preemptions - base.preemptions;
  figures.recent_cpu = now.cpu - base.cpu;
  figures.active = task.active;
  figures.ready = task.ready;
  figures.waiting = task.waiting;
  figures.away = task.away;
  set_response(figures, now.response, recent);
  return figures;
}

}  // namespace redag::live
