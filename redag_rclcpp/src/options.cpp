// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_rclcpp/options.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <string_view>
#include <vector>

#include "rclcpp/exceptions.hpp"
#include "rclcpp/logging.hpp"
#include "redag/model/clusters.hpp"
#include "redag/model/validate.hpp"
#include "redag/model/workload_yaml.hpp"
#include "redag/runtime/threads.hpp"

namespace redag_rclcpp {
namespace {

using rclcpp::ParameterType;
using rclcpp::ParameterValue;
using std::chrono::nanoseconds;

constexpr std::int64_t kMostThreads = 4096;
constexpr std::int64_t kMostTraceEvents = 1'000'000'000;
constexpr double kMostSeconds = 1e6;                          // eleven days: a larger value has the wrong unit
constexpr std::size_t kTraceCapacity = std::size_t{1} << 14;  // events per ring; the monitor empties them every 50 ms

constexpr std::array kModes = {redag::PreemptionMode::Auto, redag::PreemptionMode::None,
                               redag::PreemptionMode::Cooperative, redag::PreemptionMode::Os};
constexpr std::array kPolicies = {redag::PolicyKind::RateMonotonic, redag::PolicyKind::DeadlineMonotonic,
                                  redag::PolicyKind::Fixed,         redag::PolicyKind::Edf,
                                  redag::PolicyKind::Fifo,          redag::PolicyKind::ChainAware};
constexpr std::array kTies = {redag::Ties::Share, redag::Ties::Fixed};

[[noreturn]] void refuse(const char *name, const ParameterValue &value, const std::string &allowed) {
  throw rclcpp::exceptions::InvalidParameterValueException(
      fmt::format("parameter '{}' is {}, but must be {}", name, rclcpp::to_string(value), allowed));
}

struct Spec {
  const char *name;
  const char *description;
  std::string allowed;
};

/// Declares and reads parameters. It checks types and values itself, to give one message for both mistakes.
class Reader {
 public:
  explicit Reader(rclcpp::Node &node) : node_(node) {}

  ParameterValue value(const Spec &spec, const ParameterValue &initial, bool read_only = true) {
    if (!node_.has_parameter(spec.name)) {
      rcl_interfaces::msg::ParameterDescriptor descriptor;
      descriptor.description = spec.description;
      descriptor.additional_constraints = spec.allowed;
      descriptor.read_only = read_only;
      descriptor.dynamic_typing = true;  // accepts 5 for 5.0; read functions reject other types
      node_.declare_parameter(spec.name, initial, descriptor);
    }
    return node_.get_parameter(spec.name).get_parameter_value();
  }

  std::int64_t integer(const Spec &spec, std::int64_t initial, std::int64_t least, std::int64_t most) {
    const ParameterValue value = this->value(spec, ParameterValue(initial));
    if (value.get_type() != ParameterType::PARAMETER_INTEGER) refuse(spec.name, value, spec.allowed);
    const auto number = value.get<std::int64_t>();
    if (number < least || number > most) refuse(spec.name, value, spec.allowed);
    return number;
  }

  bool flag(const Spec &spec, bool initial) {
    const ParameterValue value = this->value(spec, ParameterValue(initial));
    if (value.get_type() != ParameterType::PARAMETER_BOOL) refuse(spec.name, value, spec.allowed);
    return value.get<bool>();
  }

  std::string text(const Spec &spec, const std::string &initial, bool read_only = true) {
    const ParameterValue value = this->value(spec, ParameterValue(initial), read_only);
    if (value.get_type() != ParameterType::PARAMETER_STRING) refuse(spec.name, value, spec.allowed);
    return value.get<std::string>();
  }

