// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <set>
#include <unordered_set>
#include <utility>

#include "redag/base/cpu_list.hpp"
#include "redag/base/text.hpp"
#include "redag/model/callback_match.hpp"
#include "redag/model/validate.hpp"
#include "redag/model/workload_yaml.hpp"
#include "redag/model/workload_yaml_values.hpp"
#include "redag_lab/robot/cie.hpp"

namespace redag::robot::cie {
namespace {

using yaml::find;
using yaml::Node;
using Policy = Attributes::Policy;

constexpr std::array<std::pair<const char *, Policy>, 6> kPolicies = {{{"SCHED_OTHER", Policy::Other},
                                                                       {"SCHED_BATCH", Policy::Batch},
                                                                       {"SCHED_IDLE", Policy::Idle},
                                                                       {"SCHED_FIFO", Policy::Fifo},
                                                                       {"SCHED_RR", Policy::RoundRobin},
                                                                       {"SCHED_DEADLINE", Policy::Deadline}}};
// What a scan of the system writes where nothing can be set.
constexpr std::string_view kUnmanageable = "UNMANAGEABLE";
constexpr int kMostFifo = 99;
constexpr int kLeastNice = -20;
constexpr int kMostNice = 19;
constexpr int kMostDomain = 232;  // the highest that DDS has ports for

bool is_unset(const Node *node) {
  return node == nullptr || node->kind == Node::Kind::Null ||
         (node->kind == Node::Kind::Scalar && node->text == kUnmanageable);
}

class Reader : private yaml::ValueReader {
 public:
  Reader(const Node &root, const std::string &file) : ValueReader(file), root_(root) {}

  Result<Configuration> run() {
    if (check_map(root_, "a configuration of callback_isolated_executor",
                  {"hardware_info", "rt_throttling", "callback_groups", "non_ros_threads", "kernel_threads", "irqs"})) {
      for_each("callback_groups", [this](const Node &node) { read_group(node); });
      for_each("non_ros_threads", [this](const Node &node) { read_thread(node, "name", read_.threads, names_); });
      for_each("kernel_threads",
               [this](const Node &node) { read_thread(node, "comm", read_.kernel_threads, kernel_names_); });
      for_each("irqs", [this](const Node &node) { read_interrupt(node); });
      if (find(root_, "callback_groups") == nullptr && find(root_, "non_ros_threads") == nullptr) {
        error(root_,
              "this is no configuration of callback_isolated_executor: it has neither 'callback_groups' nor "
              "'non_ros_threads'");
      }
    }
    Diagnostics found = take_diagnostics();
    if (has_errors(found)) return tl::unexpected<Diagnostics>(std::move(found));
    return std::move(read_);
  }

 private:
  template <class Read>
  void for_each(const char *section, Read read) {
    const Node *list = find(root_, section);
    if (is_unset(list)) return;
    if (list->kind != Node::Kind::Sequence) return wrong_type(*list, section, "a list");
    for (const Node &entry : list->children) read(entry);
  }

  void read_group(const Node &node) {
    Group group;
    group.line = node.line;
    if (!check_map(node, "a callback group",
                   {"id", "domain_id", "affinity", "policy", "priority", "nice", "runtime", "period", "deadline"})) {
      return;
    }
    const Node *id = find(node, "id");
    if (id == nullptr || id->kind != Node::Kind::Scalar || id->text.empty()) {
      error(id == nullptr ? node : *id, "a callback group needs its id", "such as '/node@Timer(10000000)'");
      return;
    }
    if (const Node *domain = find(node, "domain_id"); !is_unset(domain)) {
      group.domain = integer<int>(*domain, "domain_id", 0, kMostDomain).value_or(0);
    }
    if (!ids_.emplace(group.domain, id->text).second) {
      error(*id, fmt::format("callback group {} is listed twice", in_quotes(id->text)), "remove one of the entries");
    }
    read_id(*id, group);
    read_attributes(node, group.attributes);
    read_.groups.push_back(std::move(group));
  }

