// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/loader/validate.hpp"

#include <algorithm>
#include <array>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <unordered_map>
#include <utility>

#include <fmt/format.h>

#include "redag/base/text.hpp"
#include "redag/derived/clusters.hpp"
#include "redag/loader/callback_match.hpp"
#include "redag/loader/fields.hpp"
#include "redag/loader/validate_parts.hpp"

namespace redag {
namespace {

constexpr std::array<const char *, kFieldCount> kKeys = [] {
  std::array<const char *, kFieldCount> keys{};
  const auto add = [&](const auto &row) { keys[static_cast<std::size_t>(row.field)] = row.key; };
  fields::for_each(std::tuple_cat(fields::kWorkload, fields::kPlatform, fields::kCluster, fields::kDevice, fields::kDag,
                                  fields::kTask),
                   add);
  return keys;
}();
static_assert(std::find(kKeys.begin(), kKeys.end(), nullptr) == kKeys.end(), "each Field has a row");

/// Walks through one workload and applies every rule, with the place of its findings.
class Checker {
 public:
  Checker(const Workload &workload, ValidateOptions options) : workload_(workload), options_(options) {}

  std::vector<Finding> run() {
    if (!workload_.name.empty()) check_name(workload_.name, "workload");
    check_platform(workload_.platform, findings_);
    check_policy();
    if (workload_.dags.empty()) {
      findings_.error(Field::Dags, Field::Dags, "the workload has no DAGs", "add one under 'dags:'");
    }
    check_dag_names();
    for (std::size_t d = 0; d < workload_.dags.size(); ++d) check_dag(DagId(d));
    findings_.at(DagId::none());
    check_load(workload_, findings_);
    return findings_.take();
  }

 private:
  void check_policy() {
    const PolicyKind policy = workload_.policy;
    if (workload_.platform.preemption == PreemptionMode::Os && !is_static(policy)) {
      findings_.error(Field::Preemption, Field::Policy,
                      fmt::format("preemption 'os' needs a static policy, and '{}' is not one", to_string(policy)),
                      "use cooperative or none, or another policy");
    }
    const auto has_priority = [](const TaskRef &ref) { return ref.task->priority.has_value(); };
    const std::vector<TaskRef> tasks = flatten(workload_);
    if (policy == PolicyKind::Fixed && std::none_of(tasks.begin(), tasks.end(), has_priority)) {
      findings_.warning(Field::Policy, Field::Priority, "policy is 'fixed', but no task has a priority",
                        "give tasks a 'priority', or choose another policy");
    }
  }

  // Groups exclude jobs within one scheduler, and each cluster has its own.
  void check_group_in_cluster(DagId id, const Task &task) {
    if (task.group.empty() || workload_.platform.clusters.empty()) return;
    const auto [first, is_first] = groups_.emplace(task.group, id);
    const Dag &dag = workload_.dags[id.value];
    const Dag &other = workload_.dags[first->second.value];
    const auto cluster = cluster_of(workload_.platform, dag);
    const auto of_other = cluster_of(workload_.platform, other);
    if (is_first || !cluster || !of_other || *cluster == *of_other) return;
    findings_.error(Field::Group, Field::Cluster | Field::Clusters,
                    fmt::format("group '{}' spans two clusters: DAG '{}' is in '{}', and DAG '{}' is in '{}'",
                                task.group, other.name, other.cluster, dag.name, dag.cluster),
                    "put these DAGs into one cluster, or use two groups; a list of groups joins them under one name");
  }

  void check_name(const std::string &name, std::string_view what) {
    if (name.empty()) {
      findings_.error(Field::Name, {}, fmt::format("a {} has no name", what), "add 'name:'");
    } else if (const std::string why = name_mistake(name); !why.empty()) {
      findings_.error(Field::Name, {}, fmt::format("the name {} of a {} {}", in_quotes(name), what, why));
    }
  }

  void check_dag_names() {
    std::unordered_map<std::string_view, std::size_t> seen;
    for (std::size_t d = 0; d < workload_.dags.size(); ++d) {
      findings_.at(DagId(d));
      const std::string &name = workload_.dags[d].name;
      check_name(name, "DAG");
      if (!name.empty() && !seen.emplace(name, d).second) {
        findings_.error(Field::Name, {}, fmt::format("the name '{}' is used by another DAG", name),
                        "choose a unique name for each DAG");
      }
    }
    findings_.at(DagId::none());
  }

