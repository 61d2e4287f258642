// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/robot/robot_yaml.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <initializer_list>
#include <iterator>
#include <optional>
#include <string_view>
#include <unordered_map>
#include <unordered_set>
#include <utility>
#include <vector>

#include "redag/base/text.hpp"
#include "redag/loader/cpu_list.hpp"
#include "redag/loader/workload_yaml_node.hpp"
#include "redag/loader/workload_yaml_values.hpp"

namespace redag::robot {
namespace {

using yaml::find;
using yaml::Node;
using Kind = Level::Kind;

constexpr std::array kPolicies = {PolicyKind::RateMonotonic, PolicyKind::DeadlineMonotonic, PolicyKind::Fixed};
constexpr std::uint32_t kMostThreads = 256;
// What Linux allows, and its coarsest tick.
constexpr Duration kLeastBudget = 1024;
constexpr Duration kLeastReserved = 100 * kMicrosecond;
constexpr Duration kMostReserved = 4 * kSecond;
constexpr Duration kCoarsestTick = 10 * kMillisecond;

class RobotReader : private yaml::ValueReader {
 public:
  RobotReader(const Node &root, const std::string &file, LoadOptions options)
      : ValueReader(file), root_(root), options_(options) {}

  Result<LoadedRobot> run() {
    if (check_map(root_, "a robot", {"robot", "policy", "cpus", "cpu_sets", "processes", "threads"})) {
      take(root_, "robot", robot_.name, [this](const Node &node, auto key) { return text(node, key); });
      take(root_, "policy", robot_.policy,
           [this](const Node &node, auto key) { return one_of<PolicyKind>(node, key, kPolicies); });
      read_cpu_sets();
      read_list("processes", [this](const Node &node) { read_process(node); });
      read_list("threads", [this](const Node &node) { read_threads(node); });
      if (robot_.processes.empty() && !is_broken_) {
        error(root_, "the robot has no processes", "add one under 'processes:'");
      }
    }
    Diagnostics found = take_diagnostics();
    // Those of other files keep the order of these files.
    std::move(of_other_files_.begin(), of_other_files_.end(), std::back_inserter(found));
    if (has_errors(found)) return tl::unexpected<Diagnostics>(std::move(found));
    return LoadedRobot{std::move(robot_), std::move(found)};
  }

 private:
  // ---- entries ----

  template <class T, class Read>
  bool take(const Node &map, std::string_view key, T &out, Read read) {
    const Node *node = find(map, key);
    if (node == nullptr) return false;
    auto value = read(*node, key);
    if (value) out = std::move(*value);
    return value.has_value();
  }

  bool take_time(const Node &map, std::string_view key, Duration &out) {
    return take(map, key, out, [this](const Node &node, auto name) { return positive_duration(node, name); });
  }

  bool must_have(const Node &map, std::string_view what, std::initializer_list<const char *> keys, const char *hint) {
    for (const char *key : keys) {
      if (find(map, key) != nullptr) continue;
      error(map, fmt::format("{} no '{}'", what, key), hint);
      return false;
    }
    return true;
  }

  [[nodiscard]] Place place_of(const Node &node) const { return {file_, node.line, node.column}; }

  template <class Read>
  void read_list(std::string_view key, Read read) {
    const Node *node = find(root_, key);
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
    for (const Node &item : node->children) read(item);
  }

  // Reads the name of an entry, and refuses one that an entry of `others` has.
  template <class Entry>
  bool take_name(const Node &node, std::string_view what, const std::vector<Entry> &others, std::string &out) {
    const Node *name = find(node, "name");
    if (name == nullptr) {
      error(node, fmt::format("{} has no name", what), "add 'name:'");
      return false;
    }
    if (!take(node, "name", out, [this](const Node &at, auto key) { return text(at, key); })) return false;
    if (std::none_of(others.begin(), others.end(), [&](const Entry &other) { return other.name == out; })) return true;
    error(*name, fmt::format("the name '{}' is used by another entry of this list", out), "choose a unique name");
    return false;
  }

