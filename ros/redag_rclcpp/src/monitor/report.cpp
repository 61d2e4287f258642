// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "redag/base/time.hpp"
#include "redag_analysis/metrics/assumptions.hpp"
#include "redag_analysis/text/words.hpp"

namespace redag_rclcpp {

using diagnostic_msgs::msg::DiagnosticStatus;
using diagnostic_msgs::msg::KeyValue;
using redag::format_duration;
using redag::humanize_duration;

namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kMostNames = 3;  // in a line of the log

Json distribution(redag::Duration p50, redag::Duration p99, redag::Duration max) {
  return Json{{"p50_ns", p50}, {"p99_ns", p99}, {"max_ns", max}};
}

Json task_json(const TaskFigures &task) {
  const CallbackStats &stats = task.stats;
  Json json{{"task", stats.task},
            {"dag", stats.dag.empty() ? Json() : Json(stats.dag)},
            {"callback", to_string(stats.id)},
            {"period_ns", stats.period},
            {"deadline_ns", stats.deadline},
            {"deadline_assumed", !task.has_deadline},
            {"wcet_ns", stats.wcet > 0 ? Json(stats.wcet) : Json()},
            {"released", stats.jobs.released},
            {"finished", stats.jobs.finished},
            {"skipped", stats.jobs.skipped},
            {"aborted", stats.jobs.aborted},
            {"deferred", stats.jobs.deferred},
            {"misses", stats.misses},
            {"response", distribution(stats.response_p50, stats.response_p99, stats.response_max)},
            {"execution", distribution(stats.execution_p50, stats.execution_p99, stats.execution_max)},
            {"bound", nullptr}};
  if (task.bound) {
    json["bound"] = Json{{"response_ns", task.bound->response},
                         {"method", task.bound->method},
                         {"exceeded", task.bound->exceeded},
                         {"worst_ns", task.bound->exceeded > 0 ? Json(task.bound->worst) : Json()}};
  }
  return json;
}

Json deadlock_json(const Deadlock &deadlock) {
  return Json{{"waiting", deadlock.waiting},
              {"blocked", deadlock.blocked},
              {"resource", deadlock.resource},
              {"text", deadlock.text},
              {"certain", deadlock.certain},
              {"begun_ns", deadlock.begun},
              {"ended_ns", deadlock.ended == redag::kNever ? Json() : Json(deadlock.ended)}};
}

KeyValue pair(std::string key, std::string value) {
  KeyValue pair;
  pair.key = std::move(key);
  pair.value = std::move(value);
  return pair;
}

void warn(DiagnosticStatus &status, const std::string &text) {
  status.level = DiagnosticStatus::WARN;
  if (!status.message.empty()) status.message += "; ";
  status.message += text;
}

// Drops the DAG or node: "ekf" for "control.ekf"; "timer 2 ms (0)" for "/imu timer 2 ms (0)".
std::string short_name(const CallbackStats &stats) {
  const std::string &prefix = stats.dag.empty() ? stats.id.node : stats.dag;
  const bool has_prefix = stats.task.size() > prefix.size() && stats.task.compare(0, prefix.size(), prefix) == 0;
  return has_prefix ? stats.task.substr(prefix.size() + 1) : stats.task;
}

DiagnosticStatus executor_status(const Snapshot &snapshot) {
  DiagnosticStatus status;
  status.name = "ReDAG: executor";
  status.message = fmt::format("{} workers, preemption {}", snapshot.workers, to_string(snapshot.mode.mode));
  status.level = DiagnosticStatus::OK;
  status.values.push_back(pair("preemption", to_string(snapshot.mode.mode)));
  status.values.push_back(pair("why", snapshot.mode.reason.empty() ? "asked for" : snapshot.mode.reason));
  status.values.push_back(pair("workers", std::to_string(snapshot.workers)));
  status.values.push_back(pair("policy", to_string(snapshot.policy)));
  status.values.push_back(pair("learning", snapshot.learning ? "yes" : "no"));
  if (snapshot.has_bounds) {
    status.values.push_back(pair("bounds", snapshot.bounds_absent.empty() ? "all tasks" : snapshot.bounds_absent));
  }
  for (std::size_t i = 0; i < snapshot.warnings.size(); ++i) {
    status.values.push_back(pair(fmt::format("warning {}", i + 1), snapshot.warnings[i]));
  }
  if (!snapshot.warnings.empty()) warn(status, fmt::format("{} warnings", snapshot.warnings.size()));
  std::size_t count = 0;
  bool is_locked = false;
  for (const Deadlock &deadlock : snapshot.deadlocks) {
    if (deadlock.ended != redag::kNever) continue;
    warn(status, fmt::format("{}: {} waits for {}", deadlock.certain ? "deadlock" : "possible deadlock",
                             deadlock.waiting, deadlock.blocked));
    status.values.push_back(pair(fmt::format("deadlock {}", ++count), deadlock.text));
    is_locked = is_locked || deadlock.certain;
  }
  for (const std::string &error : snapshot.errors) warn(status, error);
  if (is_locked || !snapshot.errors.empty()) status.level = DiagnosticStatus::ERROR;
  status.values.push_back(pair("deadlocks that ended", std::to_string(snapshot.deadlocks.size() - count)));
  return status;
}

// Judges by figures alone. 'redag why' judges by a trace.
std::string likely_cause(const CallbackStats &late, const Snapshot &snapshot) {
  if (late.execution_p99 > late.deadline) {
    return fmt::format("it executes for up to {}, longer than its deadline of {}: shorten it, or lengthen its period",
                       humanize_duration(late.execution_max), humanize_duration(late.deadline));
  }
  const CallbackStats *longest = nullptr;  // of the less urgent ones
  bool is_most_urgent = true;
  for (const TaskFigures &task : snapshot.tasks) {
    if (task.stats.period < late.period && task.stats.jobs.released > 0) is_most_urgent = false;
    if (task.stats.period <= late.period) continue;
    if (longest == nullptr || task.stats.execution_max > longest->execution_max) longest = &task.stats;
  }
  const bool by_rate = snapshot.policy == redag::PolicyKind::RateMonotonic;
  const bool preempts = snapshot.mode.mode == redag::PreemptionMode::Os;
  if (by_rate && !preempts && longest != nullptr && longest->execution_max > late.deadline - late.execution_p50) {
    return fmt::format(
        "it probably waits for less urgent callbacks such as {}, which executes for up to {}: preemption os, more "
        "workers, or a callback group of its own ('redag doctor' says what os needs)",
        longest->task, humanize_duration(longest->execution_max));
  }
  return std::string(by_rate && !is_most_urgent
                         ? "it probably waits for callbacks that are more urgent, or of its group"
                         : "it probably blocks, or waits for its callback group or a processor") +
         ": 'redag why' names the cause in a trace, which the parameter 'trace' records";
}

/// What breaks a promise at the end of a run.
std::vector<std::string> broken_promises(const Snapshot &snapshot) {
  std::vector<std::string> broken = snapshot.warnings;
  for (const Deadlock &deadlock : snapshot.deadlocks) {
    if (deadlock.ended == redag::kNever) broken.push_back(deadlock.text);
  }
  for (const TaskFigures &task : snapshot.tasks) {
    if (task.bound && task.bound->exceeded > 0) broken.push_back(task.stats.task + " exceeded its bound");
  }
  return broken;
}

void add_figures(DiagnosticStatus &status, const std::string &name, const TaskFigures &task) {
  const CallbackStats &stats = task.stats;
  const auto value = [&](const char *key, std::string text) {
    status.values.push_back(pair(name + " " + key, std::move(text)));
  };
  value("period", format_duration(stats.period));
  value("deadline", format_duration(stats.deadline) + (task.has_deadline ? "" : " (assumed)"));
  value("released", std::to_string(stats.jobs.released));
  value("misses", std::to_string(stats.misses));
  value("response p50", humanize_duration(stats.response_p50));
  value("response p99", humanize_duration(stats.response_p99));
  value("response max", humanize_duration(stats.response_max));
  value("execution max", humanize_duration(stats.execution_max));
  if (stats.wcet > 0) value("wcet", format_duration(stats.wcet));
  if (task.bound) value("bound", format_duration(task.bound->response));
}

}  // namespace

