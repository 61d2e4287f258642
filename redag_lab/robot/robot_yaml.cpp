// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/robot/robot_yaml.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <iterator>
#include <span>
#include <unordered_map>
#include <unordered_set>
#include <utility>

#include "redag/base/cpu_list.hpp"
#include "redag/base/text.hpp"
#include "redag/model/validate.hpp"
#include "redag/model/workload_yaml_node.hpp"
#include "redag/model/workload_yaml_values.hpp"

namespace redag::robot {
namespace {

using yaml::find;
using yaml::Node;

constexpr std::array kPolicies = {PolicyKind::RateMonotonic, PolicyKind::DeadlineMonotonic, PolicyKind::Fixed};
constexpr int kMostFifo = 99;
constexpr int kLeastNice = -20;
constexpr int kMostNice = 19;
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
    if (check_map(root_, "a robot",
                  {"robot", "policy", "cpus", "cpu_sets", "hosts", "processes", "links", "threads", "irqs"})) {
      take(root_, "robot", robot_.name, [this](const Node &node, auto key) { return text(node, key); });
      take(root_, "policy", robot_.policy,
           [this](const Node &node, auto key) { return one_of(node, key, std::span<const PolicyKind>(kPolicies)); });
      read_cpu_sets();
      read_list("processes", names_of_processes_, [this](const Node &node) { read_process(node); });
      read_list("links", targets_, [this](const Node &node) { read_link(node); });
      read_list("threads", names_of_threads_, [this](const Node &node) { read_threads(node); });
      read_list("irqs", names_of_interrupts_, [this](const Node &node) { read_interrupts(node); });
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
  using Names = std::unordered_map<std::string, std::size_t>;

  template <class T, class Read>
  bool take(const Node &map, std::string_view key, T &out, Read read) {
    const Node *node = find(map, key);
    if (node == nullptr) return false;
    auto value = read(*node, key);
    if (value) out = std::move(*value);
    return value.has_value();
  }
  bool take_text(const Node &map, std::string_view key, std::string &out) {
    return take(map, key, out, [this](const Node &node, auto name) { return text(node, name); });
  }

  [[nodiscard]] Place place_of(const Node &node) const { return {file_, node.line, node.column}; }

  // Calls `read` for each item of a list, which may be absent.
  template <class Read>
  void read_list(std::string_view key, Names &names, Read read) {
    read_list(root_, key, names, read);
  }
  template <class Read>
  void read_list(const Node &map, std::string_view key, Names &names, Read read) {
    const Node *node = find(map, key);
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
    const Node *name = find(node, "name");
    if (name == nullptr) {
      error(node, fmt::format("{} has no name", what), "add 'name:'");
      return false;
    }
    if (!take_text(node, "name", out)) return false;
    if (names.emplace(out, position).second) return true;
    error(*name, fmt::format("the name '{}' is used by another entry of this list", out), "choose a unique name");
    return false;
  }

  // The robot is one host, or has several, each with its own processors.
  void read_cpu_sets() {
    if (const Node *hosts = find(root_, "hosts")) {
      for (const char *key : {"cpus", "cpu_sets"}) {
        if (const Node *node = find(root_, key)) {
          error(*node, fmt::format("the robot has both 'hosts' and '{}'", key), "give the processors to the hosts");
          is_broken_ = true;
        }
      }
      read_list("hosts", names_of_hosts_, [this](const Node &node) { read_host(node); });
      if (robot_.hosts.empty() && !is_broken_) error(*hosts, "hosts is an empty list", "add {name: NAME, cpus: 0-3}");
    } else {
      read_processors(root_, "the robot", CpuSet());
    }
    is_broken_ = is_broken_ || robot_.cpu_sets.empty();
  }

  void read_host(const Node &node) {
    CpuSet set;
    owned_.clear();
    set.host = robot_.hosts.size();
    if (!check_map(node, "a host", {"name", "cpus", "cpu_sets"}) ||
        !take_name(node, "a host", names_of_hosts_, set.host, set.name)) {
      is_broken_ = true;
      return;
    }
    robot_.hosts.push_back(set.name);
    host_ = set.host;
    read_processors(node, fmt::format("host '{}'", set.name), std::move(set));
  }

  // Reads 'cpus', which makes `set` complete, or 'cpu_sets'.
  void read_processors(const Node &map, const std::string &what, CpuSet set) {
    const Node *cpus_node = find(map, "cpus");
    const Node *sets = find(map, "cpu_sets");
    if ((cpus_node == nullptr) == (sets == nullptr)) {
      error(cpus_node == nullptr ? map : *cpus_node,
            what + (cpus_node == nullptr ? " names no processors" : " has both 'cpus' and 'cpu_sets'"),
            "add 'cpus: 0-3' if all processes share them, or else 'cpu_sets:'");
      is_broken_ = true;
      return;
    }
    if (cpus_node != nullptr) {
      const bool is_sound = (set.name.empty() || is_new_set(*find(map, "name"), set.name)) &&
                            take(map, "cpus", set.cpus, [this](const Node &node, auto key) { return cpus(node, key); });
      is_broken_ = is_broken_ || !is_sound;
      robot_.cpu_sets.push_back(std::move(set));
      return;
    }
    const std::size_t before = robot_.cpu_sets.size();
    read_list(map, "cpu_sets", names_of_sets_, [this](const Node &node) { read_cpu_set(node); });
    if (robot_.cpu_sets.size() > before || is_broken_) return;
    error(*sets, "cpu_sets is an empty list", "add a set such as {name: all, cpus: 0-3}");
    is_broken_ = true;
  }

  // The set of a host has the host's name, which is then the name of no other set.
  bool is_new_set(const Node &at, const std::string &name) {
    if (parse_cpu_list(name)) {
      error(at, fmt::format("the name '{}' of a host is also a list of processors", name),
            "choose a name such as 'vision'");
      return false;
    }
    if (names_of_sets_.emplace(name, robot_.cpu_sets.size()).second) return true;
    error(at, fmt::format("a CPU set of another host is called '{}' as well", name), "choose a unique name");
    return false;
  }

  void read_cpu_set(const Node &node) {
    CpuSet set;
    set.host = host_;
    bool is_sound = check_map(node, "a CPU set", {"name", "cpus"}) &&
                    take_name(node, "a CPU set", names_of_sets_, robot_.cpu_sets.size(), set.name);
    if (is_sound && parse_cpu_list(set.name)) {
      error(*find(node, "name"), fmt::format("the name '{}' of a CPU set is also a list of processors", set.name),
            "choose a name such as 'control'");
      is_sound = false;
    }
    if (is_sound && find(node, "cpus") == nullptr) {
      error(node, fmt::format("CPU set '{}' has no processors", set.name), "add 'cpus:'");
      is_sound = false;
    }
    is_sound =
        is_sound && take(node, "cpus", set.cpus, [this](const Node &value, auto key) { return cpus(value, key); });
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

  void read_process(const Node &node) {
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

  void read_set_of(const Node &node, Process &process) {
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

  [[nodiscard]] std::optional<std::size_t> set_named(const Node &node) const {
    const auto found = names_of_sets_.find(node.text);
    return node.kind == Node::Kind::Scalar && found != names_of_sets_.end() ? std::optional(found->second)
                                                                            : std::nullopt;
  }

  [[nodiscard]] std::string names_of_sets() const {
    std::vector<std::string_view> names;
    for (const CpuSet &set : robot_.cpu_sets) names.emplace_back(set.name);
    return fmt::format("{}", fmt::join(names, ", "));
  }

  // Reads which processes are meant. `threads` is null for a process.
  void read_match(const Node &node, ProcessMatch &match, Threads *threads) {
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

  std::optional<std::size_t> process_named(const Node &at, const std::string &described) {
    const auto found = names_of_processes_.find(at.text);
    if (at.kind == Node::Kind::Scalar && found != names_of_processes_.end()) return found->second;
    if (is_broken_) return std::nullopt;
    std::vector<std::string_view> names;
    for (const Process &process : robot_.processes) names.emplace_back(process.name);
    error(at, fmt::format("there is no process {}", described), did_you_mean(at.text, names, "add it to 'processes:'"));
    return std::nullopt;
  }

  void read_workload_of(const Node &node, Process &process) {
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
    if (process.workload->policy != PolicyKind::Fixed && robot_.policy == PolicyKind::Fixed) {
      warn(node,
           fmt::format("policy of the robot is fixed, but the workload of process '{}' is ordered by {}", process.name,
                       to_string(process.workload->policy)),
           "its tasks without 'priority' have priority 0");
    }
  }

  void warn(const Node &at, std::string message, std::string hint) {
    diagnostics_.push_back(
        Diagnostic{Severity::Warning, file_, at.line, at.column, std::move(message), std::move(hint)});
  }

  void read_link(const Node &node) {
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

  bool check_link(const Node &node, const Link &link) {
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
    if (from.period == to.period) return true;
    return refuse("to",
                  fmt::format("task '{}' has the period {}, and '{}', whose data release it, has {}", link.to.name,
                              format_duration(to.period), link.from.name, format_duration(from.period)),
                  fmt::format("write 'period: {}' in its workload", format_duration(from.period)));
  }

  [[nodiscard]] const Task &task_of(const TaskOf &task) const {
    return *flatten(*robot_.processes[task.process].workload)[task.task.value].task;
  }

  void read_threads(const Node &node) {
    Threads threads;
    threads.place = place_of(node);
    if (!check_map(node, "an entry of threads",
                   {"name", "match", "host", "level", "cpus", "count", "wcet", "period"}) ||
        !take_name(node, "an entry of threads", names_of_threads_, robot_.threads.size(), threads.name)) {
      return;
    }
    if (const Node *match = find(node, "match")) {
      read_match(*match, threads.match, &threads);
    } else {
      error(node, fmt::format("threads '{}' have no match", threads.name),
            "add 'match: {thread: NAME}' or 'match: {process: PROCESS, thread: NAME}'");
    }
    if (const Node *level = find(node, "level")) threads.level = read_level(*level);
    threads.host = host_of_threads(node, threads);
    if (const Node *cpus_node = find(node, "cpus")) threads.cpus = read_cpus(*cpus_node, threads.host);
    if (find(node, "level") == nullptr && find(node, "cpus") == nullptr) {
      error(node, fmt::format("threads '{}' have neither a level nor cpus", threads.name),
            "add 'level:' or 'cpus:', or remove the entry");
    }
    take(node, "count", threads.count,
         [this](const Node &value, auto key) { return integer<std::uint32_t>(value, key, 1, kMostThreads); });
    take(node, "wcet", threads.wcet, [this](const Node &value, auto key) { return positive_duration(value, key); });
    take(node, "period", threads.period, [this](const Node &value, auto key) { return positive_duration(value, key); });
    check_load(node, threads);
    if (threads.level && threads.level->kind == Level::Kind::Reservation && find(node, "cpus") != nullptr) {
      error(*find(node, "cpus"),
            fmt::format("threads '{}' have a reservation, which is for all processors", threads.name),
            "remove 'cpus:'");
    }
    robot_.threads.push_back(std::move(threads));
  }

  // Threads are on the host of their process, or of the task that they execute.
  std::size_t host_of_threads(const Node &node, const Threads &threads) {
    std::optional<std::size_t> host;
    if (threads.process && !is_broken_) host = host_of(robot_, *threads.process);
    if (threads.level && threads.level->kind == Level::Kind::Task && !is_broken_) {
      const std::size_t of_task = host_of(robot_, threads.level->task.process);
      if (host && *host != of_task) {
        error(*find(node, "level"),
              fmt::format("threads '{}' are on host '{}', and task '{}' is on host '{}'", threads.name,
                          robot_.hosts[*host], threads.level->task.name, robot_.hosts[of_task]),
              "choose a task of the same host");
      }
      host = of_task;
    }
    return read_host_of(node, fmt::format("threads '{}'", threads.name), host);
  }

  // Reads the host of an entry, which `known` tells otherwise.
  std::size_t read_host_of(const Node &node, const std::string &what, std::optional<std::size_t> known) {
    const Node *host = find(node, "host");
    if (host == nullptr) {
      if (!known && !robot_.hosts.empty() && !is_broken_) {
        error(node, fmt::format("nothing says on which host {} are", what),
              fmt::format("add 'host:' with one of {}", fmt::join(robot_.hosts, ", ")));
      }
      return known.value_or(0);
    }
    const auto found = names_of_hosts_.find(host->text);
    if (host->kind != Node::Kind::Scalar || found == names_of_hosts_.end()) {
      if (is_broken_) return 0;
      const std::vector<std::string_view> names(robot_.hosts.begin(), robot_.hosts.end());
      error(*host, fmt::format("there is no host {}", describe(*host)),
            names.empty() ? "remove 'host:': the robot has no 'hosts:'"
                          : did_you_mean(host->text, names, "add it to 'hosts:'"));
      return known.value_or(0);
    }
    if (known && *known != found->second) {
      error(*host, fmt::format("{} are on host '{}' by their process or task", what, robot_.hosts[*known]),
            "remove 'host:'");
    }
    return found->second;
  }

  // A load is what the analysis has to know of threads that interfere with tasks.
  void check_load(const Node &node, Threads &threads) {
    const Node *wcet = find(node, "wcet");
    const Node *period = find(node, "period");
    const bool of_rate = threads.level && threads.level->kind == Level::Kind::Rate;
    if (of_rate && period != nullptr) {
      error(*period, fmt::format("threads '{}' have both a period and a rate", threads.name),
            "remove 'period:'; the rate is their period");
    }
    if (of_rate) threads.period = threads.level->rate;
    if (threads.level && threads.level->kind == Level::Kind::Reservation) {
      if (wcet == nullptr && period == nullptr) return;
      error(wcet != nullptr ? *wcet : *period,
            fmt::format("threads '{}' have a reservation, which says how long they delay tasks", threads.name),
            "remove 'wcet:' and 'period:'");
      return;
    }
    if (threads.level && !threads.level->interferes() && (wcet != nullptr || period != nullptr)) {
      error(wcet != nullptr ? *wcet : *period,
            fmt::format("threads '{}' delay no task at this level, and need no wcet or period", threads.name),
            "remove 'wcet:' and 'period:'");
    } else if (wcet != nullptr && period == nullptr && !of_rate) {
      error(*wcet, fmt::format("threads '{}' have a wcet, but no period", threads.name), "add 'period:'");
    } else if (wcet == nullptr && period != nullptr) {
      error(*period, fmt::format("threads '{}' have a period, but no wcet", threads.name), "add 'wcet:'");
    }
    if (threads.wcet > 0 && threads.period > 0 && threads.wcet > threads.period) {
      error(*wcet, fmt::format("wcet {} of threads '{}' exceeds their period {}", format_duration(threads.wcet),
                               threads.name, format_duration(threads.period)));
    }
  }

  std::optional<Level> read_level(const Node &node) {
    Level level;
    if (node.kind == Node::Kind::Scalar && (node.text == "above" || node.text == "below")) {
      level.kind = node.text == "above" ? Level::Kind::Above : Level::Kind::Below;
      return level;
    }
    if (node.kind != Node::Kind::Map) {
      unknown_choice(node, "level",
                     {"above", "below", "{task: PROCESS.DAG.TASK}", "{rate: PERIOD}", "{fifo: PRIORITY}",
                      "{nice: NICE}", "{reservation: {budget: TIME, period: TIME}}"});
      return std::nullopt;
    }
    if (!check_map(node, "level", {"task", "rate", "fifo", "nice", "reservation"})) return std::nullopt;
    if (node.children.size() != 2) {
      error(node, "level must have one of task, rate, fifo, nice and reservation");
      return std::nullopt;
    }
    const Node &value = node.children[1];
    bool is_read = false;
    if (find(node, "task") != nullptr) {
      level.kind = Level::Kind::Task;
      return take(node, "task", level.task, [this](const Node &at, auto key) { return read_task(at, key); })
                 ? std::optional(level)
                 : std::nullopt;
    }
    if (find(node, "reservation") != nullptr) {
      level.kind = Level::Kind::Reservation;
      is_read = read_reservation(value, level.reservation);
    } else if (find(node, "rate") != nullptr) {
      level.kind = Level::Kind::Rate;
      is_read = take(node, "rate", level.rate, [this](const Node &at, auto key) { return positive_duration(at, key); });
      if (robot_.policy == PolicyKind::Fixed) {
        error(value, "a rate has no place in an order by policy fixed", "use task, above, below or fifo");
        is_read = false;
      }
    } else {
      const bool fifo = find(node, "fifo") != nullptr;
      level.kind = fifo ? Level::Kind::Fifo : Level::Kind::Nice;
      is_read = take(node, fifo ? "fifo" : "nice", level.value, [&](const Node &at, auto key) {
        return integer<int>(at, key, fifo ? 1 : kLeastNice, fifo ? kMostFifo : kMostNice);
      });
    }
    return is_read ? std::optional(level) : std::nullopt;
  }

  bool read_reservation(const Node &node, Reservation &out) {
    if (!check_map(node, "reservation", {"budget", "period", "tick"})) return false;
    for (const char *key : {"budget", "period"}) {
      if (find(node, key) != nullptr) continue;
      error(node, fmt::format("the reservation has no '{}'", key), "write {budget: 2ms, period: 10ms}");
      return false;
    }
    const auto time = [this](const Node &at, auto key) { return positive_duration(at, key); };
    out.tick = kCoarsestTick;
    if (!take(node, "budget", out.budget, time) || !take(node, "period", out.period, time)) return false;
    if (find(node, "tick") != nullptr && !take(node, "tick", out.tick, time)) return false;
    const auto refuse_unless = [&](bool is_sound, const char *key, std::string message) {
      if (!is_sound) error(*find(node, key), std::move(message));
      return is_sound;
    };
    return refuse_unless(out.period >= kLeastReserved && out.period <= kMostReserved, "period",
                         fmt::format("the period of a reservation must be between {} and {}",
                                     format_duration(kLeastReserved), format_duration(kMostReserved))) &&
           refuse_unless(out.budget >= kLeastBudget && out.budget <= out.period, "budget",
                         fmt::format("the budget of a reservation must be between {} and its period {}",
                                     format_duration(kLeastBudget), format_duration(out.period))) &&
           refuse_unless(
               out.tick <= kCoarsestTick, "tick",
               fmt::format("the tick is at most {}, as no kernel has a longer one", format_duration(kCoarsestTick)));
  }

  // Finds "process.dag.task". Any of the names can contain dots.
  std::optional<TaskOf> read_task(const Node &node, std::string_view key) {
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

  // Reads the name of a CPU set, or processors.
  std::vector<int> read_cpus(const Node &node, std::size_t host) {
    if (const auto set = set_named(node)) {
      const CpuSet &found = robot_.cpu_sets[*set];
      if (found.host == host) return found.cpus;
      error(node,
            fmt::format("CPU set '{}' is on host '{}', and these are on host '{}'", found.name,
                        robot_.hosts[found.host], robot_.hosts[host]),
            "choose a CPU set of the same host");
      return {};
    }
    if (node.kind == Node::Kind::Scalar && !parse_cpu_list(node.text)) {
      if (is_broken_) return {};
      wrong_type(node, "cpus", "a CPU set or a list of processors such as 0-3");
      std::vector<std::string_view> names;
      for (const CpuSet &set : robot_.cpu_sets) names.emplace_back(set.name);
      diagnostics_.back().hint = did_you_mean(node.text, names, "");
      return {};
    }
    return cpus(node, "cpus").value_or(std::vector<int>{});
  }

  void read_interrupts(const Node &node) {
    Interrupts interrupts;
    interrupts.place = place_of(node);
    if (!check_map(node, "an entry of irqs", {"name", "match", "cpus", "host"}) ||
        !take_name(node, "an entry of irqs", names_of_interrupts_, robot_.interrupts.size(), interrupts.name)) {
      return;
    }
    if (find(node, "match") == nullptr) {
      error(node, fmt::format("irqs '{}' have no match", interrupts.name),
            "add 'match:' with a name from /proc/interrupts");
    }
    take_text(node, "match", interrupts.match);
    if (const Node *cpus_node = find(node, "cpus")) {
      interrupts.host = read_host_of(node, fmt::format("irqs '{}'", interrupts.name), std::nullopt);
      interrupts.cpus = read_cpus(*cpus_node, interrupts.host);
    } else {
      error(node, fmt::format("irqs '{}' have no cpus", interrupts.name), "add 'cpus:'");
    }
    robot_.interrupts.push_back(std::move(interrupts));
  }

  const Node &root_;
  LoadOptions options_;
  Robot robot_;
  Diagnostics of_other_files_;
  // Some entry is lost: names that are unknown may be its own.
  bool is_broken_ = false;
  Names names_of_hosts_;
  std::size_t host_ = 0;  // whose processors are read
  Names names_of_sets_;
  Names names_of_processes_;
  Names targets_;  // of links
  Names names_of_threads_;
  Names names_of_interrupts_;
  std::unordered_set<int> owned_;  // processors of the CPU sets of a host
  std::unordered_map<std::string, std::pair<std::size_t, TaskId>> tasks_;
};

}  // namespace

bool is_robot(const Node &root) { return root.kind == Node::Kind::Map && find(root, "robot") != nullptr; }

Result<LoadedRobot> read_robot(const Node &root, const std::string &file, LoadOptions options) {
  return RobotReader(root, file, options).run();
}

}  // namespace redag::robot
