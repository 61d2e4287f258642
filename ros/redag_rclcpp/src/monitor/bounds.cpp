// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "bounds.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "redag_analysis/analyze/analyze.hpp"

namespace redag_rclcpp {

using redag::JobEvent;
using redag::Task;
using redag::Workload;

namespace {

std::string name_of(const redag::Dag &dag, const Task &task) { return dag.name + "." + task.name; }

// The mutually exclusive group in which ROS executes the task's callback; "": none.
std::string group_of(const Workload &learned, const std::string &name) {
  for (const redag::Dag &dag : learned.dags) {
    for (const Task &task : dag.tasks) {
      if (name_of(dag, task) == name) return task.group;
    }
  }
  return {};
}

}  // namespace

bool Bounds::update(const std::vector<CallbackStats> &stats, const redag::sched::Config &config,
                    const std::function<Workload()> &learned) {
  std::vector<std::string> now;
  for (const CallbackStats &callback : stats) {
    if (callback.dag.empty()) continue;
    now.push_back(callback.task + " " + to_string(callback.id) + fmt::format(" waits {}", callback.waits));
  }
  std::sort(now.begin(), now.end());
  if (now.empty() || now == analysed_) return false;
  analysed_ = std::move(now);

  const std::map<std::string, TaskBound> before = std::exchange(bounds_, {});
  watch_ = {};
  absent_.clear();
  Workload workload;
  if (as_executed(stats, learned(), config.workers, workload)) analyse(workload, config);
  for (auto &[name, bound] : bounds_) {
    // Keeps the counts of a task whose bound is the same as before.
    const auto same = before.find(name);
    if (same == before.end() || same->second.response != bound.response) continue;
    bound.exceeded = same->second.exceeded;
    bound.worst = same->second.worst;
  }
  return true;
}

bool Bounds::as_executed(const std::vector<CallbackStats> &stats, const Workload &learned, std::uint32_t workers,
                         Workload &result) {
  result = workload_;
  for (redag::Dag &dag : result.dags) {
    for (Task &task : dag.tasks) {
      const std::string name = name_of(dag, task);
      if (task.wcet == 0) absent_ = fmt::format("{} has no wcet", name);
      const auto is_it = [&](const CallbackStats &callback) { return callback.task == name && !callback.dag.empty(); };
      const auto callbacks = std::count_if(stats.begin(), stats.end(), is_it);
      if (callbacks > 1)
        absent_ =
            fmt::format("task {} has {} callbacks, but the analysis needs one callback per task", name, callbacks);
      if (callbacks == 1) {
        const CallbackStats &callback = *std::find_if(stats.begin(), stats.end(), is_it);
        const redag::Duration period = callback.id.period;
        if (period > 0 && task.activation == redag::Activation::Timer && period != task.period) {
          absent_ = fmt::format("the timer of {} has a period of {}, but the workload states {}", name,
                                redag::format_duration(period), redag::format_duration(task.period));
        }
        if (callback.waits > task.waits.size()) {
          absent_ = fmt::format("a job of {} waited {} times (co_await), but the segments of its task have {} waits",
                                name, callback.waits, task.waits.size());
        }
        task.group = group_of(learned, name);
        task.concurrency = workers;  // of a reentrant group
      }
      if (!absent_.empty()) return false;
      // Where edges are not executed, the timer alone releases its callback.
      if (task.activation == redag::Activation::Timer && dag.edges == redag::Edges::Seen) task.predecessors.clear();
      task.offset = 0;
      task.overrun = redag::Overrun::Skip;
      if (!task.group.empty()) task.concurrency = 1;
    }
    redag::inherit_periods(dag);
  }
  return true;
}

void Bounds::analyse(const Workload &workload, const redag::sched::Config &config) {
  machine_.reset();
  if (calibration_) {
    const redag::Result<redag::Overheads> machine =
        calibration_->of(config.preemption == redag::sched::Preemption::Full);
    if (!machine) {
      absent_ = machine.error().front().message;
      return;
    }
    machine_ = *machine;
  }
  const auto executed = redag::analysis::as_executed(workload, config, machine_ ? to_string(*machine_) : "");
  const auto task_set = redag::analysis::compile(executed->workload, executed->platform);
  if (!task_set) {
    absent_ = to_string(task_set.error());
    return;
  }
  // The bounds with two criticalities let HI mode begin at once. Here it waits for a preemption point or the job's end.
  if (task_set->has_modes) {
    absent_ = task_set->not_analysable;
    return;
  }
  const redag::analysis::Report report = redag::analysis::analyze(*task_set);
  std::vector<std::string> without;
  for (const redag::TaskRef &ref : redag::flatten(workload)) {
    const std::string name = name_of(workload.dags[ref.dag.value], *ref.task);
    const redag::analysis::Tightest &tightest = report.tasks[ref.id.value];
    if (tightest.response) {
      bounds_[name] = TaskBound{*tightest.response, std::string(tightest.method->name), 0, 0};
    } else {
      without.push_back(name);
    }
  }
  if (without.empty()) return;
  absent_ = bounds_.empty() && task_set->is_beyond_all()
                ? task_set->not_analysable
                : fmt::format("no sound bound for {}", fmt::join(without, ", "));
}

void Bounds::count(std::span<const JobEvent> events, const std::function<std::string(redag::TaskId)> &name_of,
                   const std::function<void(const std::string &, const TaskBound &)> &first) {
  if (bounds_.empty()) return;
  const auto bound_of = [&](redag::TaskId task) {
    const auto bound = bounds_.find(name_of(task));
    return bound == bounds_.end() ? redag::Duration{0} : bound->second.response;
  };
  watch_.add(events, bound_of, [&](redag::TaskId task, const redag::metrics::BoundCount &count) {
    const std::string name = name_of(task);
    TaskBound &bound = bounds_[name];
    bound.worst = std::max(bound.worst, count.worst);
    if (++bound.exceeded == 1) first(name, bound);
  });
}

}  // namespace redag_rclcpp
