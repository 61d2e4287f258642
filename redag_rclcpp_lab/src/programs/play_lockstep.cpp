// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// `ros2 run redag_rclcpp_lab play_lockstep` replays a bag to executors in lockstep.
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <csignal>
#include <cstdio>
#include <memory>
#include <set>

#include "bag_recording.hpp"
#include "lockstep_player.hpp"
#include "rclcpp/rclcpp.hpp"
#include "redag/base/check.hpp"
#include "redag/base/text.hpp"

namespace redag_rclcpp::lab {
namespace {

using redag::Result;

constexpr int kExitOk = 0;
constexpr int kExitNo = 1;
constexpr int kExitBad = 2;

constexpr const char *kHelp = R"(Replays a bag to ReDAGExecutors in lockstep: each replay runs the same callbacks
in the same order, however busy the machine is.

Usage: play_lockstep [OPTIONS] BAG

BAG is a bag of rosbag2 with the storage sqlite3: its folder, or a .db3 file.
The executors have the parameter lockstep:=true, and their nodes
use_sim_time:=true. Start them before the player.

Options:
  --executors N     Executors in lockstep that must follow (default: 1); 0: wait
                    for none, as 'ros2 bag play --clock'
  --topics A[,B...] Topics to play (default: all of the bag but /clock)
  --rate R          Recorded time per time; 0: as fast as the executors
                    (default: 1)
  --tick TIME       Longest step of /clock, hence the resolution of timers
                    (default: 10ms)
  --repeat N        Play the bag N times; /clock jumps back (default: 1)
  --paused          Wait for the service ~/pause (std_srvs/SetBool, false)
  --patience TIME   With an executor that gives no sign of life (default: 10s)
  --log FILE        Write a line for each instant: its time, and of each
                    executor the number of callbacks since the start and the
                    hash of their order. Two replays differ from the first
                    line that differs.
  --shuffle SEED    Publish what belongs to an instant in random order with
                    random pauses: a test, whose results must be the same
  --help            Print this help message and exit

Ctrl-C ends the replay early.

Examples:
  ros2 run redag_rclcpp component_container --ros-args -p lockstep:=true -p use_sim_time:=true
  ros2 run redag_rclcpp_lab play_lockstep drive/ --topics /scan,/odom --log first.txt
  ros2 run redag_rclcpp_lab play_lockstep drive/ --executors 2 --rate 0
  ros2 service call /play_lockstep/pause std_srvs/srv/SetBool "{data: true}"

Exit status: 0 success; 1 the replay failed, or something came from outside the
recording, so that a repetition can differ; 2 bad input.
)";

struct Arguments {
  std::string bag;
  std::set<std::string> topics;
  PlayOptions play;
  std::string log;
  bool help = false;
};

volatile std::sig_atomic_t interrupted = 0;

template <class Number>
Result<Number> parse_number(const std::string &option, const std::string &text, Number least) {
  Number value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !(value >= least)) {
    return redag::make_error(fmt::format("{} '{}' is not a number of at least {}", option, text, least));
  }
  return value;
}

Result<redag::Duration> parse_time(const std::string &option, const std::string &text) {
  const Result<redag::Duration> value = redag::parse_duration(text);
  if (value && *value > 0) return *value;
  return redag::make_error(fmt::format("{} '{}' is not a time above 0", option, text), "for example 10ms");
}

Result<void> take_option(const std::string &name, const std::string &value, Arguments &arguments) {
  const auto keep = [](auto parsed, auto &to) -> Result<void> {
    if (!parsed) return tl::unexpected(parsed.error());
    to = *std::move(parsed);
    return {};
  };
  if (name == "--executors") return keep(parse_number<std::uint32_t>(name, value, 0), arguments.play.executors);
  if (name == "--repeat") return keep(parse_number<std::uint32_t>(name, value, 1), arguments.play.repeat);
  if (name == "--shuffle") return keep(parse_number<std::uint64_t>(name, value, 1), arguments.play.shuffle);
  if (name == "--rate") return keep(parse_number<double>(name, value, 0), arguments.play.rate);
  if (name == "--tick") return keep(parse_time(name, value), arguments.play.tick);
  if (name == "--patience") return keep(parse_time(name, value), arguments.play.patience);
  if (name == "--log") {
    arguments.log = value;
    return {};
  }
  for (std::size_t from = 0; from <= value.size();) {
    const std::size_t comma = std::min(value.find(',', from), value.size());
    const std::string topic = value.substr(from, comma - from);
    if (topic.empty() || topic.front() != '/') {
      return redag::make_error(fmt::format("--topics '{}': '{}' is no full name of a topic", value, topic),
                               "for example --topics /scan,/odom");
    }
    arguments.topics.insert(topic);
    from = comma + 1;
  }
  return {};
}

