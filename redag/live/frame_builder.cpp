// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/live/frame_builder.hpp"

#include <algorithm>

#include "redag/base/check.hpp"

namespace redag::live {
namespace {

void set_response(page::Figures &figures, const HistogramCounts &all, const HistogramCounts &recent) {
  figures.response_p50 = all.percentile(0.5);
  figures.response_p99 = all.percentile(0.99);
  figures.response_max = all.longest();
  figures.recent_p50 = recent.percentile(0.5);
  figures.recent_p99 = recent.percentile(0.99);
  figures.recent_max = recent.percentile(1.0);
}

void copy_response(const page::Figures &from, page::Figures &to) {
  to.response_p50 = from.response_p50;
  to.response_p99 = from.response_p99;
  to.response_max = from.response_max;
  to.recent_p50 = from.recent_p50;
  to.recent_p99 = from.recent_p99;
  to.recent_max = from.recent_max;
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
  for (const DagSample &dag : sample.dags) frame.dags.push_back(DagFrame{dag.name, dag.max_active, {}});
  std::vector<std::size_t> tasks_of(sample.dags.size());

  for (const TaskSample &task : sample.tasks) {
    REDAG_CHECK(task.dag < sample.dags.size(), "a task of a DAG that is not there");
    History &history = histories_[task.key];
    Mark current{task.finished, task.misses, task.preemptions, task.cpu, {}};
    if (task.response) current.response = task.response->counts();
    const bool is_another = history.histogram != task.response || task.finished < history.next.finished;
    if (is_another) history = History{};
    history.histogram = task.response;
    history.seen = builds_;

    HistogramCounts recent = current.response;
    recent -= history.base.response;
    TaskFrame row{task.name,     task.dag,   task.period,
                  task.deadline, task.bound, figures_of(task, current, recent, history.base)};
    add(frame.dags[task.dag].figures, row.figures);
    ++tasks_of[task.dag];
    frame.tasks.push_back(std::move(row));
    if (turns) {
      history.base = history.next;
      history.next = current;
    }
  }
  // The response of a DAG is end to end, which its tasks' responses do not give. Only that of a single task is also the
  // DAG's.
  for (const TaskFrame &task : frame.tasks) {
    if (tasks_of[task.dag] == 1) copy_response(task.figures, frame.dags[task.dag].figures);
  }
  std::stable_sort(frame.tasks.begin(), frame.tasks.end(),
                   [](const TaskFrame &a, const TaskFrame &b) { return a.dag < b.dag; });
  if (turns) {
    base_at_ = next_at_;
    next_at_ = now;
  }
  std::erase_if(histories_, [this](const auto &entry) { return entry.second.seen != builds_; });
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
  set_response(figures, now.response, recent);
  return figures;
}

}  // namespace redag::live