  // ---- processors ----

  void read_cpu_sets() {
    const Node *cpus_node = find(root_, "cpus");
    const Node *sets = find(root_, "cpu_sets");
    if ((cpus_node == nullptr) == (sets == nullptr)) {
      error(cpus_node == nullptr ? root_ : *cpus_node,
            cpus_node == nullptr ? "the robot names no processors" : "the robot has both 'cpus' and 'cpu_sets'",
            "add 'cpus: 0-3' if all processes share them, or else 'cpu_sets:'");
      is_broken_ = true;
      return;
    }
    if (cpus_node != nullptr) {
      is_broken_ = !take_cpus(root_, robot_.cpu_sets.emplace_back()) || is_broken_;
      return;
    }
    read_list("cpu_sets", [this](const Node &node) { read_cpu_set(node); });
    if (!robot_.cpu_sets.empty() || is_broken_) return;
    error(*sets, "cpu_sets is an empty list", "add a set such as {name: all, cpus: 0-3}");
    is_broken_ = true;
  }

  bool take_cpus(const Node &map, CpuSet &set) {
    return take(map, "cpus", set.cpus, [this](const Node &node, auto key) { return cpus(node, key); });
  }

  void read_cpu_set(const Node &node) {
    CpuSet set;
    bool is_sound = check_map(node, "a CPU set", {"name", "cpus"}) &&
                    take_name(node, "a CPU set", robot_.cpu_sets, set.name) &&
                    must_have(node, "the CPU set has", {"cpus"}, "add 'cpus:'") && take_cpus(node, set);
    for (const int cpu : set.cpus) {
      if (owned_.insert(cpu).second) continue;
      error(*find(node, "cpus"), fmt::format("processor {} of CPU set '{}' is also one of another set", cpu, set.name),
            "CPU sets share no processors");
      is_sound = false;
      break;
    }
    is_broken_ = is_broken_ || !is_sound;
    robot_.cpu_sets.push_back(std::move(set));
  }

  // The CPU set that `cpus:` of an entry names, or the only one. `what` is the entry: "process 'base'".
  std::size_t read_set_of(const Node &node, const std::string &what) {
    const Node *cpus_node = find(node, "cpus");
    std::vector<std::string_view> names;
    for (const CpuSet &set : robot_.cpu_sets) names.emplace_back(set.name);
    const std::string hint = names.size() == 1 && names.front().empty()
                                 ? "remove 'cpus:', or replace the robot's 'cpus' by 'cpu_sets'"
                                 : fmt::format("write 'cpus:' with one of {}", fmt::join(names, ", "));
    if (cpus_node == nullptr) {
      if (names.size() > 1) error(node, fmt::format("{} names no CPU set", what), hint);
      return 0;
    }
    const auto named = std::find(names.begin(), names.end(), cpus_node->text);
    if (cpus_node->kind == Node::Kind::Scalar && named != names.end()) {
      return static_cast<std::size_t>(named - names.begin());
    }
    if (!is_broken_)
      error(*cpus_node, fmt::format("{} names {}, which is no CPU set", what, describe(*cpus_node)), hint);
    return 0;
  }

  // ---- processes ----

  void read_process(const Node &node) {
    Process process;
    process.place = place_of(node);
    const bool is_sound =
        check_map(node, "a process", {"name", "cpus", "workload"}) &&
        take_name(node, "a process", robot_.processes, process.name) &&
        must_have(node, "the process has", {"workload"}, "name a workload file, or write its 'dags:'");
    is_broken_ = is_broken_ || !is_sound;
    if (is_sound) {
      process.cpu_set = read_set_of(node, fmt::format("process '{}'", process.name));
      read_workload_of(*find(node, "workload"), process);
    }
    robot_.processes.push_back(std::move(process));
  }

