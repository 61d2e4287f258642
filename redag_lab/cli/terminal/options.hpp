// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Command-line options whose values have a text form of this project: durations, names of choices, processors. Mistakes
// in values have the same messages as in workload files. Used while the program starts, on one thread.
#pragma once

#include <CLI/CLI.hpp>
#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "redag/base/nearest.hpp"
#include "redag/base/text.hpp"
#include "redag/base/time.hpp"
#include "redag/model/workload.hpp"

namespace redag::cli {

template <class Value>
using Choices = std::vector<std::pair<std::string, Value>>;

/// Returns the values with their names, by to_string().
template <class Value, std::size_t N>
Choices<Value> choices_of(const std::array<Value, N> &values) {
  Choices<Value> choices;
  for (const Value value : values) choices.emplace_back(to_string(value), value);
  return choices;
}

/// Throws CLI::ValidationError with a text such as "--period-min: ...".
[[noreturn]] void reject(const std::string &option, const std::string &message, const std::string &hint = {});

/// Adds an option such as "5ms". The value must not be negative, and is positive unless `zero_allowed`.
CLI::Option *add_duration(CLI::App &app, const std::string &name, std::optional<Duration> &target,
                          const std::string &help, bool zero_allowed = false);
CLI::Option *add_duration(CLI::App &app, const std::string &name, Duration &target, const std::string &help,
                          bool zero_allowed = false);

/// The allowed values of a number, including both ends. Messages name them.
template <class Number>
struct Range {
  Number least;
  Number most;
};

/// Limits where only the machine sets one: threads, combinations, restarts, recorded events.
inline constexpr std::uint32_t kMaxJobs = 1024;
inline constexpr std::uint64_t kMaxEvents = 1'000'000'000;

/// Returns the option of `app` with this `name` ("--out"), which must exist. CLI::App::get_option() ends the process
/// when memory runs out: it compares names in a noexcept function.
CLI::Option &option_named(CLI::App &app, std::string_view name);

/// Adds a whole number; the help shows its default.
CLI::Option *add_count(CLI::App &app, const std::string &name, std::uint32_t &target, Range<std::uint32_t> range,
                       const std::string &help);
CLI::Option *add_count(CLI::App &app, const std::string &name, std::uint64_t &target, Range<std::uint64_t> range,
                       const std::string &help);
/// Adds a seed: any whole number below 2^64.
CLI::Option *add_seed(CLI::App &app, std::uint64_t &target, const std::string &help);
/// Adds a finite number; the help shows its default.
CLI::Option *add_number(CLI::App &app, const std::string &name, double &target, Range<double> range,
                        const std::string &help);

/// Returns all values of an enumeration of workloads.
template <class Value>
Choices<Value> choices_of() {
  Choices<Value> choices;
  for (const Named<Value> &named : kValues<Value>) choices.emplace_back(named.name, named.value);
  return choices;
}

/// Adds an option with a list of choices, which the help shows. `Target` is Value or std::optional<Value>.
template <class Value, class Target>
CLI::Option *add_choice(CLI::App &app, const std::string &name, Target &target, const Choices<Value> &choices,
                        const std::string &help) {
  std::vector<std::string> names;
  std::string listed;
  for (const auto &[text, value] : choices) {
    names.push_back(text);
    listed += (listed.empty() ? "" : ", ") + text;
  }
  const auto set = [&target, name, choices, names](const std::string &given) {
    for (const auto &[text, value] : choices) {
      if (text == given) {
        target = value;
        return;
      }
    }
    reject(name, in_quotes(given) + " is not a valid choice", suggestion(given, names));
  };
  return app.add_option_function<std::string>(name, set, help + ": " + listed)->type_name("NAME");
}

/// --folder, where live pages are: live::kFolder or any folder.
CLI::Option *add_pages_folder(CLI::App &app, std::string &folder);

}  // namespace redag::cli
