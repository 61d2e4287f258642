// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/why/why_remedy.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "redag_analysis/executors/executors.hpp"
#include "redag_analysis/metrics/why/why_text.hpp"

namespace redag::metrics {
namespace {

// What a remedy depends on. As it stands: of any run.
struct Setting {
  std::string x = "X";  // the culprit, or several of them
  bool is_several = false;
  bool is_simulated = false;
  std::string other_executor;  // empty: ours, which has priorities
  std::string preemption = "none";
  Duration points = 0;  // the time between the culprit's preemption points; 0: it has none
  std::string dag;      // of the culprit
  std::uint32_t max_active = 0;
  std::uint32_t max_pending = 0;
  std::uint32_t queue_depth = 0;
  Duration budget = 0;
};

// The value that a remedy changes; nothing where there is none.
std::string now(std::uint32_t value) { return value == 0 ? "" : fmt::format(" (now {})", value); }
std::string now(Duration value) { return value == 0 ? "" : fmt::format(" (now {})", humanize_duration(value)); }

std::string give_way(const Setting &at) {
  const char *it = at.is_several ? "them" : "it";
  if (at.preemption == "os" || at.preemption == "full") return fmt::format("shorten {}, or add a worker", at.x);
  if (at.preemption == "cooperative") {
    return fmt::format("give {} more preemption points, use preemption: os, shorten {}, or add a worker", at.x, it);
  }
  const std::string points =
      at.points > 0 ? fmt::format("cooperative, with the points that it has every {}", humanize_duration(at.points))
                    : std::string("cooperative with preemption points");
  return fmt::format("let {} give way (preemption: os, or {}), shorten {}, or add a worker", at.x, points, it);
}

std::string advice(Cause cause, const Setting &at) {
  const std::string &x = at.x;
  const char *its = at.is_several ? "their" : "its";
  const std::string of_dag = at.dag.empty() ? "of the DAG" : "of " + at.dag;
  constexpr const char *kMachine = "look at the machine: redag doctor";
  switch (cause) {
    case Cause::ReleaseLate:
      return at.is_simulated ? "reduce the jitter of the timer, or lengthen the deadline" : kMachine;
    case Cause::HandOver:
    case Cause::Wakeup: return kMachine;
    case Cause::Sampling: return "let the data start the callback (activation: data), or shorten its period";
    case Cause::Unreleased: return fmt::format("release {} earlier (offset), or more often (period)", x);
    case Cause::Predecessor: return fmt::format("shorten {}, or release it earlier (offset)", x);
    case Cause::OwnTask:
      return fmt::format("shorten {}, lengthen {} period, or let {} jobs overlap (concurrency)", x, its, its);
    case Cause::MaxActive:
      return fmt::format("raise max_active {}{}, or remove it; redag tune finds a value", of_dag, now(at.max_active));
    case Cause::Group: return fmt::format("shorten {}, or give it a group of its own", x);
    case Cause::NoThread: return fmt::format("shorten {}, or give the executor more threads (threads)", x);
    case Cause::Queued:
      if (!at.other_executor.empty()) {
        return fmt::format("{} has no priorities: use redag, which runs urgent callbacks first, or add a worker",
                           at.other_executor);
      }
      return fmt::format("shorten {}, lengthen {} period, or add a worker; redag analyze shows whether that suffices",
                         x, its);
    case Cause::Blocked: return give_way(at);
    case Cause::Demoted: return "raise the budget of the demoted callback, or shorten the callback";
    case Cause::Execution: return fmt::format("shorten {}, or lengthen {} deadline", x, its);
    case Cause::Overrun:
      return fmt::format("the wcet of {} is too small: measure it, correct it in the workload, and analyze again", x);
    case Cause::Overhead: return fmt::format("let {} do more in fewer jobs, or use a faster machine", x);
    case Cause::Preempted: return fmt::format("shorten {}, lengthen {} period, or add a worker", x, its);
    case Cause::DeviceQueue:
      return fmt::format("shorten what the device does for {}, or add a slot", x.empty() ? "another cluster" : x);
    case Cause::Waited: return "shorten the wait, or lengthen the deadline";
    case Cause::OffProcessor:
    case Cause::Unknown:
      return "see which other program or wait took the processor: perf sched record -k CLOCK_MONOTONIC, or trace-cmd";
    case Cause::OnWorker:
      return fmt::format("shorten {}, or see what it did: perf sched record -k CLOCK_MONOTONIC, or trace-cmd", x);
    case Cause::Threw: return fmt::format("mend the exception in {}", x);
    case Cause::BudgetUsed:
      return fmt::format("raise the budget of {}{}, or shorten {}", x, now(at.budget), at.is_several ? "them" : "it");
    case Cause::QueueFull:
      return fmt::format("shorten {}, lengthen {} period, or raise {} queue_depth{}", x, its, its, now(at.queue_depth));
    case Cause::PendingFull:
      return fmt::format("shorten {}, lengthen {} period, or raise max_pending {}{}", x, its, of_dag,
                         now(at.max_pending));
    case Cause::Degraded:
      return fmt::format("raise the wcet_low that was exceeded, or degrade {} less (degrade: skip or stretch)",
                         at.dag.empty() ? "the DAG" : at.dag);
    case Cause::Removed: break;
  }
  return {};
}

Setting setting_of(const MainCause &main, const trace::RunInfo &run) {
  const Culprit &first = main.culprits.front();
  Setting at;
  at.is_several = main.culprits.size() > 1;
  at.x = !at.is_several ? name_of(first, run.workload) : "these callbacks";
  at.is_simulated = run.driver == trace::Driver::Simulator;
  at.preemption = run.preemption;
  const executors::ExecutorKind *kind = executors::find_executor(run.executor);
  if (kind != nullptr && !kind->ours) at.other_executor = run.executor;
  const std::vector<TaskRef> refs = flatten(run.workload);
  if (first.task.value >= refs.size()) return at;
  const TaskRef &ref = refs[first.task.value];
  const Dag &dag = run.workload.dags[ref.dag.value];
  at.dag = dag.name;
  at.max_active = dag.max_active;
  at.max_pending = dag.max_pending;
  at.queue_depth = ref.task->queue_depth;
  at.budget = ref.task->budget;
  if (!at.is_several) at.points = ref.task->region;
  return at;
}

// For example "camera.detect delayed control.imu by up to 5ms"; empty if that says nothing.
std::string fact(const Culprit &culprit, const trace::RunInfo &run) {
  if (culprit.longest <= 0 || !culprit.delayed.valid()) return {};
  const std::string by = name_of(culprit, run.workload);
  const std::string delayed = trace::task_name(run.workload, culprit.delayed);
  const std::string length = humanize_duration(culprit.longest);
  if (culprit.cause == Cause::Overrun) {
    return fmt::format("{} executed for up to {} more than its wcet of {}", by, length,
                       humanize_duration(flatten(run.workload)[culprit.task.value].task->wcet));
  }
  if (is_work(culprit.cause) && by == delayed) return fmt::format("{} takes {}", by, length);
  if (by.empty() || by == delayed) return fmt::format("{} was delayed by up to {}", delayed, length);
  return fmt::format("{} delayed {} by up to {}", by, delayed, length);
}

}  // namespace

std::string remedy(const MainCause &main, const trace::RunInfo &run) {
  const Culprit &worst = *std::max_element(main.culprits.begin(), main.culprits.end(),
                                           [](const Culprit &a, const Culprit &b) { return a.longest < b.longest; });
  const std::string change = advice(worst.cause, setting_of(main, run));
  const std::string first = fact(worst, run);
  return first.empty() || change.empty() ? change : first + ": " + change;
}

std::string remedy(const Culprit &culprit, const trace::RunInfo &run) {
  return remedy(MainCause{culprit.main, {culprit}}, run);
}

std::string remedy(Cause cause) { return advice(cause, {}); }

}  // namespace redag::metrics