std::string to_json(const Snapshot &snapshot) {
  Json tasks = Json::array();
  for (const TaskFigures &task : snapshot.tasks) {
    if (task.is_shown) tasks.push_back(task_json(task));
  }
  Json deadlocks = Json::array();
  for (const Deadlock &deadlock : snapshot.deadlocks) deadlocks.push_back(deadlock_json(deadlock));
  const Json json{{"format", "redag.metrics/1"},
                  {"stamp_ns", snapshot.stamp},
                  {"preemption", to_string(snapshot.mode.mode)},
                  {"preemption_why", snapshot.mode.reason},
                  {"workers", snapshot.workers},
                  {"policy", to_string(snapshot.policy)},
                  {"learning", snapshot.learning},
                  {"warnings", snapshot.warnings},
                  {"deadlocks", deadlocks},
                  {"bounds_absent", snapshot.has_bounds ? Json(snapshot.bounds_absent) : Json("not asked for")},
                  {"tasks", tasks},
                  {"left_out", snapshot.tasks.size() - tasks.size()}};
  // Names from outside may not be UTF-8. A replaced character is better than no snapshot.
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

void show_most(Snapshot &snapshot, std::size_t most) {
  std::vector<TaskFigures *> tasks;
  for (TaskFigures &task : snapshot.tasks) tasks.push_back(&task);
  const auto troubles = [](const TaskFigures *task) {
    return task->stats.misses + (task->bound ? task->bound->exceeded : 0);
  };
  // Of equals the most urgent one, which stands first.
  std::stable_sort(tasks.begin(), tasks.end(), [&](auto *a, auto *b) { return troubles(a) > troubles(b); });
  for (std::size_t i = most; i < tasks.size(); ++i) tasks[i]->is_shown = false;
}

std::vector<std::string> closing_lines(const Snapshot &snapshot) {
  std::uint64_t released = 0;
  std::uint64_t misses = 0;
  std::size_t known = 0;
  std::vector<std::string> unknown;
  const TaskFigures *worst = nullptr;
  for (const TaskFigures &task : snapshot.tasks) {
    const CallbackStats &stats = task.stats;
    if (is_ros_internal(stats.id) || stats.jobs.released == 0) continue;
    if (!task.has_deadline) {
      if (stats.id.kind == redag::Callback::Kind::Subscription) unknown.push_back(stats.task);
      continue;
    }
    ++known;
    released += stats.jobs.released;
    misses += stats.misses;
    if (stats.misses > 0 && (worst == nullptr || stats.misses > worst->stats.misses)) worst = &task;
  }
  const std::vector<std::string> broken = broken_promises(snapshot);
  std::vector<std::string> lines;
  lines.push_back(
      fmt::format("preemption {} on {}: ", to_string(snapshot.mode.mode), redag::plural(snapshot.workers, "worker")) +
      (broken.empty() ? "all was as promised" : "not as promised: " + redag::join_first(broken, 1)));
  lines.push_back(fmt::format("rates are known of {}", redag::plural(known, "callback")) +
                  (unknown.empty() ? ""
                                   : ", but not of " + redag::join_first(unknown, kMostNames) +
                                         ": state their periods in a workload file (~/save writes one)"));
  lines.push_back(fmt::format("{} jobs with deadlines, {} missed", released, misses));
  if (worst != nullptr) {
    lines.back() += fmt::format(", most by {} ({} of {}): {}", worst->stats.task, worst->stats.misses,
                                worst->stats.jobs.released, likely_cause(worst->stats, snapshot));
  }
  return lines;
}

void drop_idle_tasks(redag::Workload &workload, const std::set<std::string> &configured) {
  for (redag::Dag &dag : workload.dags) {
    if (configured.count(dag.name) > 0) continue;
    std::vector<redag::Task> kept;
    std::map<std::uint32_t, std::uint32_t> positions;
    for (std::uint32_t i = 0; i < dag.tasks.size(); ++i) {
      if (dag.tasks[i].wcet == 0) continue;
      positions[i] = static_cast<std::uint32_t>(kept.size());
      kept.push_back(dag.tasks[i]);
    }
    for (redag::Task &task : kept) {
      std::vector<std::uint32_t> predecessors;
      for (const std::uint32_t p : task.predecessors) {
        if (const auto position = positions.find(p); position != positions.end())
          predecessors.push_back(position->second);
      }
      if (predecessors.empty()) task.activation = redag::Activation::Timer;
      task.predecessors = std::move(predecessors);
    }
    dag.tasks = std::move(kept);
  }
  auto &dags = workload.dags;
  dags.erase(std::remove_if(dags.begin(), dags.end(), [](const redag::Dag &dag) { return dag.tasks.empty(); }),
             dags.end());
}

std::vector<DiagnosticStatus> Diagnoser::diagnose(const Snapshot &snapshot) {
  std::vector<DiagnosticStatus> result{executor_status(snapshot)};
  std::map<std::string, std::size_t> positions;
  for (const TaskFigures &task : snapshot.tasks) {
    const CallbackStats &stats = task.stats;
    // Leaves out callbacks that never ran. Nodes have many of them, such as services and events of publishers.
    if (stats.dag.empty() && (stats.jobs.released == 0 || is_ros_internal(stats.id))) continue;
    const std::string name = stats.dag.empty() ? "ReDAG: node " + stats.id.node : "ReDAG: DAG " + stats.dag;
    const auto [entry, is_new] = positions.emplace(name, result.size());
    if (is_new) {
      result.emplace_back();
      result.back().name = name;
      result.back().level = DiagnosticStatus::OK;
    }
    add(result[entry->second], task, snapshot.machine);
  }
  for (DiagnosticStatus &status : result) {
    if (status.message.empty()) status.message = "no new misses";
  }
  std::map<std::string, std::uint64_t> misses;
  for (const TaskFigures &task : snapshot.tasks) misses[task.stats.task + to_string(task.stats.id)] = task.stats.misses;
  misses_ = std::move(misses);
  return result;
}

void Diagnoser::add(DiagnosticStatus &status, const TaskFigures &task, const std::optional<redag::Overheads> &machine) {
  const CallbackStats &stats = task.stats;
  const std::string name = short_name(stats);
  if (task.is_shown) add_figures(status, name, task);
  const auto last = misses_.find(stats.task + to_string(stats.id));
  const std::uint64_t before = last == misses_.end() ? 0 : last->second;
  const std::uint64_t missed = stats.misses > before ? stats.misses - before : 0;
  if (missed > 0 && task.has_deadline) warn(status, fmt::format("{} missed {} more deadlines", name, missed));
  const redag::metrics::ExecutionPercentiles executions{.jobs = stats.jobs.finished,
                                                        .p50 = stats.execution_p50,
                                                        .p99 = stats.execution_p99,
                                                        .longest = stats.execution_max};
  if (stats.wcet > 0 && redag::metrics::is_beyond_noise(executions, stats.wcet, machine)) {
    warn(status, fmt::format("{} executed for {}, but its wcet is {}", name, humanize_duration(stats.execution_max),
                             format_duration(stats.wcet)));
  }
  if (task.bound && task.bound->exceeded > 0) {
    warn(status, fmt::format("{} responses of {} exceeded the bound of {}; the longest was {}", task.bound->exceeded,
                             name, format_duration(task.bound->response), humanize_duration(task.bound->worst)));
  }
}

}  // namespace redag_rclcpp
