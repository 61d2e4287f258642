// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "command_line.hpp"

#include <algorithm>
#include <cstdio>
#include <vector>

#include "rclcpp/rclcpp.hpp"
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
  // The description and the options fit 80 columns by their own line ends.
  constexpr std::size_t kColumn = 28;
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
    note({{.message = error.what(), .hint = fmt::format("'{} --help' lists the options", app.get_name())}});
    return kExitBad;
  }
}

}  // namespace redag_rclcpp::lab
