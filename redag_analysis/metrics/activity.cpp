// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/activity.hpp"

#include <algorithm>

#include "redag/model/clusters.hpp"

namespace redag::metrics {

Activity::Activity(const Workload &workload, const sched::Config &config, Time begin)
    : replay_(workload, config),
      begin_(begin),
      peaks_(workload.dags.size(), 0),
      busy_(config.workers, 0),
      busy_since_(config.workers, kNever) {
  for (const Dag &dag : workload.dags) clusters_.push_back(cluster_of(workload.platform, dag).value_or(0));
  least_.resize(std::max<std::size_t>(1, workload.platform.clusters.size()));
}

void Activity::add(std::span<const JobEvent> events) {
  for (const JobEvent &event : events) add(event);
}

void Activity::add(const JobEvent &event) {
  if (event.task.value >= replay_.task_count() || is_of_body(event.kind)) return;
  if (any_ && event.time > time_) end_of_instant();
  any_ = true;
  time_ = std::max(time_, event.time);
  replay_.apply(event);
  if (event.kind == JobEventKind::HighMode) high_since_ = event.time;
  if (event.kind == JobEventKind::LowMode) close_high_mode(event.time);

  if (event.kind == JobEventKind::Dispatched) {
    std::uint32_t &peak = peaks_[replay_.dag_of(event.task).value];
    peak = std::max(peak, replay_.active(replay_.dag_of(event.task)));
    const std::uint32_t group = replay_.group_of(event.task);
    if (group != Replay::kNoGroup && replay_.group_active(group) > 1) ++group_overlaps_;
  }
  if (event.worker >= busy_.size()) return;
  Time &since = busy_since_[event.worker];
  const bool is_busy = !replay_.stack(event.worker).empty();
  if (is_busy && since == kNever) since = event.time;
  if (!is_busy && since != kNever) {
    busy_[event.worker] += measured(since, event.time);
    since = kNever;
  }
}

// Decisions of one instant belong together. Only an inversion that remains when time moves on has a length.
void Activity::end_of_instant() {
  const bool inverted = is_inverted();
  if (inverted && inverted_since_ == kNever) inverted_since_ = time_;
  if (!inverted) close_inversion(time_);
}

// No job waits for one of another cluster.
bool Activity::is_inverted() {
  const auto cluster = [this](TaskId task) { return clusters_[replay_.dag_of(task).value]; };
  std::fill(least_.begin(), least_.end(), nullptr);
  for (std::uint32_t w = 0; w < replay_.worker_count(); ++w) {
    const LiveJob *job = replay_.running(w);
    if (job == nullptr) continue;
    const Urgency *&least = least_[cluster(job->task)];
    if (least == nullptr || *least < job->own) least = &job->own;
  }
  const auto is_above_least = [&](TaskId task, const Urgency &urgency) {
    const Urgency *least = least_[cluster(task)];
    return least != nullptr && urgency.key < least->key;
  };
  // A job that lacks only a thread also waits for a less urgent one.
  for (const Replay::Waiter &waiter : replay_.eligible_but_for_threads()) {
    if (is_above_least(waiter.task, waiter.urgency)) return true;
    if (least_.size() == 1) break;  // it is the most urgent one
  }
  return std::any_of(replay_.suspended().begin(), replay_.suspended().end(), [&](const Replay::JobRef &ref) {
    return is_above_least(ref.task, replay_.find(ref.task, ref.number)->own);
  });
}

Duration Activity::measured(Time from, Time to) const { return std::max<Duration>(0, to - std::max(from, begin_)); }

void Activity::close_inversion(Time at) {
  if (inverted_since_ == kNever) return;
  const Duration length = measured(inverted_since_, at);
  inverted_since_ = kNever;
  if (length == 0) return;
  ++inversions_.count;
  inversions_.total += length;
  inversions_.longest = std::max(inversions_.longest, length);
}

void Activity::close_high_mode(Time at) {
  if (high_since_ != kNever && at >= begin_) {
    ++high_mode_.count;
    high_mode_.total += measured(high_since_, at);
  }
  high_since_ = kNever;
}

void Activity::finish(Time end) {
  if (any_) end_of_instant();
  close_high_mode(end);
  close_inversion(end);
  for (std::size_t w = 0; w < busy_.size(); ++w) {
    if (busy_since_[w] != kNever) busy_[w] += measured(busy_since_[w], end);
    busy_since_[w] = kNever;
  }
}

}  // namespace redag::metrics
