// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/trace_checker.hpp"

#include <limits>

#include "redag_analysis/executors/executors.hpp"
#include "redag_analysis/metrics/check_context.hpp"
#include "redag_analysis/metrics/check_dispatch.hpp"
#include "redag_analysis/metrics/check_overload.hpp"
#include "redag_analysis/metrics/check_release.hpp"
#include "redag_analysis/metrics/check_start.hpp"
#include "redag_analysis/metrics/replay.hpp"

namespace redag::metrics {
namespace {

class Checker {
 public:
  Checker(const trace::Trace &trace, const RuleSet &rules)
      : trace_(trace),
        replay_(trace.info.workload, trace.info.config),
        context_(trace.info, replay_, rules, report_),
        releases_(context_),
        decisions_(context_),
        overload_(context_),
        starts_(context_),
        counts_(trace.info.workload.task_count()) {}

  CheckReport run() {
    context_.expect(Rule::Stream, trace_.info.lost_events == 0, TaskId(), 0, [&] {
      return std::to_string(trace_.info.lost_events) + " events were lost: the trace has holes and cannot be checked";
    });
    if (trace_.info.lost_events > 0) return std::move(report_);
    for (std::size_t i = 0; i < trace_.events.size(); ++i) step(i, trace_.events[i]);
    end_of_instant();
    releases_.end_of_trace();
    decisions_.end_of_trace();
    starts_.end_of_trace();
    check_conservation();
    return std::move(report_);
  }

 private:
  struct Counts {
    std::uint64_t released = 0;
    std::uint64_t ended = 0;
  };

  void step(std::size_t index, const JobEvent &event) {
    const bool known = event.task.value < counts_.size();
    if (!is_of_body(event.kind)) {
      if (event.time > time_) end_of_instant();
      context_.at(index, event.time);
      context_.expect(Rule::Stream, event.time >= time_, event.task, event.job,
                      [&] { return "the time goes backwards from " + format_duration(time_); });
      time_ = std::max(time_, event.time);
    } else {
      context_.at(index, event.time);
    }
    context_.expect(Rule::Stream, known, event.task, event.job, [] { return std::string("there is no such task"); });
    if (!known) return;

    releases_.before(event);
    decisions_.before(event);
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
    context_.expect(about_worker ? Rule::Worker : Rule::Life, problem == nullptr, event.task, event.job,
                    [&] { return std::string(to_string(event.kind)) + ": " + problem; });
  }

  void end_of_instant() {
    releases_.end_of_instant();
    decisions_.end_of_instant();
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

  const trace::Trace &trace_;
  CheckReport report_;
  Replay replay_;
  CheckContext context_;
  ReleaseRules releases_;
  DispatchRules decisions_;
  OverloadRules overload_;
  StartRules starts_;
  std::vector<Counts> counts_;
  Time time_ = std::numeric_limits<Time>::min();
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

CheckReport check_trace(const trace::Trace &trace, const RuleSet &rules) { return Checker(trace, rules).run(); }

}  // namespace redag::metrics
