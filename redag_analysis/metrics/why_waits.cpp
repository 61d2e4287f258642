// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/why_waits.hpp"

#include <algorithm>
#include <deque>

#include "redag/model/clusters.hpp"
#include "redag/sched/cluster_config.hpp"
#include "redag_analysis/metrics/replay.hpp"
#include "redag_analysis/metrics/trace_checker.hpp"

namespace redag::metrics {
namespace {

using State = LiveJob::State;

// Other executors have no max_active: it must not explain a wait of theirs.
ClusterPart as_followed(ClusterPart part, const RuleSet &rules) {
  if (rules.contains(Rule::MaxActive)) return part;
  for (Dag &dag : part.workload.dags) dag.max_active = 0;
  return part;
}

// Follows one cluster, whose ids count from 0.
class ClusterWaits {
 public:
  ClusterWaits(const ClusterPart &part, const trace::RunInfo &info, const JobLinks &links)
      : rules_(rules_for(info)),
        part_(as_followed(part, rules_)),
        config_(sched::config_of(info.config, part_)),
        replay_(part_.workload, config_),
        links_(links) {}

  void add(JobEvent event, const std::vector<bool> &chosen, std::vector<std::vector<Wait>> &waits) {
    if (!any_ || event.time > time_) {
      if (any_) extend(event.time, waits);
      time_ = event.time;
      any_ = true;
    }
    const std::size_t job = links_.find({part_.tasks[event.task.value], event.job});
    if (event.worker != WorkerId::kNoneValue) event.worker -= part_.first_worker;
    replay_.apply(event);
    if (job == JobLinks::kNone || !chosen[job]) return;
    if (event.kind == JobEventKind::Released) followed_.push_back({event.task, event.job, job});
    if (replay_.find(event.task, event.job) == nullptr) {
      std::erase_if(followed_, [job](const Followed &one) { return one.index == job; });
    }
  }

  /// Adds the time until `until` to the stretches of all followed jobs.
  void extend(Time until, std::vector<std::vector<Wait>> &waits) {
    for (const Followed &job : followed_) {
      const LiveJob *live = replay_.find(job.task, job.number);
      if (live == nullptr || until <= time_) continue;
      const Wait now = reason(*live);
      std::vector<Wait> &list = waits[job.index];
      if (!list.empty() && list.back().cause == now.cause && list.back().by == now.by && list.back().end == time_) {
        list.back().end = until;
      } else {
        list.push_back({now.cause, now.by, time_, until});
      }
    }
  }

 private:
  struct Followed {
    TaskId task;
    std::uint32_t number;
    std::size_t index;  // in JobLinks
  };

  [[nodiscard]] Wait by(Cause cause, const LiveJob *job) const {
    return {cause, job == nullptr ? JobId{} : JobId{part_.tasks[job->task.value], job->number}, 0, 0};
  }

  [[nodiscard]] Wait reason(const LiveJob &job) const {
    switch (job.state) {
      case State::Waiting: return by(Cause::Predecessor, nullptr);
      case State::Ready: return not_started(job);
      case State::Running: return by(Cause::Execution, nullptr);
      case State::Suspended: return not_resumed(job);
      case State::AtDevice: return at_device(job);
      case State::Away: return by(Cause::Waited, nullptr);
      case State::Woken: return occupied(job, Cause::Queued);
      case State::Ended: break;
    }
    return by(Cause::Unknown, nullptr);
  }

  // Of the started jobs of the tasks in question, the one that ends first: it lets the next one start.
  template <class Concerns>
  [[nodiscard]] const LiveJob *holder(Concerns concerns) const {
    const LiveJob *first = nullptr;
    Time first_end = kNever;
    for (std::size_t t = 0; t < replay_.task_count(); ++t) {
      if (!concerns(TaskId(t))) continue;
      for (const LiveJob &job : replay_.jobs_of(TaskId(t))) {
        if (!job.started()) continue;
        const std::size_t index = links_.find({part_.tasks[t], job.number});
        const Time end = index == JobLinks::kNone ? kNever : links_.end_of(index);
        if (first != nullptr && end >= first_end) continue;
        first = &job;
        first_end = end;
      }
    }
    return first;
  }

