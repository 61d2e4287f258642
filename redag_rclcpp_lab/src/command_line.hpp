// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What the programs of this package share: options, mistakes, and exit statuses.
#pragma once

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <optional>
#include <string>

#include "redag/base/result.hpp"
#include "redag/base/time.hpp"

namespace redag_rclcpp::lab {

inline constexpr int kExitOk = 0;
inline constexpr int kExitNo = 1;
inline constexpr int kExitBad = 2;

/// Prints mistakes and warnings to standard error.
void note(const redag::Diagnostics &diagnostics);

/// An option with a number of at least `least`. The present value of `target` is the default.
template <class Number>
CLI::Option *add_number(CLI::App &app, const std::string &name, Number &target, Number least, const std::string &help) {
  const auto take = [&target, name, least](const Number &value) {
    if (!(value >= least)) throw CLI::ValidationError(name, fmt::format("{} is less than {}", value, least));
    target = value;
  };
  return app.add_option_function<Number>(name, take, help)->type_name("N")->default_str(fmt::format("{}", target));
}

/// An option with a time, such as 10ms, of at least `least` ns. The present value of `target` is the default.
CLI::Option *add_time(CLI::App &app, const std::string &name, redag::Duration &target, redag::Duration least,
                      const std::string &help);

/// Parses the arguments of a program, less those for ROS. Returns the exit status if it has nothing more to do: it has
/// printed its help, or a mistake.
std::optional<int> parse_arguments(CLI::App &app, int argc, char **argv);

}  // namespace redag_rclcpp::lab
