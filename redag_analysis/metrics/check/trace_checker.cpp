// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/check/trace_checker.hpp"

#include <deque>
#include <limits>
#include <utility>
#include <vector>

#include "redag/derived/clusters.hpp"
#include "redag_analysis/executors/executors.hpp"
#include "redag_analysis/metrics/check/check_context.hpp"
#include "redag_analysis/metrics/check/check_device.hpp"
#include "redag_analysis/metrics/check/check_dispatch.hpp"
#include "redag_analysis/metrics/check/check_overload.hpp"
#include "redag_analysis/metrics/check/check_release.hpp"
#include "redag_analysis/metrics/check/check_start.hpp"
#include "redag_analysis/metrics/replay.hpp"

namespace redag::metrics {
namespace {

// Checks what one cluster did. The rules know the cluster's part only, with its ids.
class Checker {
 public:
  /// `info` is that of the run with the part's workload and config.
  Checker(trace::RunInfo info, const ClusterPart &part, const RuleSet &rules, CheckReport &report)
      : info_(std::move(info)),
        part_(part),
        replay_(info_.workload, info_.config),
        context_(info_, part.tasks, replay_, rules, report),
        releases_(context_),
        decisions_(context_),
        devices_(context_),
        overload_(context_),
        starts_(context_),
        counts_(info_.workload.task_count()) {}

  /// Checks event `index` of the run. `places` are those of all tasks, and `own` is the index of the part. The first
  /// part also checks the stream.
  void add(std::size_t index, JobEvent event, const std::vector<TaskPlace> &places, std::uint32_t own) {
    const bool is_first = own == 0;
    const bool known = event.task.value < places.size();
    if (known ? places[event.task.value].part == own : is_first) {
      if (known) event.task = places[event.task.value].task;
      step(index, event, is_first);
    } else if (is_first) {
      check_time(index, event);
    }
  }

  void end_of_trace(Time end) {
    info_.end = end;
    end_of_instant();
    releases_.end_of_trace();
    decisions_.end_of_trace();
    devices_.end_of_trace();
    starts_.end_of_trace();
    check_conservation();
  }

  void check_loss(std::uint64_t lost_events) {
    context_.at(0, 0);
    context_.expect(Rule::Stream, lost_events == 0, TaskId(), 0, [&] {
      return std::to_string(lost_events) + " events were lost: the trace has holes and cannot be checked";
    });
  }

 private:
  struct Counts {
    std::uint64_t released = 0;
    std::uint64_t ended = 0;
  };

  // Checks that time does not go backwards in the whole stream.
  void check_time(std::size_t index, const JobEvent &event) {
    if (is_of_body(event.kind)) return;
    context_.at(index, event.time);
    context_.expect(Rule::Stream, event.time >= stream_time_, event.task, event.job,
                    [&] { return "the time goes backwards from " + format_duration(stream_time_); });
    stream_time_ = std::max(stream_time_, event.time);
  }

  // Renumbers the event's worker as the cluster does. Returns false for a worker of another cluster.
  bool take_worker(JobEvent &event) const {
    if (event.worker == WorkerId::kNoneValue) return true;
    const std::uint32_t worker = event.worker - part_.first_worker;
    const bool is_own = event.worker >= part_.first_worker && worker < replay_.worker_count();
    event.worker = is_own ? worker : replay_.worker_count();
    return is_own || !part_.is_cluster();
  }

  void step(std::size_t index, JobEvent event, bool checks_time) {
    const bool known = event.task.value < counts_.size();
    if (!is_of_body(event.kind)) {
      if (event.time > time_) end_of_instant();
      time_ = std::max(time_, event.time);
    }
    context_.at(index, event.time);
    if (checks_time) check_time(index, event);
    const bool own_worker = take_worker(event);
    context_.expect(Rule::Stream, known, event.task, event.job, [] { return std::string("there is no such task"); });
    if (!known) return;

    releases_.before(event);
    decisions_.before(event);
    devices_.before(event);
    overload_.before(event);
    starts_.before(event);
    Counts &counts = counts_[event.task.value];
    if (event.kind == JobEventKind::Released) ++counts.released;
    if (event.kind == JobEventKind::Finished || event.kind == JobEventKind::Skipped ||
        event.kind == JobEventKind::Aborted) {
      ++counts.ended;
    }
    const char *problem = replay_.apply(event);
    const bool about_worker = event.kind == JobEventKind::Dispatched || event.kind == JobEventKind::Resumed;
    context_.expect(about_worker ? Rule::Worker : Rule::Life, problem == nullptr, event.task, event.job, [&] {
      return std::string(to_string(event.kind)) + ": " +
             (own_worker ? problem : "the worker belongs to another cluster");
    });
  }

