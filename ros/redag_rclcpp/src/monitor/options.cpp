// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_rclcpp/options.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "parameter_reader.hpp"
#include "rclcpp/exceptions.hpp"
#include "rclcpp/logging.hpp"
#include "redag/derived/clusters.hpp"
#include "redag/loader/validate.hpp"
#include "redag/loader/workload_yaml.hpp"
#include "redag/threads/threads.hpp"

namespace redag_rclcpp {
namespace {

using rclcpp::ParameterType;
using rclcpp::ParameterValue;
using std::chrono::nanoseconds;

constexpr std::int64_t kMostThreads = 4096;
constexpr std::size_t kTraceCapacity = std::size_t{1} << 14;  // events per ring; the monitor empties them every 50 ms

constexpr std::array kModes = {redag::PreemptionMode::Auto, redag::PreemptionMode::None,
                               redag::PreemptionMode::Cooperative, redag::PreemptionMode::Os};

template <class Values>
std::string names_of(const Values &values) {
  std::string text = "one of";
  for (const auto value : values) text += fmt::format("{} {}", value == values.front() ? "" : ",", to_string(value));
  return text;
}

std::vector<int> read_cpus(ParameterReader &reader) {
  const ParameterSpec spec{
      "cpu_affinity",
      "Processors that the workers may use; empty: those of `config`, or all that the process may use (with "
      "preemption os, as many of them as there are workers)",
      "a list of processors that the process may use"};
  const ParameterValue value = reader.value(spec, ParameterValue(std::vector<std::int64_t>{}));
  if (value.get_type() != ParameterType::PARAMETER_INTEGER_ARRAY) refuse(spec.name, value, spec.allowed);
  const std::vector<int> usable = redag::runtime::usable_cpus();
  std::vector<int> cpus;
  for (const std::int64_t cpu : value.get<std::vector<std::int64_t>>()) {
    const bool known = std::any_of(usable.begin(), usable.end(), [&](int other) { return other == cpu; });
    const bool twice = std::any_of(cpus.begin(), cpus.end(), [&](int other) { return other == cpu; });
    if (!known || twice) {
      refuse(spec.name, value, spec.allowed + fmt::format(" ({}), each at most once", fmt::join(usable, ", ")));
    }
    cpus.push_back(static_cast<int>(cpu));
  }
  return cpus;
}

/// rclcpp's containers name the number of their threads `thread_num`. The component manager declares it with a default
/// of its own. Only a value that the user states counts.
std::uint32_t read_thread_num(rclcpp::Node &node, std::uint32_t workers) {
  const auto &given = node.get_node_parameters_interface()->get_parameter_overrides();
  const auto thread_num = given.find("thread_num");
  if (thread_num == given.end()) return workers;
  const ParameterValue &value = thread_num->second;
  const std::string allowed = fmt::format("a whole number from 1 to {}", kMostThreads);
  if (value.get_type() != ParameterType::PARAMETER_INTEGER) refuse("thread_num", value, allowed);
  const auto number = value.get<std::int64_t>();
  if (number < 1 || number > kMostThreads) refuse("thread_num", value, allowed);
  if (given.count("workers") != 0 && number != std::int64_t{workers}) {
    refuse("thread_num", value, fmt::format("the same as 'workers' ({}), or left out", workers));
  }
  return static_cast<std::uint32_t>(number);
}

void read_config(rclcpp::Node &node, ParameterReader &reader, ReDAGOptions &options) {
  const ParameterSpec spec{"config", "Workload file that maps callbacks to the tasks of DAGs; empty: none",
                           "the path of a workload file (docs/workload_format.md)"};
  const std::string path = reader.text(spec, "");
  if (path.empty()) return;
  redag::Result<redag::LoadedWorkload> loaded = redag::load_workload(path, {.wcet_optional = true, .waits = true});
  if (loaded) {
    // A process has one executor.
    if (auto one = redag::refuse_clusters(loaded->workload, "the ROS 2 executor"); !one) {
      loaded = tl::unexpected(std::move(one.error()));
    }
  }
  if (!loaded) {
    throw rclcpp::exceptions::InvalidParameterValueException(
        fmt::format("parameter 'config' is {}:\n{}", path, to_string(loaded.error())));
  }
  for (const redag::Diagnostic &warning : loaded->warnings) {
    RCLCPP_WARN(node.get_logger(), "%s", warning.to_string().c_str());
  }
  const redag::Workload &workload = loaded->workload;
  // If the file does not state the number, the parameter counts, and not the format's default.
  if (options.workers == 0 && loaded->states_workers) options.workers = workload.platform.workers;
  if (options.cpus.empty()) {
    options.cpus = workload.platform.cpus;
    if (const auto cpu = redag::runtime::unusable_cpu(options.cpus)) {
      throw rclcpp::exceptions::InvalidParameterValueException(
          fmt::format("parameter 'config' is {}, whose platform has processor {}; usable processors are {}", path, *cpu,
                      fmt::join(redag::runtime::usable_cpus(), ", ")));
    }
  }
  if (options.preemption == redag::PreemptionMode::Auto) options.preemption = workload.platform.preemption;
  options.workload = redag::validated(std::move(loaded->workload)).value();  // the loader has found no mistake
}

bool has_all_wcets(const redag::Workload &workload) {
  const auto refs = redag::flatten(workload);
  return !refs.empty() && std::all_of(refs.begin(), refs.end(), [](const auto &ref) { return ref.task->wcet > 0; });
}

}  // namespace

ReDAGOptions declare_options(rclcpp::Node &node) {
  ParameterReader reader(node);
  ReDAGOptions options;
  options.workers = static_cast<std::uint32_t>(reader.integer(
      {"workers",
       "Number of workers: callbacks that execute at the same time; 0: the value in `config`, or one per processor",
       fmt::format("a whole number from 0 to {}", kMostThreads)},
      0, 0, kMostThreads));
  options.workers = read_thread_num(node, options.workers);
  options.preemption = reader.one_of(
      {"preemption",
       "Preemption mode; auto: the mode in `config`, or os if the process has real-time rights, or else cooperative",
       names_of(kModes)},
      kModes);
  const ParameterSpec threads{"threads",
                              "Callbacks that can be started and unfinished at once: threads with preemption os, "
                              "otherwise workers and callbacks "
                              "in a redag::Blocking; 0: with os workers + 16, otherwise as many as workers",
                              fmt::format("0, or a whole number from the number of workers to {}", kMostThreads)};
  options.threads = static_cast<std::uint32_t>(reader.integer(threads, 0, 0, kMostThreads));
  options.cpus = read_cpus(reader);
  read_config(node, reader, options);
  if (options.threads > 0 && options.threads < options.workers) {
    refuse(threads.name, ParameterValue(std::int64_t{options.threads}),
           threads.allowed + fmt::format(" (there are {} workers)", options.workers));
  }
  options.default_period = reader.seconds(
      {"default_period",
       "Period in seconds, for the priority of callbacks whose period neither `config` nor a timer states",
       "a number of seconds above 0"},
      0.1, false);
  options.learn = reader.seconds(
      {"learn", "Seconds from its first message in which the rate of a callback is learned, and edges; 0: no learning",
       "a number of seconds of at least 0"},
      10.0, true);
  options.raise_middleware = reader.flag(
      {"raise_middleware",
       "With preemption os, give the middleware's threads that deliver messages a higher priority than the workers",
       "true or false"},
      true);
  options.lock_memory = reader.flag({"lock_memory",
                                     "Lock the memory of the process and touch the stacks of its threads in advance, "
                                     "to avoid page faults in callbacks",
                                     "true or false"},
                                    false);
  options.watchdog = reader.seconds(
      {"watchdog",
       "Warn about callbacks that are in progress for longer than these seconds, while they still run; 0: no warnings",
       "a number of seconds of at least 0"},
      0.0, true);
  const bool counts_responses = reader.bounds() && options.workload && has_all_wcets(**options.workload);
  if (!reader.trace().empty() || counts_responses) options.trace_capacity = kTraceCapacity;
  return options;
}

}  // namespace redag_rclcpp
