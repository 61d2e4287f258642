// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// `ros2 run redag_rclcpp_lab play_lockstep` replays a bag to executors in lockstep.
#include <fmt/format.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "command_line.hpp"
#include "lockstep_player.hpp"
#include "rclcpp/rclcpp.hpp"
#include "redag/base/check.hpp"
#include "redag/base/text.hpp"
#ifdef REDAG_ROSBAG2
#include "bag_recording.hpp"
#endif

namespace redag_rclcpp::lab {
namespace {

using redag::Result;

constexpr const char *kDescription =
    R"(Replays a bag to ReDAGExecutors in lockstep: each replay runs the same callbacks
in the same order, however busy the machine is.
)";

constexpr const char *kFooter = R"(The executors have the parameter lockstep:=true, and their nodes
use_sim_time:=true. Start them before the player. Ctrl-C ends the replay early.

Examples:
  ros2 run redag_rclcpp component_container --ros-args -p lockstep:=true -p use_sim_time:=true
  ros2 run redag_rclcpp_lab play_lockstep drive/ --topics /scan,/odom --log first.txt
  ros2 run redag_rclcpp_lab play_lockstep drive/ --executors 2 --rate 0
  ros2 service call /play_lockstep/pause std_srvs/srv/SetBool "{data: true}"

Exit status: 0 success; 1 the replay failed, or something came from outside the
recording, so that a repetition can differ; 2 bad input.)";

struct Arguments {
  std::string bag;
  std::vector<std::string> topics;
  PlayOptions play;
  std::string log;
};

volatile std::sig_atomic_t interrupted = 0;

void add_options(CLI::App &app, Arguments &arguments) {
  PlayOptions &play = arguments.play;
  app.add_option("BAG", arguments.bag, "A bag of rosbag2: its folder, or one of its files")
      ->type_name("PATH")
      ->required();
  add_number<std::uint32_t>(app, "--executors", play.executors, 0,
                            "Executors in lockstep that must follow; 0: wait for\nnone, as 'ros2 bag play --clock'");
  add_list(app, "--topics", arguments.topics, "Topics to play (default: all of the bag but /clock)")
      ->check([](const std::string &name) {
        return name.rfind('/', 0) == 0 ? std::string()
                                       : fmt::format("'{}' is no full name of a topic (for example /scan)", name);
      });
  add_number<double>(app, "--rate", play.rate, 0, "Recorded time per time; 0: as fast as the executors");
  add_time(app, "--tick", play.tick, 1, "Longest step of /clock, hence the resolution of\ntimers");
  add_number<std::uint32_t>(app, "--repeat", play.repeat, 1, "Play the bag N times; /clock jumps back");
  app.add_flag("--paused", play.paused, "Wait for the service ~/pause (std_srvs/SetBool,\nfalse)");
  add_time(app, "--patience", play.patience, 1, "With an executor that gives no sign of life");
  app.add_option("--log", arguments.log,
                 "Write a line for each instant: its time, and of\n"
                 "each executor the number of callbacks since the\n"
                 "start and the hash of their order. Two replays\n"
                 "differ from the first line that differs.")
      ->type_name("FILE");
  add_number<std::uint64_t>(app, "--shuffle", play.shuffle, 1,
                            "Publish what belongs to an instant in random order\n"
                            "with random pauses, by this seed: a test, whose\n"
                            "results must be the same")
      ->default_str("");
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

Result<std::unique_ptr<Recording>> open(const Arguments &arguments) {
#ifdef REDAG_ROSBAG2
  return open_bag(arguments.bag, {arguments.topics.begin(), arguments.topics.end()});
#else
  return redag::make_error(fmt::format("cannot read '{}': this play_lockstep was built without rosbag2", arguments.bag),
                           "install rosbag2_compression of your distribution, and build redag_rclcpp_lab again");
#endif
}

int run(const Arguments &arguments) {
  const Result<std::unique_ptr<Recording>> recording = open(arguments);
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
    return player.is_recording_bad() ? kExitBad : kExitNo;
  }
  return report(*result);
}

}  // namespace
}  // namespace redag_rclcpp::lab

int main(int argc, char **argv) {
  using namespace redag_rclcpp::lab;
  Arguments arguments;
  CLI::App app(kDescription, "play_lockstep");
  app.footer(kFooter);
  add_options(app, arguments);
  int status = kExitBad;
  try {
    if (const std::optional<int> done = parse_arguments(app, argc, argv)) return *done;
    rclcpp::init(argc, argv, rclcpp::InitOptions(), rclcpp::SignalHandlerOptions::None);
    on_interrupt([](int) { interrupted = 1; });
    status = run(arguments);
    rclcpp::shutdown();
  } catch (const std::exception &error) {
    fmt::print(stderr, "play_lockstep: {}\n", error.what());
  }
  return status;
}
