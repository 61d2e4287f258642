// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "redag/base/cpu_list.hpp"
#include "redag/base/text.hpp"
#include "redag_lab/robot/cie.hpp"

namespace redag::robot::cie {
namespace {

using Policy = Attributes::Policy;

constexpr const char *kToDo = "TODO";
constexpr std::size_t kMostOfThreadName = 15;  // that the kernel keeps
constexpr int kBeforeAll = 100;                // priority of a group with SCHED_DEADLINE, above SCHED_FIFO

// A text as YAML, quoted where it could be something else.
std::string scalar(const std::string &text) {
  const bool is_plain =
      (text.front() == '/' || (std::isalpha(static_cast<unsigned char>(text.front())) != 0)) && !yaml::is_null(text) &&
      std::all_of(text.begin(), text.end(), [](char c) {
        return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '/' || c == '_' || c == '-' || c == '.';
      });
  return is_plain && text != kToDo ? text : nlohmann::json(text).dump();
}

// Priority of policy `fixed`: that of SCHED_FIFO, and below these one for each nice value.
int priority_of(const Attributes &attributes) {
  switch (attributes.policy) {
    case Policy::Deadline: return kBeforeAll;
    case Policy::Fifo:
    case Policy::RoundRobin: return attributes.value;
    case Policy::Idle: return -41;
    default: return -21 - attributes.value;
  }
}

// The parameters of a node: its services, and the topic of changes. They are no work of the robot.
bool is_of_parameters(const Entity &entity) {
  if (entity.kind == Callback::Kind::Subscription) return entity.name == "/parameter_events";
  if (entity.kind != Callback::Kind::Service) return false;
  constexpr std::array kServices = {"/get_parameters",      "/get_parameter_types",
                                    "/set_parameters",      "/set_parameters_atomically",
                                    "/describe_parameters", "/list_parameters"};
  return std::any_of(kServices.begin(), kServices.end(), [&](const char *end) { return entity.name.ends_with(end); });
}

const char *kind_name(Callback::Kind kind) {
  switch (kind) {
    case Callback::Kind::Subscription: return "subscription";
    case Callback::Kind::Service: return "service";
    case Callback::Kind::Client: return "client";
    default: return "timer";
  }
}

// Makes a name that `taken` does not have yet, and adds it.
std::string unique(std::string name, std::set<std::string> &taken) {
  std::string candidate = name;
  for (int i = 2; !taken.insert(candidate).second; ++i) candidate = fmt::format("{}_{}", name, i);
  return candidate;
}

class Writer {
 public:
  Writer(const Configuration &configuration, const std::string &source)
      : configuration_(configuration), source_(source) {}

  Imported run() {
    for (const Group &group : configuration_.groups) nodes_[{group.domain, group.node}].push_back(&group);
    find_cpu_sets();
    write_head();
    for (const auto &[key, groups] : nodes_) write_process(key.first, key.second, groups);
    if (nodes_.empty()) line("  - {{name: {}, match: {}}}  # the configuration has no callback groups", todo(), todo());
    write_threads();
    write_interrupts();
    if (parameters_ > 0) {
      imported_.remarks.push_back(fmt::format(
          "left out: {} callbacks for parameters of nodes, which get the default period of the executor", parameters_));
    }
    return std::move(imported_);
  }

 private:
  template <class... Parts>
  void line(fmt::format_string<Parts...> format, Parts &&...parts) {
    fmt::format_to(std::back_inserter(imported_.text), format, std::forward<Parts>(parts)...);
    imported_.text += '\n';
  }

  const char *todo() {
    ++imported_.to_fill_in;
    return kToDo;
  }

  // Nodes whose processors overlap share a CPU set.
  void find_cpu_sets() {
    for (const auto &[key, groups] : nodes_) {
      std::set<int> cpus;
      for (const Group *group : groups) cpus.insert(group->attributes.cpus.begin(), group->attributes.cpus.end());
      if (cpus.empty()) {
        has_free_node_ = true;
        continue;
      }
      for (auto other = cpu_sets_.begin(); other != cpu_sets_.end();) {
        const bool meets = std::any_of(other->begin(), other->end(), [&](int cpu) { return cpus.contains(cpu); });
        if (meets) cpus.insert(other->begin(), other->end());
        other = meets ? cpu_sets_.erase(other) : other + 1;
      }
      cpu_sets_.push_back(std::move(cpus));
    }
    std::sort(cpu_sets_.begin(), cpu_sets_.end());
  }