Result<Arguments> parse_arguments(const std::vector<std::string> &words) {
  static const std::vector<std::string> kWithValue = {"--executors", "--topics",   "--rate", "--tick",
                                                      "--repeat",    "--patience", "--log",  "--shuffle"};
  Arguments arguments;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::string &word = words[i];
    if (word == "--help" || word == "-h") {
      arguments.help = true;
      return arguments;
    }
    if (word == "--paused") {
      arguments.play.paused = true;
      continue;
    }
    if (word.rfind('-', 0) != 0) {
      if (!arguments.bag.empty()) return redag::make_error(fmt::format("there is more than one bag: '{}'", word));
      arguments.bag = word;
      continue;
    }
    const std::size_t equals = word.find('=');
    const std::string name = word.substr(0, equals);
    if (std::find(kWithValue.begin(), kWithValue.end(), name) == kWithValue.end()) {
      return redag::make_error(fmt::format("there is no option '{}'", name),
                               "'play_lockstep --help' lists the options");
    }
    if (equals == std::string::npos && i + 1 == words.size()) {
      return redag::make_error(fmt::format("{} needs a value", name));
    }
    const std::string value = equals == std::string::npos ? words[++i] : word.substr(equals + 1);
    if (const Result<void> taken = take_option(name, value, arguments); !taken) return tl::unexpected(taken.error());
  }
  if (arguments.bag.empty()) return redag::make_error("no bag is given", "see 'play_lockstep --help'");
  return arguments;
}

// Names of executors differ from run to run.
void write_line(std::FILE *log, redag::Time time, const PlayResult &result) {
  std::vector<std::pair<std::uint64_t, std::uint64_t>> orders;
  for (const auto &[name, follower] : result.executors)
    orders.emplace_back(follower.report.jobs, follower.report.order);
  std::sort(orders.begin(), orders.end());
  fmt::print(log, "{} {}", result.instants, time);
  for (const auto &[jobs, order] : orders) fmt::print(log, "  {} {:016x}", jobs, order);
  fmt::print(log, "\n");
}

int report(const PlayResult &result) {
  fmt::print("{} instants, {} messages, {} of the recording in {}", result.instants, result.messages,
             redag::humanize_duration(result.recorded), redag::humanize_duration(result.took));
  if (result.took > 0) {
    fmt::print(" ({:.2f} x real time)", static_cast<double>(result.recorded) / static_cast<double>(result.took));
  }
  fmt::print("{}\n", result.stopped ? "; stopped early" : "");
  bool repeats = true;
  for (const auto &[name, follower] : result.executors) {
    fmt::print("executor {}: {} callbacks, hash of their order {:016x}\n", name, follower.report.jobs,
               follower.report.order);
    for (const auto &[callback, number] : follower.report.outside) {
      fmt::print("  from outside the recording: {} ({})\n", callback, number);
      repeats = false;
    }
  }
  if (!repeats) {
    fmt::print(
        "A repetition can differ. Timers must use the node's clock and use_sim_time; topics, services and actions of "
        "other processes must be in the recording, or stay away.\n");
  }
  return repeats ? kExitOk : kExitNo;
}

int run(const Arguments &arguments) {
  Result<std::unique_ptr<Recording>> recording = open_bag(arguments.bag, arguments.topics);
  if (!recording) {
    fmt::print(stderr, "play_lockstep: {}\n", to_string(recording.error()));
    return kExitBad;
  }
  const auto close = [](std::FILE *file) { std::fclose(file); };
  std::unique_ptr<std::FILE, decltype(close)> log(nullptr, close);
  if (!arguments.log.empty()) {
    log.reset(std::fopen(arguments.log.c_str(), "w"));
    if (!log) {
      fmt::print(stderr, "play_lockstep: cannot write '{}'\n", arguments.log);
      return kExitBad;
    }
  }
  PlayOptions options = arguments.play;
  options.stop = [] { return interrupted != 0; };
  options.say = [](const std::string &text) { fmt::print(stderr, "{}\n", text); };
  LockstepPlayer player(std::make_shared<rclcpp::Node>("play_lockstep"), std::move(options),
                        [&](redag::Time time, const PlayResult &result) {
                          if (log) write_line(log.get(), time, result);
                        });
  const Result<PlayResult> result = player.play(**recording);
  if (!result) {
    fmt::print(stderr, "play_lockstep: {}\n", to_string(result.error()));
    return kExitNo;
  }
  return report(*result);
}

}  // namespace
}  // namespace redag_rclcpp::lab

int main(int argc, char **argv) {
  using namespace redag_rclcpp::lab;
  int status = kExitBad;
  try {
    const std::vector<std::string> words = rclcpp::remove_ros_arguments(argc, argv);
    const auto arguments = parse_arguments({words.begin() + 1, words.end()});
    if (!arguments) {
      fmt::print(stderr, "play_lockstep: {}\n", to_string(arguments.error()));
      return kExitBad;
    }
    if (arguments->help) {
      fmt::print("{}", kHelp);
      return kExitOk;
    }
    rclcpp::init(argc, argv, rclcpp::InitOptions(), rclcpp::SignalHandlerOptions::None);
    struct sigaction action {};
    action.sa_handler = [](int) { interrupted = 1; };
    for (const int number : {SIGINT, SIGTERM}) {
      REDAG_CHECK(sigaction(number, &action, nullptr) == 0, "cannot install a signal handler");
    }
    status = run(*arguments);
    rclcpp::shutdown();
  } catch (const std::exception &error) {
    fmt::print(stderr, "play_lockstep: {}\n", error.what());
  }
  return status;
}