  void read_workload_of(const Node &node, Process &process) {
    const bool is_inline = node.kind == Node::Kind::Map;
    const std::vector<int> &set = robot_.cpu_sets.empty() ? std::vector<int>{} : robot_.cpu_sets[process.cpu_set].cpus;
    LoadOptions options = options_;
    if (!is_broken_) options.default_workers = static_cast<std::uint32_t>(set.size());
    Result<LoadedWorkload> loaded = [&]() -> Result<LoadedWorkload> {
      if (is_inline) return read_workload(node, file_, options);
      const std::optional<std::string> path = text(node, "workload");
      if (!path) return tl::unexpected(Diagnostics{});
      return load_workload(std::filesystem::path(file_).parent_path() / *path, options);
    }();
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
    const std::vector<int> &cpus = process.workload.platform.cpus;
    if (!is_broken_ && !cpus.empty() && cpus != set) {
      error(node,
            fmt::format("the workload of process '{}' has other cpus than the process: {}", process.name,
                        format_cpu_list(cpus)),
            fmt::format("remove 'cpus:' from its platform, or write 'cpus: {}'", format_cpu_list(set)));
    }
  }

  // Finds "process.dag.task". Any of the names can contain dots.
  std::optional<TaskOf> read_task(const Node &node, std::string_view key) {
    const std::optional<std::string> name = text(node, key);
    if (!name || is_broken_) return std::nullopt;
    if (tasks_.empty()) {
      for (std::size_t p = 0; p < robot_.processes.size(); ++p) {
        const Process &process = robot_.processes[p];
        for (const TaskRef &ref : flatten(process.workload)) {
          const Dag &dag = process.workload.dags[ref.dag.value];
          tasks_.emplace(fmt::format("{}.{}.{}", process.name, dag.name, ref.task->name), std::pair(p, ref.id));
        }
      }
    }
    const auto found = tasks_.find(*name);
    if (found != tasks_.end()) return TaskOf{found->second.first, found->second.second, *name};
    std::vector<std::string_view> names;
    for (const auto &[each, place] : tasks_) names.emplace_back(each);
    std::sort(names.begin(), names.end());
    return error(node, fmt::format("there is no task {}", in_quotes(*name)),
                 did_you_mean(*name, names, "write PROCESS.DAG.TASK, such as 'base.control.pid'"));
  }

  // ---- threads ----

  void read_threads(const Node &node) {
    Threads threads;
    threads.place = place_of(node);
    if (!check_map(node, "an entry of threads", {"name", "level", "cpus", "count", "wcet", "period"}) ||
        !take_name(node, "an entry of threads", robot_.threads, threads.name) ||
        !must_have(node, "the threads have", {"level"}, "write above, {rate: PERIOD} or another place in the order") ||
        !read_level(*find(node, "level"), threads.level)) {
      return;
    }
    take(node, "count", threads.count,
         [this](const Node &value, auto key) { return integer<std::uint32_t>(value, key, 1, kMostThreads); });
    const Kind kind = threads.level.kind;
    if (kind == Kind::Rate || kind == Kind::Above) {
      threads.cpu_set = read_set_of(node, fmt::format("the entry '{}'", threads.name));
      read_load(node, threads);
    } else {
      const bool of_task = kind == Kind::Task;
      for (const char *key : {"cpus", "wcet", "period"}) {
        if (const Node *value = find(node, key)) {
          error(*value,
                fmt::format("threads '{}' have '{}', which {} says", threads.name, key,
                            of_task ? "their task" : "the reservation"),
                fmt::format("remove '{}:'", key));
        }
      }
    }
    robot_.threads.push_back(std::move(threads));
  }