  static std::string text_of(const std::set<int> &cpus) { return format_cpu_list({cpus.begin(), cpus.end()}); }
  [[nodiscard]] bool has_cpu_sets() const { return cpu_sets_.size() + (has_free_node_ ? 1 : 0) > 1; }

  void write_head() {
    line("# Made by 'redag import' from {}, a configuration of callback_isolated_executor.", printable(source_));
    line("# {} stands for what the configuration does not say. 'redag validate' names each such line.", kToDo);
    line("robot: imported");
    line("policy: fixed  # by the priorities of the configuration; with rate_monotonic, the rates decide");
    if (cpu_sets_.empty()) {
      line("cpus: {}  # the processors that all processes share, such as 0-3", todo());
    } else if (!has_cpu_sets()) {
      line("cpus: \"{}\"", text_of(cpu_sets_.front()));
    } else {
      line("cpu_sets:");
      for (const std::set<int> &cpus : cpu_sets_) line(R"(  - {{name: "cpus {0}", cpus: "{0}"}})", text_of(cpus));
    }
    line("# A process for each node: move the DAGs of nodes that share a container into one process.");
    line("processes:");
  }

  void write_process(int domain, const std::string &node, const std::vector<const Group *> &groups) {
    const std::string where = domain == 0 ? "" : fmt::format("  # ROS_DOMAIN_ID {}", domain);
    const std::string name = unique(node.substr(1), processes_);
    line("  - name: {}{}", scalar(name), where);
    line("    match: {}  # such as {{command: \"*__node:={}*\"}}", todo(), node.substr(node.rfind('/') + 1));
    if (has_cpu_sets()) write_set_of(groups);
    std::string tasks;
    tasks.swap(imported_.text);
    write_tasks(node, groups);
    tasks.swap(imported_.text);
    if (tasks.empty()) return;  // only parameters
    line("    workload:");
    line("      policy: fixed");
    line("      platform: {{preemption: os}}");
    line("      dags:");
    line("        - name: {}", scalar(name));
    line("          tasks:");
    imported_.text += tasks;
  }

  void write_set_of(const std::vector<const Group *> &groups) {
    for (const Group *group : groups) {
      if (group->attributes.cpus.empty()) continue;
      const auto set = std::find_if(cpu_sets_.begin(), cpu_sets_.end(), [&](const std::set<int> &cpus) {
        return cpus.contains(group->attributes.cpus.front());
      });
      return line("    cpus: \"cpus {}\"", text_of(*set));
    }
    line("    cpus: {}  # one of the CPU sets", todo());
  }

  void write_tasks(const std::string &node, const std::vector<const Group *> &groups) {
    std::set<std::string> names;
    int exclusive = 0;
    for (const Group *group : groups) {
      std::vector<Entity> entities;  // one of several timers with the same period: a task has all of them
      for (const Entity &entity : group->entities) {
        if (is_of_parameters(entity)) {
          ++parameters_;
        } else if (std::find(entities.begin(), entities.end(), entity) == entities.end()) {
          entities.push_back(entity);
        }
      }
      if (entities.empty() && !group->entities.empty()) continue;
      line("            # line {}: {}", group->line, to_string(group->attributes));
      std::string rest = fmt::format("priority: {}", priority_of(group->attributes));
      if (entities.size() > 1) rest += fmt::format(", group: group_{}", ++exclusive);
      if (group->all_of_node) {
        line("            # all other callbacks of the node; the executor gives them its default period");
        line("            - {{name: {}, wcet: {}, period: {}, {}}}", unique("others", names), todo(), todo(), rest);
      } else if (entities.empty()) {
        write_task(unique("waitables", names), group->attributes, 0, rest, node, "waitable: any");
      }
      for (const Entity &entity : entities) {
        const bool is_timer = entity.kind == Callback::Kind::Timer;
        const std::string what = is_timer ? format_duration(entity.period) : entity.name.substr(1);
        const std::string callback =
            fmt::format("{}: {}", kind_name(entity.kind), is_timer ? what : scalar(entity.name));
        write_task(unique(fmt::format("{}_{}", kind_name(entity.kind), what), names), group->attributes, entity.period,
                   rest, node, callback);
      }
    }
  }

