// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/why/why_waits.hpp"

#include <algorithm>
#include <deque>
#include <utility>
#include <vector>

#include "redag/derived/clusters.hpp"
#include "redag_analysis/executors/executors.hpp"
#include "redag_analysis/metrics/check/trace_checker.hpp"
#include "redag_analysis/metrics/replay.hpp"

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
  ClusterWaits(const ClusterPart &part, const trace::RunInfo &info)
      : rules_(rules_for(info)),
        part_(as_followed(part, rules_)),
        config_(executors::config_of(info.config, part_)),
        replay_(part_.workload, config_) {}

  /// Adds the time until `time` to the stretches of all followed jobs.
  void advance(Time time, const JobLinks &links) {
    if (!any_ || time > time_) {
      if (any_) extend(time, links);
      time_ = time;
      any_ = true;
    }
  }

  /// `follow`: the job that the event releases, if it is to be followed.
  void add(JobEvent event, JobHandle follow) {
    if (event.worker != WorkerId::kNoneValue) event.worker -= part_.first_worker;
    replay_.apply(event);
    if (follow != nullptr) followed_.push_back({event.task, event.job, std::move(follow)});
    if (followed_.empty() || replay_.find(event.task, event.job) != nullptr) return;
    std::erase_if(followed_, [&](const Followed &one) { return one.task == event.task && one.number == event.job; });
  }

 private:
  struct Followed {
    TaskId task;
    std::uint32_t number;
    JobHandle job;
  };

  void extend(Time until, const JobLinks &links) {
    for (const Followed &job : followed_) {
      const LiveJob *live = replay_.find(job.task, job.number);
      if (live == nullptr || until <= time_) continue;
      Wait now = reason(*live, links);
      std::vector<Wait> &list = job.job->waits;
      if (!list.empty() && is_same(list.back(), now) && list.back().end == time_) {
        list.back().end = until;
      } else {
        now.begin = time_;
        now.end = until;
        list.push_back(std::move(now));
      }
    }
  }

  static bool is_same(const Wait &a, const Wait &b) {
    if (a.cause != b.cause || a.by != b.by || (a.holders == nullptr) != (b.holders == nullptr)) return false;
    return a.holders == nullptr || *a.holders == *b.holders;
  }

  [[nodiscard]] Wait by(Cause cause, const LiveJob *job) const {
    return {cause, job == nullptr ? JobId{} : JobId{part_.tasks[job->task.value], job->number}, 0, 0, nullptr};
  }

  [[nodiscard]] Wait reason(const LiveJob &job, const JobLinks &links) const {
    switch (job.state) {
      case State::Waiting: return by(Cause::Predecessor, nullptr);
      case State::Ready: return not_started(job, links);
      case State::Running: return by(Cause::Execution, nullptr);
      case State::Suspended: return not_resumed(job);
      case State::AtDevice: return at_device(job);
      case State::Away: return by(Cause::Waited, nullptr);
      case State::Woken: return occupied(job, Cause::Queued);
      case State::Ended: break;
    }
    return by(Cause::Unknown, nullptr);
  }

  // Of the started jobs of the tasks in question, the one that ends first lets the next one start.
  template <class Concerns>
  [[nodiscard]] Wait held(Cause cause, const JobLinks &links, Concerns concerns) const {
    Holders holders;
    for (std::size_t t = 0; t < replay_.task_count(); ++t) {
      if (!concerns(TaskId(t))) continue;
      for (const LiveJob &job : replay_.jobs_of(TaskId(t))) {
        if (!job.started()) continue;
        const JobHandle holder = links.find({part_.tasks[t], job.number});
        if (holder == nullptr) continue;
        if (holder->ending == nullptr) holder->ending = std::make_shared<Ending>(Ending{.job = holder->id()});
        holders.push_back(holder->ending);
      }
    }
    Wait wait = by(cause, nullptr);
    if (!holders.empty()) wait.holders = std::make_shared<const Holders>(std::move(holders));
    return wait;
  }

  [[nodiscard]] Wait not_started(const LiveJob &job, const JobLinks &links) const {
    const Replay::Gate gate = replay_.gate(job.task);
    if (gate == Replay::Gate::Task) {
      return held(Cause::OwnTask, links, [&](TaskId other) { return other == job.task; });
    }
    // Behind an earlier job that has not started, it waits for what keeps that one from starting.
    for (const LiveJob &other : replay_.jobs_of(job.task)) {
      if (other.number == job.number) break;
      if (other.state == State::Ready) return not_started(other, links);
    }
    if (gate == Replay::Gate::Dag) {
      const DagId dag = replay_.dag_of(job.task);
      return held(Cause::MaxActive, links, [&](TaskId other) { return replay_.dag_of(other) == dag; });
    }
    if (gate == Replay::Gate::Group) {
      const std::uint32_t group = replay_.group_of(job.task);
      return held(Cause::Group, links, [&](TaskId other) { return replay_.group_of(other) == group; });
    }
    if (replay_.at_thread_limit()) return held(Cause::NoThread, links, [](TaskId) { return true; });
    return occupied(job, Cause::Queued);
  }

  // Names the first job that the device serves.
  [[nodiscard]] Wait at_device(const LiveJob &job) const {
    for (std::size_t t = 0; t < replay_.task_count(); ++t) {
      for (const LiveJob &other : replay_.jobs_of(TaskId(t))) {
        if (other.state == State::Away && other.device == job.device) return by(Cause::DeviceQueue, &other);
      }
    }
    // Otherwise it serves a job of another cluster.
    const bool is_shared = part_.workload.platform.devices[static_cast<std::size_t>(job.device)].others > 0;
    return by(is_shared ? Cause::DeviceQueue : Cause::Unknown, nullptr);
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
  std::vector<Followed> followed_;
  Time time_ = 0;
  bool any_ = false;
};

}  // namespace

