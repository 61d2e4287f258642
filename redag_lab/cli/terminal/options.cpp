// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/terminal/options.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <limits>
#include <stdexcept>
#include <system_error>
#include <type_traits>

#include "redag/base/text.hpp"
#include "redag/live/writer.hpp"

namespace redag::cli {
namespace {

template <class Number>
Number parse_number(const std::string &name, const std::string &text, Range<Number> range) {
  Number value{};
  const char *end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  const bool fits = error == std::errc{} && stop == end && std::isfinite(static_cast<double>(value)) &&
                    value >= range.least && value <= range.most;
  if (!fits) {
    const char *kind = std::is_floating_point_v<Number> ? "a number" : "a whole number";
    const std::string words = static_cast<Number>(range.most) == std::numeric_limits<Number>::max()
                                  ? fmt::format("{} below 2^{}", kind, std::numeric_limits<Number>::digits)
                                  : fmt::format("{} from {} to {}", kind, range.least, range.most);
    reject(name, fmt::format("{} is not {}", in_quotes(text), words));
  }
  return value;
}

template <class Number>
CLI::Option *add_number_to(CLI::App &app, const std::string &name, Number &target, Range<Number> range,
                           const std::string &help, const char *type) {
  const auto set = [&target, name, range](const std::string &text) { target = parse_number(name, text, range); };
  return app.add_option_function<std::string>(name, set, help)->type_name(type)->default_str(fmt::format("{}", target));
}

template <class Target>
CLI::Option *add_duration_to(CLI::App &app, const std::string &name, Target &target, const std::string &help,
                             bool zero_allowed) {
  const auto set = [&target, name, zero_allowed](const std::string &text) {
    const Result<Duration> parsed = parse_duration(text);
    if (!parsed) reject(name, parsed.error().front().message, parsed.error().front().hint);
    if (*parsed < 0 || (*parsed == 0 && !zero_allowed)) {
      reject(name, in_quotes(text) + " is not " + (zero_allowed ? "a duration of at least 0s" : "greater than 0"));
    }
    target = *parsed;
  };
  return app.add_option_function<std::string>(name, set, help)->type_name("DURATION");
}

}  // namespace

void reject(const std::string &option, const std::string &message, const std::string &hint) {
  // CLI11 puts the name before a ValidationError's message only if there is a name.
  throw CLI::ValidationError(option, message + (hint.empty() ? "" : " (" + hint + ")"));
}

CLI::Option *add_duration(CLI::App &app, const std::string &name, std::optional<Duration> &target,
                          const std::string &help, bool zero_allowed) {
  return add_duration_to(app, name, target, help, zero_allowed);
}

CLI::Option *add_duration(CLI::App &app, const std::string &name, Duration &target, const std::string &help,
                          bool zero_allowed) {
  return add_duration_to(app, name, target, help, zero_allowed)->default_str(format_duration(target));
}

CLI::Option &option_named(CLI::App &app, std::string_view name) {
  for (CLI::Option *option : app.get_options()) {
    for (const std::string &own : option->get_lnames()) {
      if (name.substr(2) == own) return *option;
    }
  }
  throw std::logic_error(fmt::format("there is no option {}", name));
}

CLI::Option *add_count(CLI::App &app, const std::string &name, std::uint32_t &target, Range<std::uint32_t> range,
                       const std::string &help) {
  return add_number_to(app, name, target, range, help, "N");
}

CLI::Option *add_count(CLI::App &app, const std::string &name, std::uint64_t &target, Range<std::uint64_t> range,
                       const std::string &help) {
  return add_number_to(app, name, target, range, help, "N");
}

CLI::Option *add_seed(CLI::App &app, std::uint64_t &target, const std::string &help) {
  return add_count(app, "--seed", target, {0, std::numeric_limits<std::uint64_t>::max()}, help);
}

CLI::Option *add_number(CLI::App &app, const std::string &name, double &target, Range<double> range,
                        const std::string &help) {
  return add_number_to(app, name, target, range, help, "X");
}

CLI::Option *add_pages_folder(CLI::App &app, std::string &folder) {
  return app.add_option("--folder", folder, "Folder of the live pages")
      ->type_name("DIR")
      ->capture_default_str()
      ->check([](const std::string &given) {
        std::error_code ignored;
        const bool there = given == live::kFolder || std::filesystem::is_directory(given, ignored);
        return there ? std::string() : in_quotes(given) + " is not a folder";
      });
}

}  // namespace redag::cli