  nanoseconds seconds(const Spec &spec, double initial, bool may_be_zero) {
    const ParameterValue value = this->value(spec, ParameterValue(initial));
    double number = 0;
    if (value.get_type() == ParameterType::PARAMETER_DOUBLE) {
      number = value.get<double>();
    } else if (value.get_type() == ParameterType::PARAMETER_INTEGER) {
      number = static_cast<double>(value.get<std::int64_t>());
    } else {
      refuse(spec.name, value, spec.allowed);
    }
    const bool fits = number == 0 ? may_be_zero : number >= 1e-9 && number <= kMostSeconds;
    if (!fits) refuse(spec.name, value, spec.allowed);
    return nanoseconds(std::llround(number * 1e9));
  }

  /// The first word is the default.
  std::string word(const char *name, const char *description, const std::vector<std::string> &words) {
    const Spec spec{name, description, fmt::format("one of {}", fmt::join(words, ", "))};
    const ParameterValue value = this->value(spec, ParameterValue(words.front()));
    if (value.get_type() != ParameterType::PARAMETER_STRING) refuse(name, value, spec.allowed);
    if (std::find(words.begin(), words.end(), value.get<std::string>()) == words.end()) {
      refuse(name, value, spec.allowed);
    }
    return value.get<std::string>();
  }

  template <class Values>
  typename Values::value_type one_of(const Spec &spec, const Values &values) {
    const ParameterValue value = this->value(spec, ParameterValue(std::string(to_string(values.front()))));
    if (value.get_type() == ParameterType::PARAMETER_STRING) {
      for (const auto candidate : values) {
        if (value.get<std::string>() == to_string(candidate)) return candidate;
      }
    }
    refuse(spec.name, value, spec.allowed);
  }

