// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/search/analysed.hpp"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "redag/base/nearest.hpp"
#include "redag/sched/policy.hpp"
#include "redag_analysis/many_workers/global.hpp"

namespace redag::lab {
namespace {

using analysis::Method;
using analysis::MethodReport;
using analysis::NotApplicable;

// Returns a trusted test that accepts all tasks at once, or null.
const analysis::Method *accepting_test(const Analysed &analysed) {
  for (const analysis::MethodReport &method : analysed.report.methods) {
    const analysis::Bound *bound = method.bound();
    if (method.trusted && bound != nullptr && bound->accepts == true) return method.method;
  }
  return nullptr;
}

// If a more urgent task prevents this bound, returns the most urgent task without a bound and its reason.
std::string culprit_of(const Analysed &analysed, const analysis::Bound &bound, const analysis::ResponseBound &asked) {
  if (asked.absent != analysis::global::kMoreUrgent && asked.absent != analysis::global::kPeer) return {};
  for (const std::uint32_t t : analysed.task_set.by_rank) {
    const std::string_view absent = bound.tasks[t].absent;
    if (absent.empty() || absent == analysis::global::kMoreUrgent || absent == analysis::global::kPeer) continue;
    return fmt::format(" ({}: {})", task_name(analysed, TaskId(t)), absent);
  }
  return {};
}

// Returns the first reason that a trusted method states for the missing bound.
std::string why_no_bound(const Analysed &analysed, std::size_t index, bool is_dag) {
  if (analysed.task_set.is_beyond_all()) return analysed.task_set.not_analysable;
  for (const analysis::MethodReport &method : analysed.report.methods) {
    const analysis::Bound *bound = method.bound();
    if (!method.trusted || bound == nullptr) continue;
    const auto &bounds = is_dag ? bound->dags : bound->tasks;
    if (index < bounds.size() && !bounds[index].absent.empty()) {
      return fmt::format("{}: {}{}", method.method->name, bounds[index].absent,
                         culprit_of(analysed, *bound, bounds[index]));
    }
  }
  for (const analysis::MethodReport &method : analysed.report.methods) {
    if (!method.gave_up() || method.method->subject == analysis::Subject::TaskSet) continue;
    return fmt::format("gave up on {}: {}", method.method->name,
                       std::get<analysis::NotApplicable>(method.outcome).reason);
  }
  return "no method covers it that shows that each job ends";
}

void judge(const Analysed &analysed, Row &row, std::size_t index, bool is_dag) {
  row.says = row.tightest.method;
  const bool can_lose = row.tightest.bound.of_ended;
  if (row.tightest.response && row.due && !can_lose) row.slack = *row.due - *row.tightest.response;
  if (!row.tightest.response) row.reason = why_no_bound(analysed, index, is_dag);
  const analysis::Method *test = accepting_test(analysed);
  const bool is_met = row.slack.value_or(-1) >= 0;
  if (!is_met && row.due && test != nullptr) {
    // A yes-or-no test can accept where the bounds are too coarse. A bound above the deadline is then dropped.
    row.tightest = {};
    row.slack.reset();
    row.reason = fmt::format("{} accepts the workload as a whole and gives no response times", test->name);
    row.says = test;
    row.standing = Standing::Ok;
  } else if (!row.tightest.response) {
    row.standing = row.due || test == nullptr ? Standing::NoBound : Standing::NoDeadline;
  } else if (can_lose) {
    const std::string &refusal = analysed.task_set.tasks[index].refusal;
    row.standing = Standing::MayLose;
    row.reason = refusal.empty() ? why_no_bound(analysed, index, is_dag) : refusal;
  } else if (!row.due) {
    row.standing = Standing::NoDeadline;
  } else {
    row.standing = is_met ? Standing::Ok : Standing::MayMiss;
  }
}

// Keeps the methods with these names. Error: an unknown name.
std::optional<Diagnostics> keep_only(const std::vector<std::string> &only, std::vector<analysis::Method> &methods) {
  if (only.empty()) return std::nullopt;
  std::vector<std::string> names;
  names.reserve(methods.size());
  for (const analysis::Method &method : methods) names.emplace_back(method.name);
  for (const std::string &name : only) {
    if (std::find(names.begin(), names.end(), name) != names.end()) continue;
    return make_error("--method: there is no method '" + name + "'", suggestion(name, names)).value();
  }
  std::erase_if(methods, [&](const analysis::Method &method) {
    return std::find(only.begin(), only.end(), method.name) == only.end();
  });
  return std::nullopt;
}

}  // namespace

Result<Analysed> analyse(const Workload &workload, const analysis::AnalysisPlatform &platform,
                         const std::string &executor, const analysis::AnalyzeOptions &limits,
                         const std::vector<std::string> &only) {
  const executors::ExecutorKind *kind = executors::find_executor(executor);
  if (kind == nullptr) return make_error("there is no analysis for the executor '" + executor + "'");
  Result<analysis::TaskSet> task_set = analysis::compile_for(*kind, workload, platform);
  if (!task_set) return tl::unexpected<Diagnostics>(task_set.error());
  std::vector<analysis::Method> methods = analysis::methods_of(*kind);
  if (auto missing = keep_only(only, methods)) return tl::unexpected<Diagnostics>(*std::move(missing));
  analysis::AnalyzeOptions options = limits;
  options.itemise = task_set->tasks.size() <= kMostItemised;
  analysis::Report report = analysis::analyze(*task_set, std::move(methods), options);
  return Analysed{workload, kind, *std::move(task_set), std::move(report)};
}

Result<std::vector<AnalysedPart>> analyse_parts(const Workload &workload, const analysis::AnalysisPlatform &platform,
                                                const std::string &executor, const analysis::AnalyzeOptions &limits,
                                                const std::vector<std::string> &only) {
  std::vector<AnalysedPart> all;
  for (ClusterPart &part : parts_of(workload)) {
    if (part.is_cluster() && part.dags.empty()) continue;
    Result<Analysed> analysed = analyse(part.workload, analysis::platform_of(platform, part), executor, limits, only);
    if (!analysed) return tl::unexpected<Diagnostics>(std::move(analysed.error()));
    all.push_back(AnalysedPart{std::move(part), *std::move(analysed)});
  }
  return all;
}

bool is_schedulable(const std::vector<AnalysedPart> &parts) {
  return std::all_of(parts.begin(), parts.end(), [](const AnalysedPart &part) {
    return part.analysed.report.verdict == analysis::Verdict::Schedulable;
  });
}

std::vector<analysis::Term> terms_of(const Analysed &analysed, const Row &row) {
  if (!row.tightest.bound.terms.empty()) return row.tightest.bound.terms;
  if (row.task.valid()) return itemised(analysed.task_set, row.tightest, row.task).terms;
  return itemised(analysed.task_set, row.tightest, row.dag).terms;
}

std::string task_name(const Analysed &analysed, TaskId task) { return analysed.task_set.tasks[task.value].name; }
std::string device_name(const Analysed &analysed, DeviceId device) {
  return analysed.task_set.devices[device.value].name;
}

std::vector<Row> task_rows(const Analysed &analysed) {
  std::vector<Row> rows;
  for (std::size_t t = 0; t < analysed.task_set.tasks.size(); ++t) {
    const analysis::CompiledTask &task = analysed.task_set.tasks[t];
    Row row;
    row.name = task_name(analysed, TaskId(t));
    row.task = TaskId(t);
    row.deadline = task.deadline;
    row.due = std::min(task.deadline, task.limit);
    row.tightest = analysed.report.tasks[t];
    judge(analysed, row, t, false);
    rows.push_back(std::move(row));
  }
  return rows;
}

std::vector<Row> dag_rows(const Analysed &analysed) {
  std::vector<Row> rows;
  for (std::size_t d = 0; d < analysed.task_set.dags.size(); ++d) {
    Row row;
    row.name = analysed.task_set.dags[d].name;
    row.dag = DagId(d);
    row.deadline = analysed.task_set.dags[d].deadline;
    if (row.deadline > 0) row.due = row.deadline;
    row.tightest = analysed.report.dags[d];
    judge(analysed, row, d, true);
    rows.push_back(std::move(row));
  }
  return rows;
}

// Returns the row with the least slack for its deadline. Rows without a bound precede all others, the most urgent
// first.
std::optional<Row> weakest_row(const Analysed &analysed) {
  std::optional<Row> weakest;
  std::pair<bool, double> least;  // has a bound, then the slack's share or the rank
  const auto consider = [&](Row row, double rank) {
    if (!row.due || (row.standing == Standing::Ok && !row.slack)) return;
    const std::pair<bool, double> key = {
        row.slack.has_value(), row.slack ? static_cast<double>(*row.slack) / static_cast<double>(*row.due) : rank};
    if (weakest && key >= least) return;
    least = key;
    weakest = std::move(row);
  };
  const std::vector<Row> tasks = task_rows(analysed);
  for (std::size_t t = 0; t < tasks.size(); ++t) {
    const analysis::CompiledTask &task = analysed.task_set.tasks[t];
    // A foreign thread has its period for a deadline. That it is met says little; that it is not shows an overload.
    const bool is_foreign = analysed.workload.dags[task.dag.value].is_foreign;
    if (!is_foreign || tasks[t].standing != Standing::Ok) consider(tasks[t], task.rank);
  }
  for (Row &row : dag_rows(analysed)) consider(std::move(row), static_cast<double>(tasks.size()));
  return weakest;
}

namespace {

// True if the task follows the other in its DAG, directly or not.
bool is_after(const analysis::TaskSet &task_set, std::uint32_t task, std::uint32_t other) {
  std::vector<std::uint32_t> after = task_set.tasks[other].successors;
  for (std::size_t i = 0; i < after.size(); ++i) {
    if (after[i] == task) return true;
    for (const std::uint32_t next : task_set.tasks[after[i]].successors) {
      if (std::find(after.begin(), after.end(), next) == after.end()) after.push_back(next);
    }
  }
  return false;
}

// True if nothing of the task can run before the row's task ends, except as blocking, which is among the terms.
bool is_below(const analysis::TaskSet &task_set, std::uint32_t task, const Row &row) {
  if (task_set.mode != sched::Preemption::Full || !is_static(task_set.policy)) return false;
  const DagId dag = row.task.valid() ? task_set.tasks[row.task.value].dag : row.dag;
  std::uint32_t last = 0;
  for (const analysis::CompiledTask &own : task_set.tasks) {
    if (own.dag == dag) last = std::max(last, own.tier);
  }
  return task_set.tasks[task].tier > last;
}

}  // namespace

std::vector<TaskId> suspects_of(const Analysed &analysed, const Row &row) {
  const analysis::TaskSet &task_set = analysed.task_set;
  std::vector<TaskId> suspects;
  const auto add = [&](std::uint32_t t) {
    if (row.task.valid() && is_after(task_set, t, row.task.value)) return;
    if (std::find(suspects.begin(), suspects.end(), TaskId(t)) == suspects.end()) suspects.emplace_back(t);
  };
  std::vector<analysis::Term> terms;
  if (row.tightest.response) terms = terms_of(analysed, row);
  std::stable_sort(terms.begin(), terms.end(), [](const auto &a, const auto &b) { return a.amount > b.amount; });
  for (const analysis::Term &term : terms) {
    if (term.task.valid()) add(term.task.value);
  }
  for (const analysis::CompiledDag &dag : task_set.dags) {
    if (row.name != dag.name && row.name.rfind(dag.name + ".", 0) != 0) continue;
    for (const std::uint32_t t : dag.tasks) add(t);
  }
  std::vector<std::uint32_t> others = task_set.by_rank;
  const auto load = [&](std::uint32_t t) {
    const analysis::CompiledTask &task = task_set.tasks[t];
    return static_cast<double>(task.wcet - task.waits) / static_cast<double>(task.period);
  };
  std::stable_sort(others.begin(), others.end(), [&](auto a, auto b) { return load(a) > load(b); });
  for (const std::uint32_t t : others) {
    if (!is_below(task_set, t, row)) add(t);
  }
  return suspects;
}

}  // namespace redag::lab