  void check_dag(DagId id) {
    findings_.at(id);
    const Dag &dag = workload_.dags[id.value];
    check_numbers(dag, fields::kDag, fmt::format(" of DAG '{}'", dag.name), [&](Field field, std::string mistake) {
      const bool is_bound = field == Field::MaxActive || field == Field::MaxPending;
      findings_.error(field, {}, std::move(mistake), is_bound ? "leave it out if there is no bound" : "");
    });
    check_degrade(dag);
    check_cluster_of(workload_.platform, dag, findings_);
    if (dag.tasks.empty()) findings_.error(Field::Tasks, {}, fmt::format("DAG '{}' has no tasks", dag.name));
    std::unordered_map<std::string_view, std::size_t> seen;
    seen.reserve(dag.tasks.size());
    bool sound_edges = true;
    for (std::uint32_t i = 0; i < dag.tasks.size(); ++i) {
      findings_.at(id, i);
      const Task &task = dag.tasks[i];
      check_name(task.name, "task");
      if (!task.name.empty() && !seen.emplace(task.name, i).second) {
        findings_.error(Field::Name, {},
                        fmt::format("the name '{}' is used by another task of DAG '{}'", task.name, dag.name),
                        "choose a unique name for each task of a DAG");
      }
      check_joined_name(id, task);
      check_durations(task);
      check_wcet_low(dag, task);
      check_execution(task);
      check_activation(task);
      check_phase(dag, task);
      check_options(task);
      check_group_in_cluster(id, task);
      check_callback(task);
      check_waits(workload_, task, options_.waits, findings_);
      sound_edges = check_edges(dag, i, findings_) && sound_edges;
    }
    check_graph(dag, id, sound_edges, findings_);
  }

  // Options, links and results name a task as DAG.TASK. Only a dot within a name can make two of these equal.
  void check_joined_name(DagId id, const Task &task) {
    const std::string &dag = workload_.dags[id.value].name;
    if (dag.find('.') == std::string::npos && task.name.find('.') == std::string::npos) return;
    const auto [first, is_first] = joined_names_.emplace(dag + '.' + task.name, id);
    if (is_first || first->second == id) return;  // two equal names in one DAG are another mistake
    const std::string &other = workload_.dags[first->second.value].name;
    if (other == dag) return;
    findings_.error(Field::Name, {},
                    fmt::format("task '{}' of DAG '{}' and task '{}' of DAG '{}' are both '{}'", task.name, dag,
                                first->first.substr(other.size() + 1), other, first->first),
                    "rename one of them: results and options name a task by its DAG, a dot, and its name");
  }

  void check_durations(const Task &task) {
    check_numbers(task, fields::kTask, fmt::format(" of task '{}'", task.name), [&](Field field, std::string mistake) {
      if (field == Field::Wcet && task.wcet == 0 && options_.wcet_optional && task.callback) return;
      // check_inherited_periods() checks the period of a data task.
      if (field == Field::Period && task.activation == Activation::Data) return;
      // A deadline that was copied from a bad period is not a second mistake.
      const bool is_deadline = field == Field::Deadline;
      if (is_deadline && task.period <= 0 && task.deadline == task.period) return;
      std::string hint;
      if (field == Field::Period && task.period == 0) {
        mistake = fmt::format("timer task '{}' has no period", task.name);
        hint = "add 'period:' to it or to its DAG, or use 'activation: data'";
      }
      findings_.error(field, is_deadline ? FieldSet(Field::Period) : FieldSet(), std::move(mistake), std::move(hint));
    });
    check_against_wcet(task);
  }

