// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What the parts of the trace checker share: the state that they look at, and the report. Internal to metrics/.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "redag/derived/demand.hpp"
#include "redag/trace/trace.hpp"
#include "redag_analysis/metrics/check/check_report.hpp"
#include "redag_analysis/metrics/replay.hpp"

namespace redag::metrics {

class CheckContext {
 public:
  /// `run` is the run as the cluster saw it; `ids` has its tasks' ids in the whole workload.
  CheckContext(const trace::RunInfo &run, const std::vector<TaskId> &ids, const Replay &state, const RuleSet &rules,
               CheckReport &out)
      : info(run), replay(state), ids_(ids), rules_(rules), report_(out) {}

  const trace::RunInfo &info;
  const Replay &replay;

  /// Sets the checker's position in the trace.
  void at(std::size_t event, Time time) {
    event_ = event;
    time_ = time;
  }
  [[nodiscard]] Time now() const { return time_; }

  /// Counts one test of `rule`, and reports a violation unless `holds`. `explain` returns a string, and is called only
  /// for a violation.
  template <class Explain>
  void expect(Rule rule, bool holds, TaskId task, std::uint32_t number, Explain explain) {
    if (!rules_.contains(rule)) return;
    if (info.settled && time_ <= *info.settled && follows_from_rates(rule)) {
      ++report_.not_judged;
      return;
    }
    ++report_.checks_by_rule[static_cast<std::size_t>(rule)];
    if (!holds) report(rule, job_name(task, number), explain());
  }

  /// The simulated execution time of a job.
  [[nodiscard]] Duration demand_of(TaskId task, std::uint32_t number) const {
    return execution_time(replay.task(task), ids_[task.value], number, info.seed);
  }

  /// The simulated length of a wait.
  [[nodiscard]] Duration wait_of(TaskId task, std::uint32_t number, std::size_t wait) const {
    return wait_time(replay.task(task), ids_[task.value], number, wait, info.seed);
  }

  [[nodiscard]] std::string job_name(TaskId task, std::uint32_t number) const {
    return trace::task_name(info.workload, task) + "#" + std::to_string(number);
  }

 private:
  void report(Rule rule, std::string job, std::string text) {
    ++report_.violation_count;
    ++report_.violations_by_rule[static_cast<std::size_t>(rule)];
    if (report_.violations.size() >= CheckReport::kMaxKept) return;
    report_.violations.push_back(Violation{rule, time_, event_, std::move(job), std::move(text)});
  }

  const std::vector<TaskId> &ids_;
  RuleSet rules_;
  CheckReport &report_;
  std::size_t event_ = 0;
  Time time_ = 0;
};

}  // namespace redag::metrics
