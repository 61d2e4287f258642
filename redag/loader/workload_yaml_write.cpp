// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <optional>
#include <type_traits>

#include <fmt/format.h>

#include "redag/base/check.hpp"
#include "redag/loader/cpu_list.hpp"
#include "redag/loader/fields.hpp"
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

constexpr auto kNone = [](Field) { return false; };

/// Writes a part in the order of its rows: each field as `write_own` does, which returns false for one that it does not
/// know; then by its type, if it does not have its default.
template <class Owner, class Rows, class WriteOwn>
void write_fields(Writer &out, const Owner &owner, const Rows &rows, const WriteOwn &write_own) {
  static const Owner kDefaults;
  fields::for_each(rows, [&](const auto &row) {
    if (write_own(row.field)) return;
    if constexpr (requires { fields::text_of(owner.*row.member); }) {
      const auto &value = owner.*row.member;
      if (row.rule.is_stated || value != kDefaults.*row.member) out.write(row.key, fields::text_of(value));
    }
  });
}

void write(Writer &out, Field field, std::string_view value) { out.write(to_string(field), value); }

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

void write_callback(Writer &out, const Task &task) {
  if (!task.callback) return;
  const Callback &callback = *task.callback;
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
  const bool is_data = task.activation == Activation::Data;
  const bool has_period = !is_data && task.period != implied_period;
  const bool is_timer_callback = task.callback && task.callback->kind == Callback::Kind::Timer;
  // Predecessors alone would mean a data task, which is stated too, for readers of earlier versions.
  const bool has_activation = is_data || (!task.predecessors.empty() && !has_period && !is_timer_callback);
  out.begin_map(Layout::OneLine);
  write_fields(out, task, fields::kTask, [&](Field field) {
    switch (field) {
      case Field::Wcet:  // or the segments in its place
        if (task.waits.empty()) return false;
        write_segments(out, platform, task);
        break;
      case Field::Execution: write_execution(out, task); break;
      case Field::Activation:
        if (has_activation) write(out, field, to_string(task.activation));
        if (task.phase == Phase::Event) write(out, field, kEventActivation);
        break;
      case Field::Period:
        if (has_period) write_period(out, task.period);
        break;
      case Field::Deadline: return task.deadline == task.period;
      case Field::Offset:
        if (task.phase == Phase::Unknown) write(out, field, kAnyOffset);
        return false;
      case Field::Criticality:
        if (task.criticality != dag.criticality) write(out, field, to_string(task.criticality));
        break;
      case Field::After: write_edges(out, dag, task); break;
      case Field::Overrun: write_overrun(out, task); break;
      case Field::Callback: write_callback(out, task); break;
      default: return false;
    }
    return true;
  });
  out.end_map();
}

void write_clusters(Writer &out, const std::vector<Cluster> &clusters) {
  out.text(to_string(Field::Clusters));
  out.begin_list();
  for (const Cluster &cluster : clusters) {
    out.begin_map(Layout::OneLine);
    write_fields(out, cluster, fields::kCluster, kNone);
    out.end_map();
  }
  out.end_list();
}

void write_devices(Writer &out, const std::vector<Device> &devices) {
  if (devices.empty()) return;
  out.text(to_string(Field::Devices));
  out.begin_map();
  for (const Device &device : devices) {
    out.text(device.name);
    out.begin_map(Layout::OneLine);
    write_fields(out, device, fields::kDevice, kNone);
    out.end_map();
  }
  out.end_map();
}

void write_platform(Writer &out, const Platform &platform) {
  const bool has_clusters = !platform.clusters.empty();
  out.text(to_string(Field::Platform));
  out.begin_map(has_clusters || !platform.devices.empty() ? Layout::Lines : Layout::OneLine);
  write_fields(out, platform, fields::kPlatform, [&](Field field) {
    if (field == Field::Clusters && has_clusters) write_clusters(out, platform.clusters);
    if (field == Field::Devices) write_devices(out, platform.devices);
    return has_clusters && (field == Field::Workers || field == Field::Cpus);
  });
  out.end_map();
}

void write_dag(Writer &out, const Platform &platform, const Dag &dag) {
  const Duration period = common_period(dag);
  out.begin_map();
  write_fields(out, dag, fields::kDag, [&](Field field) {
    if (field == Field::Period) write_period(out, period);
    if (field == Field::Degrade) write_degrade(out, dag.degrade);
    return false;
  });
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
  write_fields(out, workload, fields::kWorkload, [&](Field field) {
    if (field == Field::Platform) write_platform(out, workload.platform);
    return false;
  });
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