  void check_against_wcet(const Task &task) {
    const auto wcet = [&task] { return format_duration(task.wcet); };
    if (task.wcet > 0 && task.bcet > task.wcet) {
      findings_.error(
          Field::Bcet, Field::Wcet,
          fmt::format("bcet {} of task '{}' exceeds its wcet {}", format_duration(task.bcet), task.name, wcet()));
    }
    if (task.deadline > 0 && task.wcet > task.deadline) {
      findings_.warning(Field::Wcet, Field::Deadline | Field::Period,
                        fmt::format("wcet {} of task '{}' exceeds its deadline {}", wcet(), task.name,
                                    format_duration(task.deadline)),
                        "a job that runs for its wcet misses its deadline");
    } else if (task.period > 0 && task.wcet > task.period) {
      findings_.warning(
          Field::Wcet, Field::Period,
          fmt::format("wcet {} of task '{}' exceeds its period {}", wcet(), task.name, format_duration(task.period)));
    }
    if (task.budget > 0 && task.budget < task.wcet && task.on_budget != OnBudget::Log) {
      findings_.warning(
          Field::Budget, Field::Wcet | Field::OnBudget,
          fmt::format("budget {} of task '{}' is below its wcet {}", format_duration(task.budget), task.name, wcet()),
          task.on_budget == OnBudget::Abort ? "jobs that keep within their wcet are cut off"
                                            : "the action of 'on_budget' affects jobs that keep within their wcet");
    }
    if (task.on_budget != OnBudget::Abort && task.budget == 0) {
      findings_.error(Field::OnBudget, Field::Budget,
                      fmt::format("task '{}' has 'on_budget: {}', but no budget", task.name, to_string(task.on_budget)),
                      "add 'budget:', the processor time after which that action happens");
    }
  }

  // C(LO) and its effects (docs/model.md, "Criticality").
  void check_wcet_low(const Dag &dag, const Task &task) {
    if (task.wcet_low <= 0) return;
    if (dag.criticality != Criticality::High) {
      findings_.error(
          Field::WcetLow, Field::Criticality,
          fmt::format("task '{}' has a wcet_low, but DAG '{}' is not of high criticality", task.name, dag.name),
          "add 'criticality: high' to the DAG, or remove 'wcet_low:'");
    }
    if (task.wcet > 0 && task.wcet_low > task.wcet) {
      findings_.error(Field::WcetLow, Field::Wcet,
                      fmt::format("wcet_low {} of task '{}' exceeds its wcet {}", format_duration(task.wcet_low),
                                  task.name, format_duration(task.wcet)),
                      "wcet is C(HI), an upper bound on every execution; wcet_low is C(LO), which holds in LO mode");
    }
  }

  void check_degrade(const Dag &dag) {
    const Degrade &degrade = dag.degrade;
    if (dag.criticality == Criticality::High && degrade != Degrade{}) {
      findings_.error(Field::Degrade, Field::Criticality,
                      fmt::format("DAG '{}' of high criticality is never degraded", dag.name), "remove 'degrade:'");
    }
    if (degrade.kind == Degrade::Kind::Skip && (degrade.skip < 1 || degrade.skip > kMaxDegrade)) {
      findings_.error(
          Field::Degrade, {},
          fmt::format("skip of DAG '{}' must be from 1 to {}, not {}", dag.name, kMaxDegrade, degrade.skip));
    }
    if (degrade.kind == Degrade::Kind::Stretch && !(degrade.stretch >= 1 && degrade.stretch <= kMaxDegrade)) {
      findings_.error(
          Field::Degrade, {},
          fmt::format("stretch of DAG '{}' must be from 1 to {}, not {}", dag.name, kMaxDegrade, degrade.stretch),
          "stretch is the factor by which periods grow in HI mode");
    }
  }

  void check_execution(const Task &task) {
    using Kind = ExecutionTime::Kind;
    const ExecutionTime &model = task.execution;
    const FieldSet bounds = Field::Wcet | Field::Bcet;
    if (model.kind == Kind::Normal) {
      if (model.mean < task.bcet || model.mean > task.wcet || model.mean <= 0) {
        findings_.error(Field::Execution, bounds,
                        fmt::format("mean {} of task '{}' is not between its bcet and its wcet",
                                    format_duration(model.mean), task.name));
      }
      if (model.stddev < 0 || model.stddev > kMaxDuration) {
        findings_.error(Field::Execution, {},
                        fmt::format("stddev of task '{}' must be from 0 to {}, not {}", task.name, kMaxDurationText,
                                    format_duration(model.stddev)));
      }
    }
    if (model.kind != Kind::Empirical) return;
    if (model.samples.empty()) {
      findings_.error(Field::Execution, {}, fmt::format("task '{}' has no execution-time samples", task.name));
    }
    for (std::size_t i = 0; i < model.samples.size(); ++i) {
      const Duration sample = model.samples[i];
      if (sample > 0 && sample >= task.bcet && sample <= task.wcet) continue;
      findings_.error(Field::Execution, bounds,
                      fmt::format("sample {} of task '{}' is not between its bcet and its wcet",
                                  format_duration(sample), task.name),
                      "", i);
    }
  }

