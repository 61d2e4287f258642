// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/activity.hpp"

#include <algorithm>

#include "redag/derived/clusters.hpp"
#include "redag_analysis/executors/executors.hpp"

namespace redag::metrics {

Activity::Activity(const Workload &workload, const sched::Config &config, Time begin)
    : begin_(begin), peaks_(workload.dags.size(), 0), busy_(config.workers, 0), busy_since_(config.workers, kNever) {
  const std::vector<ClusterPart> parts = parts_of(workload);
  for (const ClusterPart &part : parts) parts_.emplace_back(part, executors::config_of(config, part));
  places_ = places_in(parts);
}

void Activity::add(std::span<const JobEvent> events) {
  for (const JobEvent &event : events) add(event);
}

void Activity::add(const JobEvent &event) {
  if (event.task.value >= places_.size() || is_of_body(event.kind)) return;
  if (any_ && event.time > time_) end_of_instant();
  any_ = true;
  time_ = std::max(time_, event.time);
  Part &part = parts_[places_[event.task.value].part];
  Replay &replay = part.replay;
  JobEvent own = event;  // in the cluster's numbers
  own.task = places_[event.task.value].task;
  if (event.worker != WorkerId::kNoneValue) own.worker -= part.cluster.first_worker;
  replay.apply(own);
  if (event.kind == JobEventKind::HighMode) part.high_since = event.time;
  if (event.kind == JobEventKind::LowMode) close_high_mode(part, event.time);

  if (event.kind == JobEventKind::Dispatched) {
    const DagId dag = replay.dag_of(own.task);
    std::uint32_t &peak = peaks_[part.cluster.dags[dag.value].value];
    peak = std::max(peak, replay.active(dag));
    const std::uint32_t group = replay.group_of(own.task);
    if (group != Replay::kNoGroup && replay.group_active(group) > 1) ++group_overlaps_;
  }
  if (event.worker >= busy_.size() || own.worker >= replay.worker_count()) return;
  Time &since = busy_since_[event.worker];
  const bool is_busy = !replay.stack(own.worker).empty();
  if (is_busy && since == kNever) since = event.time;
  if (!is_busy && since != kNever) {
    busy_[event.worker] += measured(since, event.time);
    since = kNever;
  }
}

// Decisions of one instant belong together. Only an inversion that remains when time moves on has a length.
void Activity::end_of_instant() {
  const bool inverted =
      std::any_of(parts_.begin(), parts_.end(), [](const Part &part) { return is_inverted(part.replay); });
  if (inverted && inverted_since_ == kNever) inverted_since_ = time_;
  if (!inverted) close_inversion(time_);
}

bool Activity::is_inverted(const Replay &replay) {
  const Urgency *least = nullptr;
  for (std::uint32_t w = 0; w < replay.worker_count(); ++w) {
    const LiveJob *job = replay.running(w);
    if (job != nullptr && (least == nullptr || *least < job->own)) least = &job->own;
  }
  if (least == nullptr) return false;
  // A job that lacks only a thread also waits for a less urgent one.
  const auto &waiting = replay.eligible_but_for_threads();
  if (!waiting.empty() && waiting.begin()->urgency.key < least->key) return true;
  return std::any_of(replay.suspended().begin(), replay.suspended().end(), [&](const Replay::JobRef &ref) {
    return replay.find(ref.task, ref.number)->own.key < least->key;
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

void Activity::close_high_mode(Part &part, Time at) {
  if (part.high_since != kNever && at >= begin_) {
    ++high_mode_.count;
    high_mode_.total += measured(part.high_since, at);
  }
  part.high_since = kNever;
}

void Activity::finish(Time end) {
  if (any_) end_of_instant();
  for (Part &part : parts_) close_high_mode(part, end);
  close_inversion(end);
  for (std::size_t w = 0; w < busy_.size(); ++w) {
    if (busy_since_[w] != kNever) busy_[w] += measured(busy_since_[w], end);
    busy_since_[w] = kNever;
  }
}

}  // namespace redag::metrics
