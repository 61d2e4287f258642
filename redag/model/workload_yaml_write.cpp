// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>

#include <fmt/format.h>
#include <yaml-cpp/emitter.h>
#include <yaml-cpp/emittermanip.h>

#include "redag/base/check.hpp"
#include "redag/model/validate.hpp"
#include "redag/model/workload_yaml.hpp"

namespace redag {
namespace {

using Kind = ExecutionTime::Kind;

void write(YAML::Emitter &out, Field field, const std::string &value) {
  out << YAML::Key << to_string(field) << YAML::Value << value;
}

void write_count(YAML::Emitter &out, Field field, std::uint32_t value) {
  out << YAML::Key << to_string(field) << YAML::Value << value;
}

void write_duration(YAML::Emitter &out, Field field, Duration value) {
  if (value != 0) write(out, field, format_duration(value));
}

/// Returns the period that all timer tasks share, to be stated once for the DAG; 0: they share none.
Duration common_period(const Dag &dag) {
  Duration common = 0;
  for (const Task &task : dag.tasks) {
    if (task.activation == Activation::Data) continue;
    if (common != 0 && task.period != common) return 0;
    common = task.period;
  }
  return common;
}

void write_execution(YAML::Emitter &out, const Task &task) {
  const ExecutionTime &model = task.execution;
  const Kind implied = task.bcet == 0 ? Kind::Constant : Kind::Uniform;
  if (model.kind == implied) return;
  out << YAML::Key << to_string(Field::Execution) << YAML::Value;
  switch (model.kind) {
    case Kind::Constant: out << "constant"; return;
    case Kind::Uniform: out << "uniform"; return;
    case Kind::Normal:
      out << YAML::BeginMap << YAML::Key << "normal" << YAML::Value << YAML::BeginMap;
      out << YAML::Key << "mean" << YAML::Value << format_duration(model.mean);
      out << YAML::Key << "stddev" << YAML::Value << format_duration(model.stddev);
      out << YAML::EndMap << YAML::EndMap;
      return;
    case Kind::Empirical:
      out << YAML::BeginMap << YAML::Key << "empirical" << YAML::Value << YAML::BeginSeq;
      for (const Duration sample : model.samples) out << format_duration(sample);
      out << YAML::EndSeq << YAML::EndMap;
      return;
  }
}

void write_edges(YAML::Emitter &out, const Dag &dag, const Task &task) {
  if (task.predecessors.empty()) return;
  out << YAML::Key << to_string(Field::After) << YAML::Value << YAML::BeginSeq;
  for (const std::uint32_t p : task.predecessors) {
    REDAG_CHECK(p < dag.tasks.size(), "to_yaml() needs a valid workload");
    out << dag.tasks[p].name;
  }
  out << YAML::EndSeq;
}

void write_overrun(YAML::Emitter &out, const Task &task) {
  if (task.overrun == Overrun::Skip) return;
  out << YAML::Key << to_string(Field::Overrun) << YAML::Value << YAML::BeginMap;
  out << YAML::Key << "queue" << YAML::Value << task.queue_depth << YAML::EndMap;
}

// Writes a factor as the shortest text that reads back the same.
void write_degrade(YAML::Emitter &out, const Degrade &degrade) {
  if (degrade == Degrade{}) return;
  out << YAML::Key << to_string(Field::Degrade) << YAML::Value << YAML::Flow << YAML::BeginMap;
  if (degrade.kind == Degrade::Kind::Skip) {
    out << YAML::Key << "skip" << YAML::Value << degrade.skip;
  } else {
    out << YAML::Key << "stretch" << YAML::Value << fmt::format("{}", degrade.stretch);
  }
  out << YAML::EndMap;
}

void write_callback(YAML::Emitter &out, const Callback &callback) {
  out << YAML::Key << to_string(Field::Callback) << YAML::Value << YAML::BeginMap;
  out << YAML::Key << "node" << YAML::Value << callback.node;
  out << YAML::Key << to_string(callback.kind) << YAML::Value;
  if (!callback.name.empty()) {
    out << callback.name;
  } else if (callback.index) {
    out << YAML::BeginMap;
    write_duration(out, Field::Period, callback.period);
    out << YAML::Key << "index" << YAML::Value << *callback.index << YAML::EndMap;
  } else {
    out << (callback.period == 0 ? "any" : format_duration(callback.period));
  }
  out << YAML::EndMap;
}

void write_task(YAML::Emitter &out, const Dag &dag, const Task &task, Duration dag_period) {
  const bool has_timer = task.callback && task.callback->period != 0;
  const Duration implied_period = has_timer ? task.callback->period : dag_period;
  out << YAML::Flow << YAML::BeginMap;
  write(out, Field::Name, task.name);
  write_duration(out, Field::Wcet, task.wcet);
  write_duration(out, Field::WcetLow, task.wcet_low);
  write_duration(out, Field::Bcet, task.bcet);
  write_execution(out, task);
  if (task.activation == Activation::Data) {
    write(out, Field::Activation, to_string(task.activation));
  } else if (task.period != implied_period) {
    write_duration(out, Field::Period, task.period);
  }
  if (task.deadline != task.period) write_duration(out, Field::Deadline, task.deadline);
  write_duration(out, Field::Offset, task.offset);
  write_duration(out, Field::Jitter, task.jitter);
  write_duration(out, Field::Region, task.region);
  write_duration(out, Field::Budget, task.budget);
  if (task.on_budget != OnBudget::Abort) write(out, Field::OnBudget, to_string(task.on_budget));
  if (task.criticality != dag.criticality) write(out, Field::Criticality, to_string(task.criticality));
  write_edges(out, dag, task);
  if (task.concurrency != 1) write_count(out, Field::Concurrency, task.concurrency);
  if (!task.group.empty()) write(out, Field::Group, task.group);
  write_overrun(out, task);
  if (task.priority) out << YAML::Key << to_string(Field::Priority) << YAML::Value << *task.priority;
  if (task.callback) write_callback(out, *task.callback);
  out << YAML::EndMap;
}

void write_dag(YAML::Emitter &out, const Dag &dag) {
  const Duration period = common_period(dag);
  out << YAML::BeginMap;
  write(out, Field::Name, dag.name);
  write_duration(out, Field::Period, period);
  write_duration(out, Field::Deadline, dag.deadline);
  if (dag.max_active != 0) write_count(out, Field::MaxActive, dag.max_active);
  if (dag.max_pending != 0) write_count(out, Field::MaxPending, dag.max_pending);
  if (dag.criticality != Criticality::Normal) write(out, Field::Criticality, to_string(dag.criticality));
  write_degrade(out, dag.degrade);
  out << YAML::Key << to_string(Field::Tasks) << YAML::Value << YAML::BeginSeq;
  for (const Task &task : dag.tasks) write_task(out, dag, task, period);
  out << YAML::EndSeq << YAML::EndMap;
}

}  // namespace

std::string to_yaml(const Workload &workload) {
  YAML::Emitter out;
  out << YAML::BeginMap;
  if (!workload.name.empty()) write(out, Field::Name, workload.name);
  out << YAML::Key << to_string(Field::Platform) << YAML::Value << YAML::Flow << YAML::BeginMap;
  out << YAML::Key << to_string(Field::Workers) << YAML::Value << workload.platform.workers;
  write(out, Field::Preemption, to_string(workload.platform.preemption));
  out << YAML::EndMap;
  write(out, Field::Policy, to_string(workload.policy));
  if (workload.ties != Ties::Share) write(out, Field::Ties, to_string(workload.ties));
  out << YAML::Key << to_string(Field::Dags) << YAML::Value << YAML::BeginSeq;
  for (const Dag &dag : workload.dags) write_dag(out, dag);
  out << YAML::EndSeq << YAML::EndMap;
  REDAG_CHECK(out.good(), "the emitter is driven by this file alone");
  return std::string(out.c_str(), out.size()) + "\n";
}

Result<void> save_workload(const Workload &workload, const std::filesystem::path &path, ValidateOptions options) {
  Diagnostics mistakes = validate(workload, options);
  if (has_errors(mistakes)) return tl::unexpected<Diagnostics>(std::move(mistakes));
  errno = 0;
  std::ofstream stream(path, std::ios::binary | std::ios::trunc);
  if (stream) stream << to_yaml(workload) << std::flush;
  if (stream) return {};
  Diagnostic why{Severity::Error, path.string(), 0, 0, fmt::format("cannot write: {}", std::strerror(errno)), {}};
  return tl::unexpected<Diagnostics>(Diagnostics{std::move(why)});
}

}  // namespace redag