  // Nothing can wait, job by job, for a source that nothing synchronises with it.
  void check_phase(const Dag &dag, const Task &task) {
    const bool is_event = task.phase == Phase::Event;
    const char *has = !task.predecessors.empty()            ? "predecessors"
                      : task.activation == Activation::Data ? "'activation: data'"
                      : task.offset != 0                    ? "an offset"
                                                            : nullptr;
    if (task.phase != Phase::Common && has != nullptr) {
      findings_.error(
          is_event ? Field::Activation : Field::Offset, FieldSet(Field::Activation) | Field::After | Field::Offset,
          fmt::format("task '{}' is released {}, and has {}", task.name, is_event ? "by events" : "at any offset", has),
          is_event ? "remove it, or use 'activation: timer' or data" : "state its offset");
    }
    if (task.activation != Activation::Timer) return;
    for (std::uint32_t k = 0; k < task.predecessors.size(); ++k) {
      if (task.predecessors[k] >= dag.tasks.size()) continue;
      const Task &from = dag.tasks[task.predecessors[k]];
      if (from.phase == Phase::Common || from.period != task.period || from.offset != task.offset) continue;
      findings_.error(Field::After, FieldSet(Field::Period) | Field::Offset | Field::Activation,
                      fmt::format("timer task '{}' waits for jobs of '{}' that are released at the same instants, but "
                                  "nothing synchronises the two",
                                  task.name, from.name),
                      "use 'activation: data'", k);
    }
  }

  void check_activation(const Task &task) {
    if (task.activation == Activation::Timer) return;
    if (task.predecessors.empty()) {
      findings_.error(Field::Activation, Field::After, fmt::format("data task '{}' has no predecessor", task.name),
                      "name predecessors with 'after:', or use 'activation: timer'");
    }
    for (const auto &[field, value] : {std::pair{Field::Offset, task.offset}, std::pair{Field::Jitter, task.jitter}}) {
      if (value == 0) continue;
      findings_.error(field, Field::Activation, fmt::format("data task '{}' has '{}'", task.name, to_string(field)),
                      fmt::format("add 'activation: timer', or remove '{}:', because predecessors release a data task",
                                  to_string(field)));
    }
  }

  void check_options(const Task &task) {
    if (const std::string why = name_mistake(task.group); !task.group.empty() && !why.empty()) {
      findings_.error(Field::Group, {}, fmt::format("group {} of task '{}' {}", in_quotes(task.group), task.name, why));
    }
    if (task.overrun == Overrun::Queue && (task.queue_depth < 1 || task.queue_depth > kMaxQueueDepth)) {
      findings_.error(Field::Overrun, {},
                      fmt::format("queue depth of task '{}' must be from 1 to {}, not {}", task.name, kMaxQueueDepth,
                                  task.queue_depth));
    }
    if (task.concurrency > 1 && task.concurrency <= kMaxConcurrency && !task.group.empty()) {
      findings_.error(
          Field::Concurrency, Field::Group,
          fmt::format("task '{}' has concurrency {}, but is in group '{}'", task.name, task.concurrency, task.group),
          "jobs of one group never overlap: remove 'concurrency' or 'group'");
    }
    if (task.priority && workload_.policy != PolicyKind::Fixed) {
      findings_.warning(
          Field::Priority, Field::Policy,
          fmt::format("policy '{}' ignores the priority of task '{}'", to_string(workload_.policy), task.name),
          "use 'policy: fixed', or remove the priority");
    }
  }