 private:
  rclcpp::Node &node_;
};

template <class Values>
std::string names_of(const Values &values) {
  std::string text = "one of";
  for (const auto value : values) text += fmt::format("{} {}", value == values.front() ? "" : ",", to_string(value));
  return text;
}

std::vector<int> read_cpus(Reader &reader) {
  const Spec spec{
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

void read_config(rclcpp::Node &node, Reader &reader, ReDAGOptions &options) {
  const Spec spec{"config", "Workload file that maps callbacks to the tasks of DAGs; empty: none",
                  "the path of a workload file (docs/workload_format.md)"};
  const std::string path = reader.text(spec, "");
  if (path.empty()) return;
  redag::Result<redag::LoadedWorkload> loaded = redag::load_workload(path, {.wcet_optional = true});
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
  if (options.policy == redag::PolicyKind::RateMonotonic) options.policy = workload.policy;
  if (options.ties == redag::Ties::Share) options.ties = workload.ties;
  if (options.devices.empty()) options.devices = workload.platform.devices;
  options.workload = std::move(loaded->workload);
}

bool has_all_wcets(const redag::Workload &workload) {
  const auto refs = redag::flatten(workload);
  return !refs.empty() && std::all_of(refs.begin(), refs.end(), [](const auto &ref) { return ref.task->wcet > 0; });
}

std::string read_trace(Reader &reader) {
  return reader.text(
      {"trace",
       "Folder for events.redag, jobs.csv, summary.json and trace.pftrace, which are written when spinning ends; "
       "empty: none",
       "the path of a folder"},
      "");
}

/// Names and values are those of the options of `redag run`.
void read_forms(Reader &reader, MonitorOptions &options) {
  options.events_as_text =
      reader.word("events", "Form of the events of `trace`: events.redag (compressed), or events.jsonl (text)",
                  {"redag", "jsonl"}) == "jsonl";
  const std::string picture = reader.word(
      "picture",
      "Whether `trace` has trace.pftrace, the schedule as a picture; auto: if there are at most 500 000 events",
      {"auto", "always", "never"});
  if (picture != "auto") options.picture = picture == "always";
}

std::optional<redag::Calibration> read_overheads(Reader &reader) {
  const std::string path = reader.text(
      {"overheads",
       "File of overheads that `redag calibrate` measured on this machine; they are charged to the bounds; empty: none",
       "the path of an overheads file (docs/calibration.md)"},
      "");
  if (path.empty()) return std::nullopt;
  redag::Result<redag::Calibration> loaded = redag::load_calibration(path);
  if (!loaded) {
    throw rclcpp::exceptions::InvalidParameterValueException(
        fmt::format("parameter 'overheads' is {}:\n{}", path, to_string(loaded.error())));
  }
  return *std::move(loaded);
}

bool read_bounds(Reader &reader) {
  return reader.flag(
      {"bounds", "Compare response times with their bounds; needs the execution times of all tasks in `config`",
       "true or false"},
      true);
}

}  // namespace

ReDAGOptions declare_options(rclcpp::Node &node) {
  Reader reader(node);
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
  options.policy =
      reader.one_of({"policy", "Priority order of callbacks; rate_monotonic: the policy in `config`, if it states one",
                     names_of(kPolicies)},
                    kPolicies);
  options.ties = reader.one_of({"ties",
                                "Order of callbacks with equal priority; share: earlier release first, or the value in "
                                "`config`; fixed: always the same order",
                                names_of(kTies)},
                               kTies);
  const Spec threads{
      "threads",
      "Number of threads with preemption os: callbacks that can be started and unfinished at once; 0: workers + 16",
      fmt::format("0, or a whole number from the number of workers to {}", kMostThreads)};
  options.threads = static_cast<std::uint32_t>(reader.integer(threads, 0, 0, kMostThreads));
  options.spare_threads = static_cast<std::uint32_t>(
      reader.integer({"spare_threads",
                      "Number of threads besides the workers with preemption none and cooperative, for callbacks that "
                      "block in a redag::Blocking and leave their workers to others",
                      fmt::format("a whole number from 0 to {}", kMostThreads)},
                     0, 0, kMostThreads));
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
  options.spin = reader.seconds(
      {"spin", "Seconds for which an idle worker looks for a callback before it sleeps; not with preemption os",
       "a number of seconds of at least 0"},
      0.0, true);
  options.watchdog = reader.seconds(
      {"watchdog",
       "Warn about callbacks that are in progress for longer than these seconds, while they still run; 0: no warnings",
       "a number of seconds of at least 0"},
      0.0, true);
  options.deadlocks = reader.flag({"deadlocks",
                                   "Name callbacks that wait for a response which cannot reach them, in the log and on "
                                   "/diagnostics; costs eight looks a second",
                                   "true or false"},
                                  true);
  options.live = reader.flag(
      {"live", "Let `redag top` show the executor; costs a page of memory and two updates a second", "true or false"},
      true);
  options.share_order = reader.flag({"share_order",
                                     "With preemption os, share one order of priorities with the other executors of "
                                     "this user that do so, also in other processes",
                                     "true or false"},
                                    false);
  const bool counts_responses = read_bounds(reader) && options.workload && has_all_wcets(*options.workload);
  if (!read_trace(reader).empty() || counts_responses) options.trace_capacity = kTraceCapacity;
  return options;
}

MonitorOptions declare_monitor_options(rclcpp::Node &node, const ReDAGOptions &executor) {
  Reader reader(node);
  MonitorOptions options;
  options.period =
      reader.seconds({"metrics_period", "Seconds between two messages on /diagnostics and ~/metrics; 0: no messages",
                      "a number of seconds of at least 0"},
                     1.0, true);
  options.metrics_file =
      reader.text({"metrics_file", "File for the last message of ~/metrics, written when spinning ends; empty: none",
                   "the path of a file"},
                  "");
  options.save_path =
      reader.text({"save_path", "File to which the service ~/save writes the learned workload", "the path of a file"},
                  options.save_path, false);
  options.trace = read_trace(reader);
  read_forms(reader, options);
  options.trace_events = static_cast<std::size_t>(reader.integer(
      {"trace_events", "Number of events that are kept for `trace`, at 32 bytes each; later events are dropped",
       fmt::format("a whole number from 1 to {}", kMostTraceEvents)},
      static_cast<std::int64_t>(options.trace_events), 1, kMostTraceEvents));
  options.default_period = executor.default_period;
  if (read_bounds(reader)) options.workload = executor.workload;
  options.calibration = read_overheads(reader);
  return options;
}

}  // namespace redag_rclcpp
