// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The parts of the reader of robot files (robot_yaml.hpp): processors, processes with their links, and threads with
// interrupts. Each knows those before it, as entries name earlier ones.
#pragma once

#include <fmt/format.h>

#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <unordered_set>
#include <utility>
#include <vector>

#include "redag/model/workload_yaml.hpp"
#include "redag/model/workload_yaml_values.hpp"
#include "redag_lab/robot/robot.hpp"
#include "redag_lab/robot/robot_yaml.hpp"

namespace redag::robot {

/// Reads lists of entries with unique names.
class EntryReader : protected yaml::ValueReader {
 protected:
  using ValueReader::ValueReader;
  using Node = yaml::Node;
  using Names = std::unordered_map<std::string, std::size_t>;

  template <class T, class Read>
  bool take(const Node &map, std::string_view key, T &out, Read read) {
    const Node *node = yaml::find(map, key);
    if (node == nullptr) return false;
    auto value = read(*node, key);
    if (value) out = std::move(*value);
    return value.has_value();
  }
  bool take_text(const Node &map, std::string_view key, std::string &out) {
    return take(map, key, out, [this](const Node &node, auto name) { return text(node, name); });
  }

  [[nodiscard]] Place place_of(const Node &node) const { return {file_, node.line, node.column}; }

  void warn(const Node &at, std::string message, std::string hint) {
    diagnostics_.push_back(
        Diagnostic{Severity::Warning, file_, at.line, at.column, std::move(message), std::move(hint)});
  }

  template <class Read>
  void read_list(const Node &map, std::string_view key, Names &names, Read read) {
    const Node *node = yaml::find(map, key);
    if (node == nullptr || node->kind == Node::Kind::Null) return;
    if (node->kind != Node::Kind::Sequence) {
      wrong_type(*node, key, "a list");
      is_broken_ = true;
      return;
    }
    if (node->children.size() > kMaxEntries) {
      error(*node, fmt::format("{} has {} entries; at most {} are allowed", key, node->children.size(), kMaxEntries));
      is_broken_ = true;
      return;
    }
    names.reserve(names.size() + node->children.size());
    for (const Node &item : node->children) read(item);
  }

  // Reads the name of an entry, and refuses one that another entry has.
  bool take_name(const Node &node, std::string_view what, Names &names, std::size_t position, std::string &out) {
    const Node *name = yaml::find(node, "name");
    if (name == nullptr) {
      error(node, fmt::format("{} has no name", what), "add 'name:'");
      return false;
    }
    if (!take_text(node, "name", out)) return false;
    if (names.emplace(out, position).second) return true;
    error(*name, fmt::format("the name '{}' is used by another entry of this list", out), "choose a unique name");
    return false;
  }

  // Some entry is lost: names that are unknown may be its own.
  bool is_broken_ = false;
};

/// Reads CPU sets, and what names them.
class ProcessorsReader : protected EntryReader {
 protected:
  ProcessorsReader(const Node &root, const std::string &file) : EntryReader(file), root_(root) {}

  void read_cpu_sets();
  [[nodiscard]] std::optional<std::size_t> set_named(const Node &node) const;
  [[nodiscard]] std::string names_of_sets() const;
  // Reads the name of a CPU set, or processors.
  std::vector<int> read_cpus(const Node &node);

  const Node &root_;
  Robot robot_;

 private:
  void read_cpu_set(const Node &node);

  Names names_of_sets_;
  std::unordered_set<int> owned_;  // processors of the CPU sets
};

/// Reads processes with their workloads, links, and what names these.
class ProcessesReader : protected ProcessorsReader {
 protected:
  ProcessesReader(const Node &root, const std::string &file, LoadOptions options)
      : ProcessorsReader(root, file), options_(options) {}

  void read_process(const Node &node);
  // Reads which processes are meant. `threads` is null for a process.
  void read_match(const Node &node, ProcessMatch &match, Threads *threads);
  std::optional<std::size_t> process_named(const Node &at, const std::string &described);
  void read_link(const Node &node);
  // Finds "process.dag.task". Any of the names can contain dots.
  std::optional<TaskOf> read_task(const Node &node, std::string_view key);

  LoadOptions options_;
  Diagnostics of_other_files_;
  Names names_of_processes_;
  Names targets_;  // of links

 private:
  void read_set_of(const Node &node, Process &process);
  void read_workload_of(const Node &node, Process &process);
  bool check_link(const Node &node, const Link &link);
  [[nodiscard]] const Task &task_of(const TaskOf &task) const;
  [[nodiscard]] const Dag &dag_of(const TaskOf &task) const;

  std::unordered_map<std::string, std::pair<std::size_t, TaskId>> tasks_;
};

/// Reads entries of threads and of interrupts.
class ThreadsReader : protected ProcessesReader {
 protected:
  using ProcessesReader::ProcessesReader;

  void read_threads(const Node &node);
  void read_interrupts(const Node &node);

  Names names_of_threads_;
  Names names_of_interrupts_;

 private:
  // A load is what the analysis has to know of threads that interfere with tasks.
  void check_load(const Node &node, Threads &threads);
  std::optional<Level> read_level(const Node &node);
  bool read_reservation(const Node &node, Reservation &out);
};

}  // namespace redag::robot
