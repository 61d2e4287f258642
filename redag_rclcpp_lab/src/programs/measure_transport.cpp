// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// `ros2 run redag_rclcpp_lab measure_transport` measures the `transport` of links in robot files.
#include <fmt/format.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <optional>
#include <vector>

#include "command_line.hpp"
#include "transport.hpp"

namespace redag_rclcpp::lab {
namespace {

using redag::Result;

constexpr std::uint64_t kMostBytes = std::uint64_t{64} << 20U;

constexpr const char *kDescription =
    R"(Measures how long messages take from one process to a callback of ReDAGExecutor
in another one, for 'transport' of links in a robot file.
)";

constexpr const char *kFooter = R"(Ctrl-C ends the measurement early. With the right to use SCHED_FIFO the receiver
runs as a robot's executor does, above ordinary threads.

Examples:
  ros2 run redag_rclcpp_lab measure_transport
  ros2 run redag_rclcpp_lab measure_transport --sizes 6220800 --period 33ms --duration 5min

Exit status: 0 success; 1 nothing arrived of some size, or the measurement
failed; 2 bad input.)";

struct Arguments {
  TransportOptions transport;
  double margin = 1.5;
  bool json = false;
};

volatile std::sig_atomic_t interrupted = 0;

void check_sizes(const std::vector<std::size_t> &sizes) {
  for (auto bytes = sizes.begin(); bytes != sizes.end(); ++bytes) {
    if (*bytes < kLeastMessage || *bytes > kMostBytes || *bytes % 8 != 0 ||
        std::find(sizes.begin(), bytes, *bytes) != bytes) {
      throw CLI::ValidationError("--sizes", fmt::format("'{}' is no list of different multiples of 8 from {} to {}",
                                                        fmt::join(sizes, ","), kLeastMessage, kMostBytes));
    }
  }
}

void add_options(CLI::App &app, Arguments &arguments) {
  TransportOptions &transport = arguments.transport;
  add_list(app, "--sizes", transport.sizes, "Sizes of messages, multiples of 8 bytes\n(default: 64,65536,1048576)");
  add_time(app, "--period", transport.period, 1, "From one message to the next");
  add_time(app, "--duration", transport.duration, 1, "Of the measurement of each size");
  app.add_flag_function(
      "--best-effort", [&transport](std::int64_t /*count*/) { transport.reliable = false; },
      "Quality of service of both sides (default:\nreliable)");
  add_number<double>(app, "--margin", arguments.margin, 1, "The largest latency times this is what to state", 1000);
  app.add_flag("--json", arguments.json, "Write a JSON document");
  app.callback([&transport] { check_sizes(transport.sizes); });
}

int run(const Arguments &arguments) {
  TransportOptions options = arguments.transport;
  options.stop = [] { return interrupted != 0; };
  const Result<std::vector<TransportFigures>> figures = measure_transport(options);
  if (!figures) {
    fmt::print(stderr, "measure_transport: {}\n", to_string(figures.error()));
    return kExitNo;
  }
  fmt::print("{}",
             arguments.json ? to_json(*figures, options, arguments.margin) : describe(*figures, arguments.margin));
  const bool is_complete = std::none_of(figures->begin(), figures->end(),
                                        [](const TransportFigures &each) { return each.latencies.empty(); });
  return is_complete ? kExitOk : kExitNo;
}

}  // namespace
}  // namespace redag_rclcpp::lab

int main(int argc, char **argv) {
  using namespace redag_rclcpp::lab;
  Arguments arguments;
  CLI::App app(kDescription, "measure_transport");
  app.footer(kFooter);
  add_options(app, arguments);
  try {
    if (const std::optional<int> done = parse_arguments(app, argc, argv)) return *done;
    on_interrupt([](int) { interrupted = 1; });
    return run(arguments);
  } catch (const std::exception &error) {
    fmt::print(stderr, "measure_transport: {}\n", error.what());
    return kExitBad;
  }
}
