// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// `ros2 run redag_rclcpp_lab measure_transport` measures the `transport` of links in robot files.
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <csignal>
#include <cstdio>
#include <string>
#include <string_view>
#include <vector>

#include "redag/base/check.hpp"
#include "transport.hpp"

namespace redag_rclcpp::lab {
namespace {

using redag::Result;

constexpr int kExitOk = 0;
constexpr int kExitNo = 1;
constexpr int kExitBad = 2;
constexpr std::size_t kMostBytes = std::size_t{64} << 20U;

constexpr const char *kHelp = R"(Measures how long messages take from one process to a callback of ReDAGExecutor
in another one, for 'transport' of links in a robot file.

Usage: measure_transport [OPTIONS]

Options:
  --sizes N[,N...]  Sizes of messages, multiples of 8 bytes
                    (default: 64,65536,1048576)
  --period TIME     From one message to the next (default: 10ms)
  --duration TIME   Of the measurement of each size (default: 10s)
  --best-effort     Quality of service of both sides (default: reliable)
  --margin FACTOR   The largest latency times this is what to state
                    (default: 1.5)
  --json            Write a JSON document
  --help            Print this help message and exit

Ctrl-C ends the measurement early. With the right to use SCHED_FIFO the receiver
runs as a robot's executor does, above ordinary threads.

Examples:
  ros2 run redag_rclcpp_lab measure_transport
  ros2 run redag_rclcpp_lab measure_transport --sizes 6220800 --period 33ms --duration 5min

Exit status: 0 success; 1 nothing arrived of some size, or the measurement
failed; 2 bad input.
)";

struct Arguments {
  TransportOptions transport;
  double margin = 1.5;
  bool json = false;
  bool help = false;
};

volatile std::sig_atomic_t interrupted = 0;

template <class Number>
bool parse_number(std::string_view text, Number &value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size();
}

Result<void> take_sizes(std::string_view value, std::vector<std::size_t> &sizes) {
  sizes.clear();
  for (std::size_t from = 0; from <= value.size();) {
    const std::size_t comma = std::min(value.find(',', from), value.size());
    std::size_t bytes = 0;
    if (!parse_number(value.substr(from, comma - from), bytes) || bytes < kLeastMessage || bytes > kMostBytes ||
        bytes % 8 != 0 || std::find(sizes.begin(), sizes.end(), bytes) != sizes.end()) {
      return redag::make_error(fmt::format("--sizes '{}' is no list of different multiples of 8 from {} to {}", value,
                                           kLeastMessage, kMostBytes),
                               "for example --sizes 64,65536");
    }
    sizes.push_back(bytes);
    from = comma + 1;
  }
  return {};
}

Result<void> take_option(const std::string &name, const std::string &value, Arguments &arguments) {
  if (name == "--sizes") return take_sizes(value, arguments.transport.sizes);
  if (name == "--margin") {
    if (parse_number(value, arguments.margin) && arguments.margin >= 1 && arguments.margin <= 1000) return {};
    return redag::make_error(fmt::format("--margin '{}' is not a number from 1 to 1000", value));
  }
  const Result<redag::Duration> time = redag::parse_duration(value);
  if (!time || *time <= 0) {
    return redag::make_error(fmt::format("{} '{}' is not a time above 0", name, value), "for example 10ms");
  }
  (name == "--period" ? arguments.transport.period : arguments.transport.duration) = *time;
  return {};
}

Result<Arguments> parse_arguments(const std::vector<std::string> &words) {
  static const std::vector<std::string> kWithValue = {"--sizes", "--period", "--duration", "--margin"};
  Arguments arguments;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::string &word = words[i];
    if (word == "--help" || word == "-h") {
      arguments.help = true;
      return arguments;
    }
    if (word == "--json") {
      arguments.json = true;
      continue;
    }
    if (word == "--best-effort") {
      arguments.transport.reliable = false;
      continue;
    }
    const std::size_t equals = word.find('=');
    const std::string name = word.substr(0, equals);
    if (std::find(kWithValue.begin(), kWithValue.end(), name) == kWithValue.end()) {
      return redag::make_error(fmt::format("there is no option '{}'", name),
                               "'measure_transport --help' lists the options");
    }
    if (equals == std::string::npos && i + 1 == words.size()) {
      return redag::make_error(fmt::format("{} needs a value", name));
    }
    const std::string value = equals == std::string::npos ? words[++i] : word.substr(equals + 1);
    if (const Result<void> taken = take_option(name, value, arguments); !taken) return tl::unexpected(taken.error());
  }
  return arguments;
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
  int status = kExitBad;
  try {
    const auto arguments = parse_arguments({argv + 1, argv + argc});
    if (!arguments) {
      fmt::print(stderr, "measure_transport: {}\n", to_string(arguments.error()));
      return kExitBad;
    }
    if (arguments->help) {
      fmt::print("{}", kHelp);
      return kExitOk;
    }
    struct sigaction action {};
    action.sa_handler = [](int) { interrupted = 1; };
    for (const int number : {SIGINT, SIGTERM}) {
      REDAG_CHECK(sigaction(number, &action, nullptr) == 0, "cannot install a signal handler");
    }
    status = run(*arguments);
  } catch (const std::exception &error) {
    fmt::print(stderr, "measure_transport: {}\n", error.what());
  }
  return status;
}