class WaitWatch::Impl {
 public:
  Impl(const trace::RunInfo &run, IsChosen is_chosen)
      : run_(run), is_chosen_(std::move(is_chosen)), parts_(parts_of(run.workload)), places_(places_in(parts_)) {
    for (const ClusterPart &part : parts_) clusters_.emplace_back(part, run);
  }

  void add(const JobEvent &event, JobLinks &links) {
    if (event.task.value >= places_.size() || is_of_body(event.kind)) {
      links.add(event);
      return;
    }
    const TaskPlace &place = places_[event.task.value];
    clusters_[place.part].advance(event.time, links);
    links.add(event);
    const JobId id{event.task, event.job};
    JobHandle follow;
    if (event.kind == JobEventKind::Released && is_chosen_(id)) follow = links.find(id);
    JobEvent within = event;
    within.task = place.task;
    clusters_[place.part].add(within, std::move(follow));
  }

  void finish(JobLinks &links) {
    for (ClusterWaits &cluster : clusters_) cluster.advance(run_.end, links);
    links.finish();
  }

 private:
  const trace::RunInfo &run_;
  IsChosen is_chosen_;
  std::vector<ClusterPart> parts_;
  std::vector<TaskPlace> places_;
  std::deque<ClusterWaits> clusters_;  // keeps its elements where they are
};

WaitWatch::WaitWatch(const trace::RunInfo &run, IsChosen is_chosen)
    : impl_(std::make_unique<Impl>(run, std::move(is_chosen))) {}
WaitWatch::~WaitWatch() = default;

void WaitWatch::add(const JobEvent &event, JobLinks &links) { impl_->add(event, links); }
void WaitWatch::finish(JobLinks &links) { impl_->finish(links); }

bool has_known_holders(const LinkedJob &job) {
  return std::all_of(job.waits.begin(), job.waits.end(), [](const Wait &wait) {
    return wait.holders == nullptr ||
           std::all_of(wait.holders->begin(), wait.holders->end(), [](const auto &holder) { return holder->is_known; });
  });
}

void name_holders(LinkedJob &job) {
  for (Wait &wait : job.waits) {
    if (wait.holders == nullptr) continue;
    const auto first = std::min_element(wait.holders->begin(), wait.holders->end(),
                                        [](const auto &a, const auto &b) { return a->time < b->time; });
    wait.by = (*first)->job;
    wait.holders.reset();
  }
}

}  // namespace redag::metrics
