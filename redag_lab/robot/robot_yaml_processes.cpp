// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/robot/robot_yaml_reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <iterator>

#include "redag/base/cpu_list.hpp"
#include "redag/base/text.hpp"
#include "redag/model/workload_yaml_node.hpp"

namespace redag::robot {
namespace {

using yaml::find;

}  // namespace

void ProcessesReader::read_process(const Node &node) {
  Process process;
  process.place = place_of(node);
  const bool is_sound = check_map(node, "a process", {"name", "match", "cpus", "workload"}) &&
                        take_name(node, "a process", names_of_processes_, robot_.processes.size(), process.name);
  is_broken_ = is_broken_ || !is_sound;
  if (is_sound) {
    if (find(node, "match") == nullptr) {
      error(node, fmt::format("process '{}' has no match", process.name),
            "add 'match: {name: PROGRAM}' or 'match: {command: \"*/PROGRAM *\"}'");
    } else {
      read_match(*find(node, "match"), process.match, nullptr);
    }
    read_set_of(node, process);
    if (const Node *workload = find(node, "workload")) read_workload_of(*workload, process);
  }
  robot_.processes.push_back(std::move(process));
}

void ProcessesReader::read_set_of(const Node &node, Process &process) {
  const Node *cpus_node = find(node, "cpus");
  if (cpus_node == nullptr) {
    if (robot_.cpu_sets.size() < 2) return;
    error(node, fmt::format("process '{}' names no CPU set", process.name),
          "add 'cpus:' with one of " + names_of_sets());
    return;
  }
  if (const auto set = set_named(*cpus_node)) {
    process.cpu_set = *set;
  } else if (!is_broken_) {
    error(*cpus_node,
          fmt::format("there is no CPU set {}, which process '{}' names", describe(*cpus_node), process.name),
          robot_.cpu_sets.front().name.empty() ? "remove 'cpus:', or replace the robot's 'cpus' by 'cpu_sets'"
                                               : "choose one of " + names_of_sets());
  }
}

void ProcessesReader::read_match(const Node &node, ProcessMatch &match, Threads *threads) {
  std::vector<std::string_view> keys = {"name", "command", "cgroup"};
  if (threads != nullptr) keys.insert(keys.end(), {"thread", "process"});
  if (!check_map(node, "match", keys)) return;
  take_text(node, "name", match.name);
  take_text(node, "command", match.command);
  take_text(node, "cgroup", match.cgroup);
  if (threads != nullptr) take_text(node, "thread", threads->thread);
  if (node.children.empty()) {
    error(node, "match would match everything", fmt::format("add one of {}", fmt::join(keys, ", ")));
  }
  constexpr std::size_t kMostOfName = 15;
  for (const char *key : {"name", "thread"}) {
    const Node *name = find(node, key);
    if (name == nullptr || name->text.size() <= kMostOfName || name->text.find('*') != std::string::npos) continue;
    error(*name, fmt::format("{} '{}' matches nothing: the kernel keeps 15 characters of a name", key, name->text),
          fmt::format("write '{}', or match the command", name->text.substr(0, kMostOfName)));
  }
  const Node *process = threads == nullptr ? nullptr : find(node, "process");
  if (process == nullptr) return;
  if (!match.is_empty()) {
    error(*process, "match has both 'process' and another way to name processes", "remove one of them");
  }
  threads->process = process_named(*process, describe(*process));
}

std::optional<std::size_t> ProcessesReader::process_named(const Node &at, const std::string &described) {
  const auto found = names_of_processes_.find(at.text);
  if (at.kind == Node::Kind::Scalar && found != names_of_processes_.end()) return found->second;
  if (is_broken_) return std::nullopt;
  std::vector<std::string_view> names;
  for (const Process &process : robot_.processes) names.emplace_back(process.name);
  error(at, fmt::format("there is no process {}", described), did_you_mean(at.text, names, "add it to 'processes:'"));
  return std::nullopt;
}

void ProcessesReader::read_workload_of(const Node &node, Process &process) {
  LoadOptions options = options_;
  if (!is_broken_) {
    options.default_workers = static_cast<std::uint32_t>(robot_.cpu_sets[process.cpu_set].cpus.size());
  }
  Result<LoadedWorkload> loaded = [&]() -> Result<LoadedWorkload> {
    if (node.kind == Node::Kind::Map) return read_workload(node, file_, options);
    const std::optional<std::string> path = text(node, "workload");
    if (!path) return tl::unexpected(Diagnostics{});
    return load_workload(std::filesystem::path(file_).parent_path() / *path, options);
  }();
  const bool is_inline = node.kind == Node::Kind::Map;
  if (!loaded && !is_inline && !loaded.error().empty()) {
    error(node, fmt::format("the workload {} cannot be used", describe(node)), "its mistakes are listed below");
  }
  const Diagnostics &found = loaded ? loaded->warnings : loaded.error();
  std::copy(found.begin(), found.end(), std::back_inserter(is_inline ? diagnostics_ : of_other_files_));
  if (!loaded) {
    is_broken_ = true;
    return;
  }
  process.workload = std::move(loaded->workload);
  process.states_workers = loaded->states_workers;
  const std::vector<int> &cpus = process.workload->platform.cpus;
  if (!is_broken_ && !cpus.empty() && cpus != robot_.cpu_sets[process.cpu_set].cpus) {
    error(node,
          fmt::format("the workload of process '{}' has other cpus than the process: {}", process.name,
                      format_cpu_list(cpus)),
          fmt::format("remove 'cpus:' from its platform, or write 'cpus: {}'",
                      format_cpu_list(robot_.cpu_sets[process.cpu_set].cpus)));
  }
  if (process.workload->policy != PolicyKind::Fixed && robot_.policy == PolicyKind::Fixed) {
    warn(node,
         fmt::format("policy of the robot is fixed, but the workload of process '{}' is ordered by {}", process.name,
                     to_string(process.workload->policy)),
         "its tasks without 'priority' have priority 0");
  }
}

void ProcessesReader::read_link(const Node &node) {
  Link link;
  link.place = place_of(node);
  if (!check_map(node, "a link", {"from", "to", "transport"})) return;
  for (const char *key : {"from", "to", "transport"}) {
    if (find(node, key) != nullptr) continue;
    error(node, fmt::format("the link has no '{}'", key),
          "write {from: PROCESS.DAG.TASK, to: PROCESS.DAG.TASK, transport: TIME}");
    return;
  }
  const auto task = [this](const Node &at, auto key) { return read_task(at, key); };
  const auto time = [this](const Node &at, auto key) { return duration_from_zero(at, key); };
  const bool is_read = take(node, "from", link.from, task) && take(node, "to", link.to, task) &&
                       take(node, "transport", link.transport, time);
  if (!is_read) return;
  if (!check_link(node, link)) return;
  robot_.links.push_back(std::move(link));
}

bool ProcessesReader::check_link(const Node &node, const Link &link) {
  const Task &from = task_of(link.from);
  const Task &to = task_of(link.to);
  const auto refuse = [&](const char *key, std::string message, std::string hint) {
    error(*find(node, key), std::move(message), std::move(hint));
    return false;
  };
  if (link.from.process == link.to.process) {
    return refuse("to", "the link stays within a process", "write an edge in its workload: 'after:'");
  }
  if (to.activation != Activation::Timer || !to.predecessors.empty()) {
    return refuse("to", fmt::format("task '{}' has predecessors in its process", link.to.name),
                  "add a task without predecessors that receives the data");
  }
  if (!targets_.emplace(link.to.name, robot_.links.size()).second) {
    return refuse("to", fmt::format("task '{}' has the data of another link already", link.to.name),
                  "add a task for the data of each");
  }
  if (to.jitter != 0) {
    return refuse("to", fmt::format("task '{}' has a jitter, which would follow from the link", link.to.name),
                  "remove 'jitter:' in its workload");
  }
  const Dag &dag = dag_of(link.to);
  for (const Task &task : dag.tasks) {
    const bool waits = std::any_of(task.predecessors.begin(), task.predecessors.end(),
                                   [&](std::uint32_t p) { return &dag.tasks[p] == &to; });
    if (!waits || task.activation == Activation::Data || task.period != to.period) continue;
    return refuse(
        "to",
        fmt::format("timer task '{}' of the same period waits for '{}', but nothing synchronises it with data "
                    "of another process",
                    task.name, link.to.name),
        "make it a data task: 'activation: data'");
  }
  if (from.period == to.period) return true;
  return refuse("to",
                fmt::format("task '{}' has the period {}, and '{}', whose data release it, has {}", link.to.name,
                            format_duration(to.period), link.from.name, format_duration(from.period)),
                fmt::format("write 'period: {}' in its workload", format_duration(from.period)));
}

const Dag &ProcessesReader::dag_of(const TaskOf &task) const {
  const Workload &workload = *robot_.processes[task.process].workload;
  return workload.dags[flatten(workload)[task.task.value].dag.value];
}

const Task &ProcessesReader::task_of(const TaskOf &task) const {
  return *flatten(*robot_.processes[task.process].workload)[task.task.value].task;
}

std::optional<TaskOf> ProcessesReader::read_task(const Node &node, std::string_view key) {
  const std::optional<std::string> name = text(node, key);
  if (!name || is_broken_) return std::nullopt;
  if (tasks_.empty()) {
    for (std::size_t p = 0; p < robot_.processes.size(); ++p) {
      const Process &process = robot_.processes[p];
      if (!process.workload) continue;
      for (const TaskRef &ref : flatten(*process.workload)) {
        const Dag &dag = process.workload->dags[ref.dag.value];
        tasks_.emplace(fmt::format("{}.{}.{}", process.name, dag.name, ref.task->name), std::pair(p, ref.id));
      }
    }
  }
  const auto found = tasks_.find(*name);
  if (found != tasks_.end()) return TaskOf{found->second.first, found->second.second, *name};
  std::vector<std::string_view> names;
  for (const auto &[each, place] : tasks_) names.emplace_back(each);
  std::sort(names.begin(), names.end());
  error(node, fmt::format("there is no task {}", in_quotes(*name)),
        did_you_mean(*name, names, "write PROCESS.DAG.TASK, such as 'base.control.pid'"));
  return std::nullopt;
}

}  // namespace redag::robot
