// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// `ros2 run redag_rclcpp_lab publish_statistics` publishes the figures of `redag top` for PlotJuggler and Foxglove.
#include <fmt/format.h>

#include <cstdio>
#include <exception>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <system_error>
#include <vector>

#include "command_line.hpp"
#include "live_statistics.hpp"
#include "redag/live/writer.hpp"
#ifdef REDAG_PAL_STATISTICS
#include <chrono>

#include "statistics_publisher.hpp"
#endif

namespace redag_rclcpp::lab {
namespace {

constexpr const char *kDescription =
    R"(Publishes the figures of all running executors of this machine, as 'redag top'
shows them, on ~/names and ~/values (pal_statistics_msgs, for PlotJuggler) and
on ~/full (for Foxglove). Times are in seconds. Executors do not notice it.
)";

constexpr const char *kFooter = R"(It sees the executors of its own user; that of root sees all. Values are only
sent while somebody subscribes to them.

Examples:
  ros2 run redag_rclcpp_lab publish_statistics
  ros2 run redag_rclcpp_lab publish_statistics --figures misses,recent_response_p99

Exit status: 0 success; 1 nothing could be published; 2 bad input, or a build
without pal_statistics_msgs.)";

struct Arguments {
  redag::Duration period = 500 * redag::kMillisecond;  // as that of the pages
  std::string folder = redag::live::kFolder;
  std::vector<std::string> figures{};
};

void check(const Arguments &arguments) {
  std::error_code ignored;
  if (arguments.folder != redag::live::kFolder && !std::filesystem::is_directory(arguments.folder, ignored)) {
    throw CLI::ValidationError("--folder", fmt::format("'{}' is not a folder", arguments.folder));
  }
  const auto known = known_figures();
  for (const std::string &figure : arguments.figures) {
    if (known.count(figure) == 0) {
      throw CLI::ValidationError("--figures", fmt::format("'{}' is not one of {}", figure, fmt::join(known, ", ")));
    }
  }
}

void add_options(CLI::App &app, Arguments &arguments) {
  add_time(app, "--period", arguments.period, redag::kMillisecond, "From one message to the next");
  add_list(app, "--figures", arguments.figures, "Figures to publish (default: all)");
  app.add_option("--folder", arguments.folder, "Folder of the live pages")->type_name("DIR")->capture_default_str();
  app.callback([&arguments] { check(arguments); });
}

#ifdef REDAG_PAL_STATISTICS
int run(const Arguments &arguments, int argc, char **argv) {
  rclcpp::init(argc, argv);
  const auto node = std::make_shared<rclcpp::Node>("redag_statistics");
  StatisticsPublisher publisher(node, arguments.folder, {arguments.figures.begin(), arguments.figures.end()});
  const auto timer =
      node->create_wall_timer(std::chrono::nanoseconds(arguments.period), [&publisher] { publisher.publish(); });
  try {
    rclcpp::spin(node);
  } catch (const rclcpp::exceptions::RCLError &) {
    if (rclcpp::ok()) throw;  // otherwise an interrupt came while it published
  }
  rclcpp::shutdown();
  return kExitOk;
}
#else
int run(const Arguments &, int, char **) {
  note(redag::make_error("this publish_statistics was built without pal_statistics_msgs",
                         "install pal_statistics_msgs of your distribution, and build redag_rclcpp_lab again")
           .value());
  return kExitBad;
}
#endif

}  // namespace
}  // namespace redag_rclcpp::lab

int main(int argc, char **argv) {
  using namespace redag_rclcpp::lab;
  Arguments arguments;
  CLI::App app(kDescription, "publish_statistics");
  app.footer(kFooter);
  add_options(app, arguments);
  try {
    if (const std::optional<int> done = parse_arguments(app, argc, argv)) return *done;
    return run(arguments, argc, argv);
  } catch (const std::exception &error) {
    fmt::print(stderr, "publish_statistics: {}\n", error.what());
    return kExitNo;
  }
}
