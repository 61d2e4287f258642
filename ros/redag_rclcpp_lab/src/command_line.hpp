// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What the programs of this package share: options, mistakes, and exit statuses.
#pragma once

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <limits>
#include <optional>
#include <string>
#include <system_error>
#include <type_traits>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/base/time.hpp"

namespace redag_rclcpp::lab {

inline constexpr int kExitOk = 0;
inline constexpr int kExitNo = 1;
inline constexpr int kExitBad = 2;

/// Prints mistakes and warnings to standard error.
void note(const redag::Diagnostics &diagnostics);

/// An option with a number from `least` to `most`. The present value of `target` is the default.
template <class Number>
CLI::Option *add_number(CLI::App &app, const std::string &name, Number &target, Number least, const std::string &help,
                        Number most = std::numeric_limits<Number>::max()) {
  // Of unsigned numbers, CLI11 takes negative ones as well.
  const auto take = [&target, name, least, most](const std::string &text) {
    Number value{};
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error == std::errc() && end == text.data() + text.size() && value >= least && value <= most) {
      target = value;
      return;
    }
    const bool is_limited = most != std::numeric_limits<Number>::max();
    const std::string kind = std::is_integral_v<Number> ? "a whole number" : "a number";
    throw CLI::ValidationError(name, is_limited ? fmt::format("'{}' is not {} from {} to {}", text, kind, least, most)
                                                : fmt::format("'{}' is not {} of at least {}", text, kind, least));
  };
  return app.add_option_function<std::string>(name, take, help)->type_name("N")->default_str(fmt::format("{}", target));
}

/// An option with a list, separated by commas, such as A,B.
template <class Value>
CLI::Option *add_list(CLI::App &app, const std::string &name, std::vector<Value> &target, const std::string &help) {
  return app.add_option(name, target, help)->type_name("A[,B]")->delimiter(',')->allow_extra_args(false);
}

/// An option with a time, such as 10ms, of at least `least` ns. The present value of `target` is the default.
CLI::Option *add_time(CLI::App &app, const std::string &name, redag::Duration &target, redag::Duration least,
                      const std::string &help);

/// Parses the arguments of a program, less those for ROS. Returns the exit status if it has nothing more to do: it has
/// printed its help, or a mistake.
[[nodiscard]] std::optional<int> parse_arguments(CLI::App &app, int argc, char **argv);

/// Lets SIGINT and SIGTERM call `handler`, which must be async-signal-safe. System calls go on.
void on_interrupt(void (*handler)(int));

}  // namespace redag_rclcpp::lab