  // An id is a node and its callbacks, "/node@Subscription(/topic)@Timer(10000000)", or "/node/*".
  void read_id(const Node &id, Group &group) {
    std::string_view rest = id.text;
    group.node = rest.substr(0, rest.find('@'));
    group.all_of_node = group.node == rest && rest.ends_with("/*");
    if (group.all_of_node) group.node.resize(group.node.size() - 2);
    if (group.node.find('*') != std::string::npos) {
      return error(id, fmt::format("'*' in {} stands for nothing", in_quotes(group.node)),
                   "an id for all groups of a node ends with '/*', as in '/planner/*'");
    }
    if (!check_ros_name(id, group.node)) return;
    rest.remove_prefix(std::min(rest.find('@'), rest.size()));
    while (!rest.empty()) {
      rest.remove_prefix(1);  // '@'
      const std::string_view part = rest.substr(0, rest.find('@'));
      rest.remove_prefix(part.size());
      if (!read_entity(id, part, group)) return;
    }
  }

  bool read_entity(const Node &id, std::string_view part, Group &group) {
    if (part == "Waitable") return true;  // ids of earlier versions list them
    constexpr std::array<std::pair<std::string_view, Callback::Kind>, 4> kKinds = {
        {{"Subscription", Callback::Kind::Subscription},
         {"Service", Callback::Kind::Service},
         {"Client", Callback::Kind::Client},
         {"Timer", Callback::Kind::Timer}}};
    const std::size_t open = part.find('(');
    const auto *const kind = std::find_if(kKinds.begin(), kKinds.end(),
                                          [&](const auto &each) { return each.first == part.substr(0, open); });
    if (open == std::string_view::npos || !part.ends_with(')') || kind == kKinds.end()) {
      error(id, fmt::format("{} in the id of a callback group is no callback", in_quotes(part)),
            "known are Subscription(TOPIC), Service(NAME), Client(NAME), Timer(NANOSECONDS) and Waitable");
      return false;
    }
    const std::string_view argument = part.substr(open + 1, part.size() - open - 2);
    Entity entity{.kind = kind->second, .name = {}};
    if (entity.kind != Callback::Kind::Timer) {
      entity.name = argument;
      if (!check_ros_name(id, entity.name)) return false;
    } else if (const auto [end, code] =
                   std::from_chars(argument.data(), argument.data() + argument.size(), entity.period);
               code != std::errc() || end != argument.data() + argument.size() || entity.period < 1 ||
               entity.period > kMaxDuration) {
      error(id, fmt::format("the period of {} is no number of nanoseconds", in_quotes(part)),
            "such as Timer(10000000)");
      return false;
    }
    group.entities.push_back(std::move(entity));
    return true;
  }

  bool check_ros_name(const Node &at, const std::string &name) {
    std::string why = name_mistake(name);
    if (why.empty()) why = ros_name_mistake(name);
    if (why.empty() && name.find_first_of("*?") != std::string::npos) why = "contains a '*' or '?'";
    if (!why.empty()) error(at, fmt::format("the name {} {}", in_quotes(name), why));
    return why.empty();
  }

  // A thread of a program must have a policy; one that a scan has listed need not.
  void read_thread(const Node &node, const char *key, std::vector<Thread> &threads,
                   std::unordered_set<std::string> &names) {
    Thread thread;
    thread.line = node.line;
    const bool is_scanned = &threads == &read_.kernel_threads;
    // The first versions called the name of a thread 'id'.
    if (!check_map(node, "a thread",
                   {key, is_scanned ? key : "id", "affinity", "policy", "priority", "nice", "runtime", "period",
                    "deadline"})) {
      return;
    }
    const Node *name = find(node, key);
    if (name == nullptr && !is_scanned) name = find(node, "id");
    if (name == nullptr) return error(node, fmt::format("a thread needs its '{}'", key));
    const std::optional<std::string> read = text(*name, key);
    if (!read) return;
    thread.name = *read;
    if (!names.insert(thread.name).second) {
      error(*name, fmt::format("thread {} is listed twice", in_quotes(thread.name)), "remove one of the entries");
    }
    thread.has_policy = !is_scanned || !is_unset(find(node, "policy"));
    if (thread.has_policy) {
      read_attributes(node, thread.attributes);
    } else {
      read_affinity(node, thread.attributes);
    }
    if (thread.has_policy || !thread.attributes.cpus.empty()) threads.push_back(std::move(thread));
  }

  void read_interrupt(const Node &node) {
    Interrupt interrupt;
    interrupt.line = node.line;
    if (!check_map(node, "an interrupt", {"irq", "name", "affinity"})) return;
    const Node *number = find(node, "irq");
    if (number == nullptr) return error(node, "an interrupt needs its number", "add 'irq:'");
    const std::optional<int> read = integer<int>(*number, "irq", 0);
    if (!read) return;
    interrupt.number = *read;
    Attributes attributes;
    read_affinity(node, attributes);
    interrupt.cpus = std::move(attributes.cpus);
    if (!interrupt.cpus.empty()) read_.interrupts.push_back(std::move(interrupt));
  }

