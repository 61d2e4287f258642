// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/why_waits.hpp"

#include <algorithm>
#include <deque>

#include "redag/model/clusters.hpp"
#include "redag/sched/cluster_config.hpp"
#include "redag_analysis/executors/executors.hpp"
#include "redag_analysis/metrics/replay.hpp"

namespace redag::metrics {
namespace {

using State = LiveJob::State;

// Other executors have no max_active and no bound on the jobs of a task. Their order of jobs is not that of the policy,
// and a callback of theirs is never called more or less urgent here.
bool follows_the_model(const trace::RunInfo &info) {
  const executors::ExecutorKind *kind = executors::find_executor(info.executor);
  return info.driver != trace::Driver::RosNodes && (kind == nullptr || kind->ours);
}

// Follows one cluster, whose ids count from 0.
class ClusterWaits {
 public:
  ClusterWaits(const ClusterPart &part, const trace::RunInfo &info, const JobLinks &links)
      : part_(part),
        config_(sched::config_of(info.config, part_)),
        replay_(part_.workload, config_),
        priorities_(sched::assign_priorities(part_.workload.dags, config_.policy, config_.ties)),
        ours_(follows_the_model(info)),
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

  // The order of the checks is that of docs/model.md, "Deferral".
  [[nodiscard]] Wait not_started(const LiveJob &job) const {
    const Task &task = replay_.task(job.task);
    if (replay_.task_active(job.task) >= task.concurrency) {
      return by(Cause::OwnTask, holder([&](TaskId other) { return other == job.task; }));
    }
    for (const LiveJob &other : replay_.jobs_of(job.task)) {
      if (other.number == job.number) break;
      if (other.state == State::Ready) return by(Cause::OwnTask, &other);
    }
    const DagId dag = replay_.dag_of(job.task);
    const std::uint32_t most = part_.workload.dags[dag.value].max_active;
    if (ours_ && most > 0 && replay_.active(dag) >= most) {
      return by(Cause::MaxActive, holder([&](TaskId other) { return replay_.dag_of(other) == dag; }));
    }
    const std::uint32_t group = replay_.group_of(job.task);
    if (group != Replay::kNoGroup && replay_.group_active(group) > 0) {
      return by(Cause::Group, holder([&](TaskId other) { return replay_.group_of(other) == group; }));
    }
    if (config_.max_started > 0 && replay_.started() >= config_.max_started) {
      return by(Cause::NoThread, holder([](TaskId) { return true; }));
    }
    return occupied(job, Cause::Queued);
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

  [[nodiscard]] Wait compared(const LiveJob &job, const LiveJob *other, Cause usual) const {
    if (other == nullptr) return by(Cause::Unknown, nullptr);
    if (!ours_) return by(usual, other);
    if (is_demoted(job) && !is_demoted(*other) && would_outrank(job, *other)) return by(Cause::Demoted, other);
    return by(job.own.key < other->own.key ? Cause::Blocked : usual, other);
  }

  // By what the policy says without a demotion.
  [[nodiscard]] bool would_outrank(const LiveJob &job, const LiveJob &other) const {
    if (config_.policy == PolicyKind::Edf) return job.deadline <= other.deadline;
    return is_static(config_.policy) && priorities_[job.task.value].tier <= priorities_[other.task.value].tier;
  }

  [[nodiscard]] bool is_demoted(const LiveJob &job) const {
    return job.demoted || (replay_.high_mode() && replay_.is_degradable(job.task));
  }

  const ClusterPart part_;
  const sched::Config config_;
  Replay replay_;
  std::vector<sched::Priority> priorities_;
  bool ours_;
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