  [[nodiscard]] Wait not_started(const LiveJob &job) const {
    const Replay::Gate gate = replay_.gate(job.task);
    if (gate == Replay::Gate::Task) {
      return by(Cause::OwnTask, holder([&](TaskId other) { return other == job.task; }));
    }
    for (const LiveJob &other : replay_.jobs_of(job.task)) {
      if (other.number == job.number) break;
      if (other.state == State::Ready) return by(Cause::OwnTask, &other);
    }
    if (gate == Replay::Gate::Dag) {
      const DagId dag = replay_.dag_of(job.task);
      return by(Cause::MaxActive, holder([&](TaskId other) { return replay_.dag_of(other) == dag; }));
    }
    if (gate == Replay::Gate::Group) {
      const std::uint32_t group = replay_.group_of(job.task);
      return by(Cause::Group, holder([&](TaskId other) { return replay_.group_of(other) == group; }));
    }
    if (replay_.at_thread_limit()) return by(Cause::NoThread, holder([](TaskId) { return true; }));
    return occupied(job, Cause::Queued);
  }

  // Names the first job that the device serves.
  [[nodiscard]] Wait at_device(const LiveJob &job) const {
    for (std::size_t t = 0; t < replay_.task_count(); ++t) {
      for (const LiveJob &other : replay_.jobs_of(TaskId(t))) {
        if (other.state == State::Away && other.device == job.device) return by(Cause::DeviceQueue, &other);
      }
    }
    return by(Cause::Unknown, nullptr);
  }

  [[nodiscard]] Wait not_resumed(const LiveJob &job) const {
    if (config_.preemption != sched::Preemption::Cooperative) return occupied(job, Cause::Preempted);
    return job.worker < replay_.worker_count() ? compared(job, replay_.running(job.worker), Cause::Preempted)
                                               : by(Cause::Unknown, nullptr);
  }

  // The job would run instead of the least urgent one that runs. While a worker is free, the trace does not tell why.
  [[nodiscard]] Wait occupied(const LiveJob &job, Cause usual) const {
    const LiveJob *least = nullptr;
    for (std::uint32_t w = 0; w < replay_.worker_count(); ++w) {
      const LiveJob *running = replay_.running(w);
      if (running == nullptr) return by(Cause::Unknown, nullptr);
      if (least == nullptr || least->own < running->own) least = running;
    }
    return compared(job, least, usual);
  }

  // Jobs of other executors have no order here: none of them is called more or less urgent.
  [[nodiscard]] Wait compared(const LiveJob &job, const LiveJob *other, Cause usual) const {
    if (other == nullptr) return by(Cause::Unknown, nullptr);
    if (!rules_.contains(Rule::Priority)) return by(usual, other);
    if (replay_.is_passed_by_demotion(job, *other)) return by(Cause::Demoted, other);
    return by(job.own.key < other->own.key ? Cause::Blocked : usual, other);
  }

  const RuleSet rules_;
  const ClusterPart part_;
  const sched::Config config_;
  Replay replay_;
  const JobLinks &links_;
  std::vector<Followed> followed_;
  Time time_ = 0;
  bool any_ = false;
};

}  // namespace

std::vector<std::vector<Wait>> waits_of(const trace::Trace &trace, const JobLinks &links,
                                        const std::vector<bool> &chosen) {
  std::vector<std::vector<Wait>> waits(links.jobs().size());
  const std::vector<ClusterPart> parts = parts_of(trace.info.workload);
  const std::vector<TaskPlace> places = places_in(parts);
  std::deque<ClusterWaits> clusters;  // keeps its elements where they are
  for (const ClusterPart &part : parts) clusters.emplace_back(part, trace.info, links);
  for (JobEvent event : trace.events) {
    if (event.task.value >= places.size() || is_of_body(event.kind)) continue;
    const TaskPlace &place = places[event.task.value];
    event.task = place.task;
    clusters[place.part].add(event, chosen, waits);
  }
  for (ClusterWaits &cluster : clusters) cluster.extend(trace.info.end, waits);
  return waits;
}

}  // namespace redag::metrics