  void end_of_instant() {
    releases_.end_of_instant();
    decisions_.end_of_instant();
    devices_.end_of_instant();
    overload_.end_of_instant();
  }

  void check_conservation() {
    for (std::size_t t = 0; t < counts_.size(); ++t) {
      const std::uint64_t in_flight = replay_.jobs_of(TaskId(t)).size();
      context_.expect(Rule::Conservation, counts_[t].released == counts_[t].ended + in_flight, TaskId(t), 0, [&] {
        return std::to_string(counts_[t].released) + " jobs were released, " + std::to_string(counts_[t].ended) +
               " ended and " + std::to_string(in_flight) + " are in flight";
      });
    }
  }

  trace::RunInfo info_;
  const ClusterPart &part_;
  Replay replay_;
  CheckContext context_;
  ReleaseRules releases_;
  DispatchRules decisions_;
  DeviceRules devices_;
  OverloadRules overload_;
  StartRules starts_;
  std::vector<Counts> counts_;
  Time time_ = std::numeric_limits<Time>::min();
  Time stream_time_ = std::numeric_limits<Time>::min();  // of all clusters
};

bool is_peer(const std::string &executor) {
  const executors::ExecutorKind *kind = executors::find_executor(executor);
  return kind != nullptr && !kind->ours;
}

}  // namespace

RuleSet rules_for(const trace::RunInfo &info) {
  switch (info.driver) {
    case trace::Driver::Simulator:
    case trace::Driver::Threads: return is_peer(info.executor) ? RuleSet::rclcpp() : RuleSet::all();
    case trace::Driver::Ros: return RuleSet::all().without(Rule::Grid);
    case trace::Driver::RosNodes:
      return RuleSet::rclcpp().without(Rule::Precedence).without(Rule::Admission).without(Rule::Worker);
  }
  return RuleSet::all();
}

class TraceChecker::Impl {
 public:
  Impl(const trace::RunInfo &run, const RuleSet &rules) : parts_(parts_of(run.workload)), places_(places_in(parts_)) {
    for (std::uint32_t p = 0; p < parts_.size(); ++p) {
      trace::RunInfo info = run;
      info.workload = parts_[p].workload;
      info.config = executors::config_of(info.config, parts_[p]);
      info.event_tasks.clear();
      for (const TaskId task : run.event_tasks) {
        if (places_[task.value].part == p) info.event_tasks.push_back(places_[task.value].task);
      }
      info.edges.clear();
      for (trace::Edge edge : run.edges) {
        if (places_[edge.from.value].part != p || places_[edge.to.value].part != p) continue;
        edge.from = places_[edge.from.value].task;
        edge.to = places_[edge.to.value].task;
        info.edges.push_back(edge);
      }
      checkers_.emplace_back(std::move(info), parts_[p], rules, report_);
    }
  }

  void add(std::span<const JobEvent> events) {
    for (const JobEvent &event : events) {
      for (std::uint32_t p = 0; p < checkers_.size(); ++p) checkers_[p].add(count_, event, places_, p);
      ++count_;
    }
  }

  CheckReport finish(Time end, std::uint64_t lost_events) {
    if (lost_events > 0) report_ = {};
    checkers_.front().check_loss(lost_events);
    if (lost_events > 0) return std::move(report_);
    for (Checker &checker : checkers_) checker.end_of_trace(end);
    return std::move(report_);
  }

 private:
  std::vector<ClusterPart> parts_;
  std::vector<TaskPlace> places_;
  CheckReport report_;
  std::deque<Checker> checkers_;  // by part; keeps its elements where they are
  std::size_t count_ = 0;
};

TraceChecker::TraceChecker(const trace::RunInfo &run, const RuleSet &rules)
    : impl_(std::make_unique<Impl>(run, rules)) {}
TraceChecker::TraceChecker(TraceChecker &&) noexcept = default;
TraceChecker::~TraceChecker() = default;

void TraceChecker::add(std::span<const JobEvent> events) { impl_->add(events); }

CheckReport TraceChecker::finish(Time end, std::uint64_t lost_events) { return impl_->finish(end, lost_events); }

CheckReport check_trace(const trace::Trace &trace, const RuleSet &rules) {
  TraceChecker checker(trace.info, rules);
  if (trace.info.lost_events == 0) checker.add(trace.events);
  return checker.finish(trace.info.end, trace.info.lost_events);
}

}  // namespace redag::metrics