  void read_affinity(const Node &node, Attributes &attributes) {
    const Node *affinity = find(node, "affinity");
    if (is_unset(affinity) || (affinity->kind == Node::Kind::Sequence && affinity->children.empty())) return;
    attributes.cpus = cpus(*affinity, "affinity").value_or(std::vector<int>{});
  }

  void read_attributes(const Node &node, Attributes &attributes) {
    read_affinity(node, attributes);
    const Node *policy = find(node, "policy");
    if (policy == nullptr) return error(node, "the entry has no policy", "add 'policy: SCHED_OTHER'");
    const auto *const found = std::find_if(kPolicies.begin(), kPolicies.end(), [&](const auto &each) {
      return policy->kind == Node::Kind::Scalar && policy->text == each.first;
    });
    if (found == kPolicies.end()) {
      std::vector<std::string_view> names;
      names.reserve(kPolicies.size());
      for (const auto &[name, value] : kPolicies) names.emplace_back(name);
      return unknown_choice(*policy, "policy", names);
    }
    attributes.policy = found->second;
    if (attributes.policy == Policy::Deadline) {
      read_time(node, "runtime", attributes.runtime);
      read_time(node, "period", attributes.period);
      read_time(node, "deadline", attributes.deadline);
      return;
    }
    const bool is_real_time = attributes.policy == Policy::Fifo || attributes.policy == Policy::RoundRobin;
    // Ordinary threads have a nice value, which the first versions call 'priority'.
    const Node *value = is_real_time ? nullptr : find(node, "nice");
    const char *const key = value != nullptr ? "nice" : "priority";
    if (value == nullptr) value = find(node, "priority");
    if (is_unset(value)) {
      return error(node, fmt::format("an entry with {} needs '{}'", found->first, is_real_time ? "priority" : "nice"));
    }
    attributes.value =
        integer<int>(*value, key, is_real_time ? 1 : kLeastNice, is_real_time ? kMostFifo : kMostNice).value_or(0);
  }

  void read_time(const Node &node, const char *key, Duration &out) {
    const Node *value = find(node, key);
    if (is_unset(value))
      return error(node, fmt::format("an entry with SCHED_DEADLINE needs '{}', in nanoseconds", key));
    out = integer<Duration>(*value, key, 1, kMaxDuration).value_or(0);
  }

  const Node &root_;
  Configuration read_;
  std::set<std::pair<int, std::string>> ids_;
  std::unordered_set<std::string> names_;
  std::unordered_set<std::string> kernel_names_;
};

}  // namespace

std::string to_string(const Attributes &attributes) {
  const auto *const found = std::find_if(kPolicies.begin(), kPolicies.end(),
                                         [&](const auto &each) { return each.second == attributes.policy; });
  std::string text = found->first;
  switch (attributes.policy) {
    case Policy::Fifo:
    case Policy::RoundRobin: text += fmt::format(" {}", attributes.value); break;
    case Policy::Deadline:
      text += fmt::format(", {} in {}", format_duration(attributes.runtime), format_duration(attributes.period));
      break;
    default:
      if (attributes.value != 0) text += fmt::format(" with nice {}", attributes.value);
  }
  if (!attributes.cpus.empty()) text += fmt::format(" on processors {}", format_cpu_list(attributes.cpus));
  return text;
}

Result<Configuration> read_configuration(const yaml::Node &root, const std::string &file) {
  return Reader(root, file).run();
}

Result<Imported> import_robot(std::string_view text, const std::string &file) {
  if (text.size() > kMaxWorkloadBytes) {
    return tl::unexpected(Diagnostics{
        {Severity::Error, file, 0, 0, fmt::format("the file is longer than {} bytes", kMaxWorkloadBytes), {}}});
  }
  const Result<Node> root = yaml::parse(text, file);
  if (!root) return tl::unexpected<Diagnostics>(root.error());
  const Result<Configuration> read = read_configuration(*root, file);
  if (!read) return tl::unexpected<Diagnostics>(read.error());
  return as_robot(*read, file);
}

}  // namespace redag::robot::cie
