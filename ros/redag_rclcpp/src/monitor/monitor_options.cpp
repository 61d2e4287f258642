// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <optional>
#include <string>
#include <utility>

#include "parameter_reader.hpp"
#include "rclcpp/exceptions.hpp"
#include "redag_rclcpp/monitor.hpp"

namespace redag_rclcpp {
namespace {

constexpr std::int64_t kMostTraceEvents = 1'000'000'000;

std::optional<redag::Calibration> read_overheads(ParameterReader &reader) {
  const std::string path = reader.text({"overheads",
                                        "File of overheads that `redag doctor --measure` measured on this machine; "
                                        "they are charged to the bounds; empty: none",
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

}  // namespace

MonitorOptions declare_monitor_options(rclcpp::Node &node, const ReDAGOptions &executor) {
  ParameterReader reader(node);
  MonitorOptions options;
  options.period =
      reader.seconds({"metrics_period", "Seconds between two messages on /diagnostics and ~/metrics; 0: no messages",
                      "a number of seconds of at least 0"},
                     1.0, true);
  options.live = reader.flag(
      {"live", "Let `redag top` show the executor; costs a page of memory and two updates a second", "true or false"},
      true);
  options.save_path =
      reader.text({"save_path", "File to which the service ~/save writes the learned workload", "the path of a file"},
                  options.save_path, false);
  options.trace = reader.trace();
  options.trace_events = static_cast<std::size_t>(reader.integer(
      {"trace_events", "Number of events that are kept for `trace`, at 32 bytes each; later events are dropped",
       fmt::format("a whole number from 1 to {}", kMostTraceEvents)},
      static_cast<std::int64_t>(options.trace_events), 1, kMostTraceEvents));
  options.default_period = executor.default_period;
  if (reader.bounds() && executor.workload) options.workload = **executor.workload;
  options.calibration = read_overheads(reader);
  return options;
}

}  // namespace redag_rclcpp
