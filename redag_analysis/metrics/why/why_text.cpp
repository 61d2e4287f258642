// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/why/why_text.hpp"

#include <fmt/format.h>

#include "redag/base/text.hpp"
#include "redag/trace/trace.hpp"
#include "redag_analysis/text/words.hpp"

namespace redag::metrics {
namespace {

// Returns " (10 Hz)", or an empty text for a task without a period.
std::string rate_of(const Workload &workload, TaskId task) {
  const std::vector<TaskRef> refs = flatten(workload);
  if (task.value >= refs.size() || refs[task.value].task->period == 0) return {};
  return fmt::format(" ({:.4g} Hz)", static_cast<double>(kSecond) / static_cast<double>(refs[task.value].task->period));
}

const Task *task_of(const Workload &workload, TaskId task) {
  const std::vector<TaskRef> refs = flatten(workload);
  return task.value < refs.size() ? refs[task.value].task : nullptr;
}

// `by` is the culprit with its rate, `own` the job that did not end, with its name only if it is not the explained one.
std::string words(Cause cause, const std::string &by) {
  switch (cause) {
    case Cause::ReleaseLate: return "its timer fired late";
    case Cause::HandOver: return "the executor had not passed its data on yet";
    case Cause::Sampling: return "its data waited for its next release";
    case Cause::Unreleased: return "was not released yet";
    case Cause::Predecessor:
      return by.empty() ? "waited for data of its predecessors" : fmt::format("waited for predecessor {}", by);
    case Cause::OwnTask: return fmt::format("waited for an earlier job of its task, {}", by);
    case Cause::MaxActive: return fmt::format("max_active used by {}", by);
    case Cause::Group: return fmt::format("group held by {}", by);
    case Cause::NoThread: return fmt::format("no thread was free; {} held one", by);
    case Cause::Queued: return fmt::format("queued behind {}", by);
    case Cause::Blocked: return fmt::format("blocked by {}, less urgent", by);
    case Cause::Demoted: return fmt::format("demoted, behind {}", by);
    case Cause::Wakeup: return "its thread woke up late";
    case Cause::Execution: return "executed";
    case Cause::Overrun: return "executed beyond its wcet";
    case Cause::Overhead: return "simulated overheads";
    case Cause::Preempted: return fmt::format("preempted; {} ran", by);
    case Cause::DeviceQueue: return "its device served " + (by.empty() ? "another cluster" : by);
    case Cause::Waited: return "waited without a worker, as the workload says";
    case Cause::OffProcessor: return "stood still: its body waited, or another program ran";
    case Cause::OnWorker: return "had a worker; its processor time is not known";
    case Cause::Threw: return "its body threw an exception";
    case Cause::BudgetUsed: return "its budget was used up";
    case Cause::QueueFull: return "its queue was full";
    case Cause::PendingFull: return "its DAG had max_pending jobs waiting";
    case Cause::Degraded: return "its DAG was degraded in HI mode";
    case Cause::Removed: return "its task was removed";
    case Cause::Unknown: break;
  }
  return "unknown";
}

// True for a cause that the named task has in itself.
bool is_of_named(Cause cause) {
  switch (cause) {
    case Cause::Unreleased:
    case Cause::Execution:
    case Cause::Overrun:
    case Cause::Overhead:
    case Cause::OffProcessor:
    case Cause::OnWorker:
    case Cause::Wakeup:
    case Cause::Threw:
    case Cause::BudgetUsed:
    case Cause::QueueFull:
    case Cause::PendingFull:
    case Cause::Degraded:
    case Cause::Removed: return true;
    default: return false;
  }
}

}  // namespace

std::string name_of(const Culprit &culprit, const Workload &workload) {
  return culprit.task.valid() ? trace::task_name(workload, culprit.task) : std::string();
}

std::string job_name(const Workload &workload, const JobId &job) {
  return fmt::format("{}#{}", trace::task_name(workload, job.task), job.number);
}

std::string describe(const Part &part, const Workload &workload, const JobId &explained) {
  const std::string by = part.by.valid() ? job_name(workload, part.by) + rate_of(workload, part.by.task) : "";
  std::string text = words(part.cause, by);
  if (part.cause == Cause::Overrun) {
    if (const Task *task = task_of(workload, part.job.task)) {
      text += fmt::format(" of {}", format_duration(task->wcet));
    }
  }
  const bool names_it = part.cause == Cause::Predecessor && part.by == part.job;
  if (part.job == explained || names_it) return text;
  return fmt::format("{}: {}", job_name(workload, part.job), text);
}

std::string describe(const PartRow &row, const Workload &workload, const JobId &explained) {
  if (row.parts.size() == 1) return describe(row.parts.front(), workload, explained);
  const Culprit main = culprits_of(row.parts).front();
  return fmt::format("{} shorter parts, mainly {} ({})", format_count(row.parts.size()), describe(main, workload),
                     humanize_duration(main.time));
}

std::string describe(Cause cause, const std::string &name) {
  const std::string text = words(cause, name);
  return is_of_named(cause) && !name.empty() ? name + ": " + text : text;
}

std::string describe(const Culprit &culprit, const Workload &workload) {
  return describe(culprit.cause, name_of(culprit, workload));
}

std::string describe(const MainCause &main, const Workload &workload) {
  constexpr std::size_t kMostNamed = 3;
  std::vector<std::string> names;
  for (const Culprit &one : main.culprits) {
    std::string name = name_of(one, workload);
    if (name.empty()) return describe(main.culprits.front().cause, {});
    if (main.culprits.size() > 1) name += fmt::format(" ({})", format_count(one.main));
    names.push_back(std::move(name));
  }
  return describe(main.culprits.front().cause, join_first(std::move(names), kMostNamed));
}

std::string headline(const Explanation &explanation, const Workload &workload) {
  const JobRecord &job = explanation.job;
  const std::string name = job_name(workload, {job.task, job.number});
  if (job.outcome == JobOutcome::Skipped || job.outcome == JobOutcome::Aborted) {
    return fmt::format("{} was {} ({}) {} after its release", name, to_string(job.outcome), to_string(job.reason),
                       humanize_duration(explanation.end - job.release));
  }
  const char *progress = job.outcome == JobOutcome::InFlight ? ", still in flight at the end of the run" : "";
  if (explanation.deadline == 0) {
    return fmt::format("{} answered {} after its data began{}", name, humanize_duration(explanation.length()),
                       progress);
  }
  const Duration late = explanation.lateness();
  const std::string deadline = fmt::format("{} deadline of {}", explanation.end_to_end ? "the end-to-end" : "its",
                                           humanize_duration(explanation.deadline));
  if (late > 0) return fmt::format("{} missed {} by {}{}", name, deadline, humanize_duration(late), progress);
  return fmt::format("{} met {} with {} to spare{}", name, deadline, humanize_duration(-late), progress);
}

}  // namespace redag::metrics
