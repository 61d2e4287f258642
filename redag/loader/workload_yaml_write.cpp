// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <optional>

#include <fmt/format.h>

#include "redag/base/check.hpp"
#include "redag/base/cpu_list.hpp"
#include "redag/loader/hyperperiod_warning.hpp"
#include "redag/loader/text_file.hpp"
#include "redag/loader/validate.hpp"
#include "redag/loader/workload_yaml.hpp"
#include "redag/loader/yaml_writer.hpp"

namespace redag {
namespace {

using yaml::Writer;
using Kind = ExecutionTime::Kind;
using Layout = Writer::Layout;

void write(Writer &out, Field field, std::string_view value) { out.write(to_string(field), value); }

void write(Writer &out, Field field, std::uint32_t value) { out.write(to_string(field), std::uint64_t{value}); }

void write_duration(Writer &out, Field field, Duration value) {
  if (value != 0) write(out, field, format_duration(value));
}

/// Writes a period, or the rate that it was rounded from.
void write_period(Writer &out, Duration period) {
  if (const std::optional<Duration> rate = rounded_rate(period)) {
    write(out, Field::Rate, fmt::format("{}Hz", *rate));
  } else {
    write_duration(out, Field::Period, period);
  }
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

void write_execution(Writer &out, const Task &task) {
  const ExecutionTime &model = task.execution;
  const Kind implied = task.bcet == 0 ? Kind::Constant : Kind::Uniform;
  if (model.kind == implied) return;
  out.text(to_string(Field::Execution));
  switch (model.kind) {
    case Kind::Constant: out.text("constant"); return;
    case Kind::Uniform: out.text("uniform"); return;
    case Kind::Normal:
      out.begin_map();
      out.text("normal");
      out.begin_map();
      out.write("mean", format_duration(model.mean));
      out.write("stddev", format_duration(model.stddev));
      out.end_map();
      out.end_map();
      return;
    case Kind::Empirical:
      out.begin_map();
      out.text("empirical");
      out.begin_list();
      for (const Duration sample : model.samples) out.text(format_duration(sample));
      out.end_list();
      out.end_map();
      return;
  }
}

void write_edges(Writer &out, const Dag &dag, const Task &task) {
  if (task.predecessors.empty()) return;
  const bool is_list = task.predecessors.size() > 1;
  out.text(to_string(Field::After));
  if (is_list) out.begin_list();
  for (const std::uint32_t p : task.predecessors) {
    REDAG_CHECK(p < dag.tasks.size(), "to_yaml() needs a valid workload");
    out.text(dag.tasks[p].name);
  }
  if (is_list) out.end_list();
}

void write_overrun(Writer &out, const Task &task) {
  if (task.overrun == Overrun::Skip) return;
  out.text(to_string(Field::Overrun));
  out.begin_map();
  out.write("queue", task.queue_depth);
  out.end_map();
}

// Writes a factor as the shortest text that reads back the same.
void write_degrade(Writer &out, const Degrade &degrade) {
  if (degrade.kind == Degrade::Kind::Stop) return;
  out.text(to_string(Field::Degrade));
  out.begin_map(Layout::OneLine);
  if (degrade.kind == Degrade::Kind::Skip) {
    out.write("skip", degrade.skip);
  } else {
    out.write("stretch", fmt::format("{}", degrade.stretch));
  }
  out.end_map();
}

void write_segments(Writer &out, const Platform &platform, const Task &task) {
  out.text(to_string(Field::Segments));
  out.begin_list(Layout::OneLine);
  const auto write_cpu = [&out](Duration length) {
    out.begin_map(Layout::OneLine);
    out.write("cpu", format_duration(length));
    out.end_map();
  };
  Duration before = 0;
  for (const Wait &wait : task.waits) {
    write_cpu(wait.after - before);
    before = wait.after;
    out.begin_map(Layout::OneLine);
    if (wait.device.valid()) {
      REDAG_CHECK(wait.device.value < platform.devices.size(), "to_yaml() needs a valid workload");
      out.write("device", platform.devices[wait.device.value].name);
    }
    out.write(wait.device.valid() ? "for" : "wait", format_duration(wait.longest));
    if (wait.shortest != 0) out.write("at_least", format_duration(wait.shortest));
    out.end_map();
  }
  write_cpu(task.wcet - before);
  out.end_list();
}

void write_callback(Writer &out, const Callback &callback) {
  out.text(to_string(Field::Callback));
  out.begin_map();
  out.write("node", callback.node);
  out.text(to_string(callback.kind));
  if (!callback.name.empty()) {
    out.text(callback.name);
  } else if (callback.index) {
    out.begin_map();
    write_duration(out, Field::Period, callback.period);
    out.write("index", *callback.index);
    out.end_map();
  } else {
    out.text(callback.period == 0 ? "any" : format_duration(callback.period));
  }
  out.end_map();
}

void write_task(Writer &out, const Platform &platform, const Dag &dag, const Task &task, Duration dag_period) {
  const bool has_timer = task.callback && task.callback->period != 0;
  const Duration implied_period = has_timer ? task.callback->period : dag_period;
  out.begin_map(Layout::OneLine);
  write(out, Field::Name, task.name);
  if (task.waits.empty()) {
    write_duration(out, Field::Wcet, task.wcet);
  } else {
    write_segments(out, platform, task);
  }
  write_duration(out, Field::WcetLow, task.wcet_low);
  write_duration(out, Field::Bcet, task.bcet);
  write_execution(out, task);
  const bool is_data = task.activation == Activation::Data;
  const bool has_period = !is_data && task.period != implied_period;
  const bool is_timer_callback = task.callback && task.callback->kind == Callback::Kind::Timer;
  // Predecessors alone would mean a data task, which is stated too, for readers of earlier versions.
  if (is_data || (!task.predecessors.empty() && !has_period && !is_timer_callback)) {
    write(out, Field::Activation, to_string(task.activation));
  }
  if (has_period) write_period(out, task.period);
  if (task.phase == Phase::Event) write(out, Field::Activation, kEventActivation);
  if (task.deadline != task.period) write_duration(out, Field::Deadline, task.deadline);
  if (task.phase == Phase::Unknown) write(out, Field::Offset, kAnyOffset);
  write_duration(out, Field::Offset, task.offset);
  write_duration(out, Field::Jitter, task.jitter);
  write_duration(out, Field::Region, task.region);
  write_duration(out, Field::Budget, task.budget);
  if (task.on_budget != OnBudget::Abort) write(out, Field::OnBudget, to_string(task.on_budget));
  if (task.criticality != dag.criticality) write(out, Field::Criticality, to_string(task.criticality));
  write_edges(out, dag, task);
  if (task.concurrency != 1) write(out, Field::Concurrency, task.concurrency);
  if (!task.group.empty()) write(out, Field::Group, task.group);
  write_overrun(out, task);
  if (task.priority) write(out, Field::Priority, std::to_string(*task.priority));
  if (task.callback) write_callback(out, *task.callback);
  out.end_map();
}

void write_workers(Writer &out, std::uint32_t workers, const std::vector<int> &cpus) {
  write(out, Field::Workers, workers);
  if (!cpus.empty()) write(out, Field::Cpus, format_cpu_list(cpus));
}

void write_platform(Writer &out, const Platform &platform) {
  out.text(to_string(Field::Platform));
  const bool is_short = platform.clusters.empty() && platform.devices.empty();
  out.begin_map(is_short ? Layout::OneLine : Layout::Lines);
  if (platform.clusters.empty()) {
    write_workers(out, platform.workers, platform.cpus);
  } else {
    out.text(to_string(Field::Clusters));
    out.begin_list();
    for (const Cluster &cluster : platform.clusters) {
      out.begin_map(Layout::OneLine);
      write(out, Field::Name, cluster.name);
      write_workers(out, cluster.workers, cluster.cpus);
      out.end_map();
    }
    out.end_list();
  }
  write(out, Field::Preemption, to_string(platform.preemption));
  if (!platform.devices.empty()) {
    out.text(to_string(Field::Devices));
    out.begin_map();
    for (const Device &device : platform.devices) {
      out.text(device.name);
      out.begin_map(Layout::OneLine);
      out.write("slots", device.slots);
      out.write("queue", to_string(device.queue));
      out.end_map();
    }
    out.end_map();
  }
  out.end_map();
}

void write_dag(Writer &out, const Platform &platform, const Dag &dag) {
  const Duration period = common_period(dag);
  out.begin_map();
  write(out, Field::Name, dag.name);
  if (!dag.cluster.empty()) write(out, Field::Cluster, dag.cluster);
  write_period(out, period);
  write_duration(out, Field::Deadline, dag.deadline);
  if (dag.max_active != 0) write(out, Field::MaxActive, dag.max_active);
  if (dag.max_pending != 0) write(out, Field::MaxPending, dag.max_pending);
  if (dag.criticality != Criticality::Normal) write(out, Field::Criticality, to_string(dag.criticality));
  write_degrade(out, dag.degrade);
  if (dag.edges != Edges::Executed) write(out, Field::Edges, to_string(dag.edges));
  out.text(to_string(Field::Tasks));
  out.begin_list();
  for (const Task &task : dag.tasks) write_task(out, platform, dag, task, period);
  out.end_list();
  out.end_map();
}

}  // namespace

std::string to_yaml(const Workload &workload) {
  Writer out;
  out.begin_map();
  if (!workload.name.empty()) write(out, Field::Name, workload.name);
  write_platform(out, workload.platform);
  write(out, Field::Policy, to_string(workload.policy));
  if (workload.ties != Ties::Share) write(out, Field::Ties, to_string(workload.ties));
  out.text(to_string(Field::Dags));
  out.begin_list();
  for (const Dag &dag : workload.dags) write_dag(out, workload.platform, dag);
  out.end_list();
  out.end_map();
  return out.take();
}

Result<void> save_workload(const Workload &workload, const std::filesystem::path &path, ValidateOptions options) {
  Diagnostics mistakes = validate(workload, options);
  if (has_errors(mistakes)) return tl::unexpected<Diagnostics>(std::move(mistakes));
  errno = 0;
  std::ofstream stream(path, std::ios::binary | std::ios::trunc);
  if (stream) stream << to_yaml(workload) << std::flush;
  if (stream) return {};
  return file_error(path.string(), 0, fmt::format("cannot write: {}", std::strerror(errno)));
}

}  // namespace redag