  void check_callback(const Task &task) {
    if (!task.callback) return;
    const Callback &callback = *task.callback;
    const char *kind = to_string(callback.kind);
    const bool is_timer = callback.kind == Callback::Kind::Timer;
    const bool is_counted = is_timer || callback.kind == Callback::Kind::Waitable;
    const auto refuse = [&](std::uint32_t item, std::string message, std::string hint = {}) {
      findings_.error(Field::Callback, {}, std::move(message), std::move(hint), item);
    };
    check_callback_name(task, callback.node, "node", kCallbackNode);
    if (!is_counted) {
      check_callback_name(task, callback.name, kind, kCallbackKind);
    } else if (!callback.name.empty()) {
      refuse(kCallbackKind, fmt::format("the {} of task '{}' cannot have a name", kind, task.name));
    }
    if (callback.period < 0 || callback.period > kMaxDuration || (!is_timer && callback.period != 0)) {
      refuse(kCallbackKind, fmt::format("the {} of task '{}' cannot have period {}", kind, task.name,
                                        format_duration(callback.period)));
    } else if (callback.period != 0 && task.activation == Activation::Timer && callback.period != task.period) {
      findings_.warning(Field::Period, Field::Callback,
                        fmt::format("period {} of task '{}' differs from the period of its timer, {}",
                                    format_duration(task.period), task.name, format_duration(callback.period)),
                        "use the timer's period, because the priority follows from it");
    }
    if (!is_counted && callback.index) {
      refuse(kCallbackKind, fmt::format("the {} of task '{}' cannot have an index", kind, task.name));
    }
    if (is_timer && task.activation == Activation::Data) {
      findings_.error(Field::Callback, Field::Activation,
                      fmt::format("data task '{}' has a timer as its callback", task.name),
                      "predecessors release it: name the callback that takes their data, or use 'activation: timer'",
                      kCallbackKind);
    }
    const auto [other, is_first] = callbacks_.emplace(to_string(callback), task.name);
    if (!is_first) {
      findings_.warning(Field::Callback, {},
                        fmt::format("task '{}' names the same callback as task '{}'", task.name, other->second),
                        "only the first of them in the file is used");
    }
  }

  void check_callback_name(const Task &task, const std::string &name, const char *what, std::uint32_t item) {
    const std::string why = ros_name_mistake(name);
    if (why.empty()) return;
    findings_.error(Field::Callback, {},
                    fmt::format("{} '{}' of the callback of task '{}' {}", what, name, task.name, why),
                    "write full names as 'ros2 node info' prints them; * and ? match any characters", item);
  }

  const Workload &workload_;
  ValidateOptions options_;
  FindingList findings_;
  std::unordered_map<std::string_view, DagId> groups_;           // group -> DAG that uses it first
  std::unordered_map<std::string, DagId> joined_names_;          // DAG.TASK -> the first DAG
  std::unordered_map<std::string, std::string_view> callbacks_;  // text of a callback -> task that names it first
};

}  // namespace

std::string name_mistake(std::string_view name) {
  if (name.empty()) return "is empty";
  if (name.size() > kMaxNameBytes)
    return fmt::format("has {} bytes; at most {} are allowed", name.size(), kMaxNameBytes);
  if (name.front() == ' ' || name.back() == ' ') return "begins or ends with a space";
  const std::string character = find_unprintable(name);
  return character.empty() ? std::string() : fmt::format("contains {}, which cannot be displayed", character);
}

const char *to_string(Field field) { return kKeys[static_cast<std::size_t>(field)]; }

std::vector<Finding> find_mistakes(const Workload &workload, ValidateOptions options) {
  return Checker(workload, options).run();
}

Diagnostics validate(const Workload &workload, ValidateOptions options) {
  Diagnostics diagnostics;
  for (Finding &finding : find_mistakes(workload, options)) {
    diagnostics.push_back(Diagnostic{finding.severity, {}, 0, 0, std::move(finding.message), std::move(finding.hint)});
  }
  return diagnostics;
}

bool has_errors(const Diagnostics &diagnostics) {
  return std::any_of(diagnostics.begin(), diagnostics.end(),
                     [](const Diagnostic &diagnostic) { return diagnostic.severity == Severity::Error; });
}

Result<ValidWorkload> validated(Workload workload) {
  Diagnostics findings = validate(workload, {.wcet_optional = true, .waits = true});
  if (has_errors(findings)) return tl::unexpected(std::move(findings));
  return ValidWorkload(std::move(workload));
}

}  // namespace redag