  void read_load(const Node &node, Threads &threads) {
    const bool of_rate = threads.level.kind == Kind::Rate;
    if (of_rate) threads.period = threads.level.rate;
    const bool is_stated = find(node, "wcet") != nullptr && (of_rate || find(node, "period") != nullptr);
    if (!is_stated) {
      error(node, fmt::format("threads '{}' can delay tasks, and nothing says for how long", threads.name),
            "add 'wcet:' and 'period:': what one of them executes at most, and how often");
      return;
    }
    if (!take_time(node, "wcet", threads.wcet)) return;
    if (find(node, "period") != nullptr && !take_time(node, "period", threads.period)) return;
    if (threads.wcet <= threads.period) return;
    error(*find(node, "wcet"),
          fmt::format("wcet {} of threads '{}' exceeds their period {}", format_duration(threads.wcet), threads.name,
                      format_duration(threads.period)));
  }

  bool read_level(const Node &node, Level &level) {
    if (node.kind == Node::Kind::Scalar && node.text == "above") return true;
    if (node.kind != Node::Kind::Map) {
      unknown_choice(
          node, "level",
          {"above", "{task: PROCESS.DAG.TASK}", "{rate: PERIOD}", "{reservation: {budget: TIME, period: TIME}}"});
      return false;
    }
    if (!check_map(node, "level", {"task", "rate", "reservation"})) return false;
    if (node.children.size() != 2) {
      error(node, "level must have one of task, rate and reservation");
      return false;
    }
    if (find(node, "task") != nullptr) {
      level.kind = Kind::Task;
      return take(node, "task", level.task, [this](const Node &at, auto key) { return read_task(at, key); });
    }
    if (const Node *reservation = find(node, "reservation")) {
      level.kind = Kind::Reservation;
      return read_reservation(*reservation, level.reservation);
    }
    level.kind = Kind::Rate;
    if (robot_.policy == PolicyKind::Fixed) {
      error(node.children[1], "a rate has no place in an order by policy fixed", "use task or above");
      return false;
    }
    return take(node, "rate", level.rate, [this](const Node &at, auto key) {
      return parse_rate(at.text) ? rate(at, key) : positive_duration(at, key);
    });
  }

  bool read_reservation(const Node &node, Reservation &out) {
    out.tick = kCoarsestTick;
    if (!check_map(node, "reservation", {"budget", "period", "tick"}) ||
        !must_have(node, "the reservation has", {"budget", "period"}, "write {budget: 2ms, period: 10ms}") ||
        !take_time(node, "budget", out.budget) || !take_time(node, "period", out.period) ||
        (find(node, "tick") != nullptr && !take_time(node, "tick", out.tick))) {
      return false;
    }
    const auto refuse = [&](const char *key, std::string message) {
      error(*find(node, key), std::move(message));
      return false;
    };
    if (out.period < kLeastReserved || out.period > kMostReserved) {
      return refuse("period", fmt::format("the period of a reservation must be between {} and {}",
                                          format_duration(kLeastReserved), format_duration(kMostReserved)));
    }
    if (out.budget < kLeastBudget || out.budget > out.period) {
      return refuse("budget", fmt::format("the budget of a reservation must be between {} and its period {}",
                                          format_duration(kLeastBudget), format_duration(out.period)));
    }
    if (out.tick > kCoarsestTick) {
      return refuse(
          "tick", fmt::format("the tick is at most {}, as no kernel has a longer one", format_duration(kCoarsestTick)));
    }
    return true;
  }

  const Node &root_;
  LoadOptions options_;
  Robot robot_;
  Diagnostics of_other_files_;
  bool is_broken_ = false;         // some entry is lost: names that are unknown may be its own
  std::unordered_set<int> owned_;  // processors of the CPU sets
  std::unordered_map<std::string, std::pair<std::size_t, TaskId>> tasks_;
};

}  // namespace

bool is_robot(const yaml::Node &root) { return root.kind == yaml::Node::Kind::Map && find(root, "robot") != nullptr; }

Result<LoadedRobot> read_robot(const yaml::Node &root, const std::string &file, LoadOptions options) {
  return RobotReader(root, file, options).run();
}

}  // namespace redag::robot
