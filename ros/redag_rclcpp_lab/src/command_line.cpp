// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "command_line.hpp"

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <utility>

#include "rclcpp/rclcpp.hpp"
#include "redag/base/check.hpp"
#include "redag/base/text.hpp"

namespace redag_rclcpp::lab {

void note(const redag::Diagnostics &diagnostics) {
  for (const redag::Diagnostic &one : diagnostics) fmt::print(stderr, "{}\n", one.to_string());
}

CLI::Option *add_time(CLI::App &app, const std::string &name, redag::Duration &target, redag::Duration least,
                      const std::string &help) {
  const auto take = [&target, name, least](const std::string &text) {
    const redag::Result<redag::Duration> value = redag::parse_duration(text);
    if (!value) {
      const redag::Diagnostic &mistake = value.error().front();
      throw CLI::ValidationError(name, fmt::format("{} ({})", mistake.message, mistake.hint));
    }
    if (*value < least) throw CLI::ValidationError(name, fmt::format("'{}' is too short", text));
    target = *value;
  };
  return app.add_option_function<std::string>(name, take, help)
      ->type_name("TIME")
      ->default_str(redag::format_duration(target));
}

std::optional<int> parse_arguments(CLI::App &app, int argc, char **argv) {
  constexpr std::size_t kColumn = 28;  // texts of options bring the line ends for 80 columns
  app.get_formatter()->column_width(kColumn);
  std::vector<std::string> words = rclcpp::remove_ros_arguments(argc, argv);
  words.erase(words.begin());
  std::reverse(words.begin(), words.end());  // as CLI11 wants them
  try {
    app.parse(std::move(words));
    return std::nullopt;
  } catch (const CLI::CallForHelp &) {
    fmt::print("{}", app.help());
    return kExitOk;
  } catch (const CLI::ParseError &error) {
    note(redag::make_error(error.what(), fmt::format("'{} --help' lists the options", app.get_name())).value());
    return kExitBad;
  }
}

void on_interrupt(void (*handler)(int)) {
  struct sigaction action {};
  action.sa_handler = handler;
  action.sa_flags = SA_RESTART;
  sigemptyset(&action.sa_mask);
  for (const int number : {SIGINT, SIGTERM}) {
    REDAG_CHECK(sigaction(number, &action, nullptr) == 0, "cannot install a signal handler");
  }
}

}  // namespace redag_rclcpp::lab