  // A group with SCHED_DEADLINE states what its job needs at most, how often, and by when.
  void write_task(const std::string &name, const Attributes &attributes, Duration period, const std::string &rest,
                  const std::string &node, const std::string &callback) {
    const bool has_times = attributes.policy == Policy::Deadline;
    if (period == 0 && has_times) period = attributes.period;
    std::string text =
        fmt::format("{{name: {}, wcet: {}, ", scalar(name), has_times ? format_duration(attributes.runtime) : todo());
    text += fmt::format("period: {}, ", period > 0 ? format_duration(period) : todo());
    if (has_times) text += fmt::format("deadline: {}, ", format_duration(attributes.deadline));
    line("            - {}{}, callback: {{node: {}, {}}}}}", text, rest, scalar(node), callback);
  }

  void write_threads() {
    if (configuration_.threads.empty() && configuration_.kernel_threads.empty()) return;
    line("threads:");
    std::set<std::string> names;
    for (const Thread &thread : configuration_.threads) write_thread(thread, names);
    for (const Thread &thread : configuration_.kernel_threads) write_thread(thread, names);
  }

  void write_thread(const Thread &thread, std::set<std::string> &names) {
    const Attributes &attributes = thread.attributes;
    line("  # line {}: {}", thread.line, thread.has_policy ? to_string(attributes) : "its processors");
    const bool is_reservation = attributes.policy == Policy::Deadline;
    std::string text = fmt::format("{{name: {}, match: {{thread: {}}}", scalar(unique(thread.name, names)),
                                   scalar(thread.name.substr(0, kMostOfThreadName)));
    if (thread.has_policy) text += ", " + level_of(attributes);
    if (!attributes.cpus.empty() && !is_reservation)
      text += fmt::format(", cpus: \"{}\"", format_cpu_list(attributes.cpus));
    line("  - {}}}", text);
    if (is_reservation && !attributes.cpus.empty()) {
      imported_.remarks.push_back(
          fmt::format("{}:{}: thread {} may run on all processors: Linux pins no thread that has "
                      "a reservation",
                      printable(source_), thread.line, in_quotes(thread.name)));
    }
  }

  // Threads keep their place among the tasks, whose priorities become those of the robot.
  std::string level_of(const Attributes &attributes) {
    switch (attributes.policy) {
      case Policy::Other:
      case Policy::Batch: return fmt::format("level: {{nice: {}}}", attributes.value);
      case Policy::Idle: return "level: {nice: 19}";
      case Policy::Deadline:
        if (attributes.deadline != attributes.period) return fmt::format("level: {}", todo());
        return fmt::format("level: {{reservation: {{budget: {}, period: {}}}}}", format_duration(attributes.runtime),
                           format_duration(attributes.period));
      default: break;
    }
    const auto none = [&](const auto &holds) {
      return std::none_of(configuration_.groups.begin(), configuration_.groups.end(),
                          [&](const Group &group) { return holds(priority_of(group.attributes)); });
    };
    if (none([&](int priority) { return priority >= attributes.value; })) {
      return fmt::format("level: above, wcet: {}, period: {}", todo(), todo());
    }
    if (none([&](int priority) { return priority <= attributes.value; })) return "level: below";
    return fmt::format("level: {}", todo());
  }

  void write_interrupts() {
    if (!configuration_.interrupts.empty()) line("irqs:");
    std::set<std::string> names;
    for (const Interrupt &interrupt : configuration_.interrupts) {
      line(R"(  - {{name: {}, match: "{}", cpus: "{}"}})", unique(fmt::format("irq_{}", interrupt.number), names),
           interrupt.number, format_cpu_list(interrupt.cpus));
    }
  }

  const Configuration &configuration_;
  const std::string &source_;
  Imported imported_;
  std::map<std::pair<int, std::string>, std::vector<const Group *>> nodes_;  // by domain and name
  std::vector<std::set<int>> cpu_sets_;                                      // share no processors
  bool has_free_node_ = false;                                               // which may run on all processors
  std::set<std::string> processes_;
  std::size_t parameters_ = 0;  // callbacks that are left out
};

}  // namespace

Imported as_robot(const Configuration &configuration, const std::string &source) {
  return Writer(configuration, source).run();
}

}  // namespace redag::robot::cie
