// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/dag_mistakes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "redag/base/text.hpp"
#include "redag/loader/validate.hpp"

namespace redag::runtime {
namespace {

constexpr Duration kLeastPeriod = kMicrosecond;  // of a timer; releases of shorter ones would be all that a thread does

/// Names what to change to mend a mistake in a field.
struct Remedy {
  Field field;
  const char *text;
};

constexpr std::array kDagRemedies = {
    Remedy{Field::Name, "change the argument of DagBuilder"},
    Remedy{Field::Tasks, "add tasks with timer() and data()"},
    Remedy{Field::MaxActive, "change DagOptions::max_active; 0 means no bound"},
    Remedy{Field::MaxPending, "change DagOptions::max_pending; 0 means no bound"},
    Remedy{Field::Criticality, "DagOptions::criticality"},
    Remedy{Field::Deadline, "change DagOptions::deadline; 0 means none"},
    Remedy{Field::Degrade, "change DagOptions::degrade"},
};

constexpr std::array kTaskRemedies = {
    Remedy{Field::Name, "change the first argument"},
    Remedy{Field::Wcet, "change TaskOptions::wcet; 0 means unknown"},
    Remedy{Field::Bcet, "change TaskOptions::bcet; 0 means unknown"},
    Remedy{Field::WcetLow, "change TaskOptions::wcet_low, or set DagOptions::criticality to Criticality::High"},
    Remedy{Field::Jitter, "change TaskOptions::jitter, which only timer() uses"},
    Remedy{Field::Region, "change TaskOptions::region; 0 means the whole job"},
    Remedy{Field::OnBudget, "TaskOptions::on_budget"},
    Remedy{Field::Concurrency, "change TaskOptions::concurrency; with a group it is 1"},
    Remedy{Field::Execution, "change TaskOptions::execution; it needs a wcet"},
    Remedy{Field::Deadline, "change TaskOptions::deadline; 0 means the period"},
    Remedy{Field::Offset, "change TaskOptions::offset, which only timer() uses"},
    Remedy{Field::Budget, "change TaskOptions::budget; 0 means none"},
    Remedy{Field::Activation, "name predecessors in the second argument of data(), or use timer()"},
    Remedy{Field::Overrun, "TaskOptions::queue_depth"},
    Remedy{Field::Priority, "TaskOptions::priority"},
    Remedy{Field::Group, "change TaskOptions::group; empty means none"},
};

std::string text_in_quotes(std::string_view text) {
  std::string name = in_quotes(text);
  name.front() = name.back() = '"';
  return name;
}

// The member of DagBuilder that made a task.
const char *call_of(const Task &task) {
  return task.phase == Phase::Event ? kEventActivation : to_string(task.activation);
}

std::string remedy_for(const Finding &finding, const Task *task) {
  if (task != nullptr && finding.field == Field::After) {
    return task->activation == Activation::Data ? "change the second argument of data()"
                                                : "change TaskOptions::after, or use data()";
  }
  if (task != nullptr && finding.field == Field::Period) {
    return fmt::format("change the second argument of {}()", call_of(*task));
  }
  const auto find = [&](const auto &remedies) -> std::string {
    const auto *const found = std::find_if(remedies.begin(), remedies.end(),
                                           [&](const Remedy &remedy) { return remedy.field == finding.field; });
    return found == remedies.end() ? finding.hint : found->text;
  };
  return task != nullptr ? find(kTaskRemedies) : find(kDagRemedies);
}

std::string describe(const Finding &finding, const Dag &dag) {
  const Task *task = finding.task == Finding::kNone ? nullptr : &dag.tasks[finding.task];
  std::string message = finding.message;
  // In a file a period of 0 means that it is absent. Here the caller passed it.
  if (task != nullptr && finding.field == Field::Period && task->period == 0)
    message = task->phase == Phase::Event ? "the minimum interval must be greater than 0"
                                          : "the period must be greater than 0";
  const std::string place = task == nullptr ? place_of(dag.name) : place_of(dag.name, call_of(*task), task->name);
  const std::string remedy = remedy_for(finding, task);
  return printable(fmt::format("{}: {}{}", place, message, remedy.empty() ? "" : " (" + remedy + ")"));
}

}  // namespace

std::string place_of(std::string_view dag) { return fmt::format("DagBuilder({})", text_in_quotes(dag)); }

std::string place_of(std::string_view dag, std::string_view call, std::string_view task) {
  return fmt::format("{}.{}({})", place_of(dag), call, text_in_quotes(task));
}

std::string mistakes_of(const Dag &dag, PolicyKind policy) {
  Workload alone;
  alone.platform = Platform{1, PreemptionMode::None};
  alone.policy = policy;
  alone.dags = {dag};
  for (Task &task : alone.dags[0].tasks) {
    if (task.wcet == 0) task.wcet = std::max({Duration{1}, task.bcet, task.wcet_low});  // may be unknown here
  }
  std::string text;
  const auto add = [&](const std::string &mistake) { text += (text.empty() ? "" : "\n") + mistake; };
  for (const Finding &finding : find_mistakes(alone)) {
    if (finding.severity == Severity::Error) add(describe(finding, dag));
  }
  for (const Task &task : dag.tasks) {
    if (task.activation == Activation::Timer && task.phase != Phase::Event && task.period > 0 &&
        task.period < kLeastPeriod) {
      add(fmt::format("{}: no thread can release jobs every {} (the period of a timer is at least {})",
                      place_of(dag.name, call_of(task), task.name), format_duration(task.period),
                      format_duration(kLeastPeriod)));
    }
    if (task.overrun == Overrun::Queue || task.queue_depth == 1) continue;
    add(place_of(dag.name, call_of(task), task.name) +
        ": TaskOptions::queue_depth has no effect without a queue (set TaskOptions::overrun to Overrun::Queue)");
  }
  return text;
}

}  // namespace redag::runtime
