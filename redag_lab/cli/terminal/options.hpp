// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Command-line options whose values have a text form of this project: durations, names of choices, processors. What is
// wrong with a value is said in the words that a workload file would get. Called while the program starts; no threads.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "redag/base/text.hpp"
#include "redag/base/time.hpp"
#include "redag/model/workload.hpp"

namespace redag::cli {

template <class Value>
using Choices = std::vector<std::pair<std::string, Value>>;

/// Throws CLI::ValidationError: "--period-min: ...".
[[noreturn]] void reject(const std::string &option, const std::string &message, const std::string &hint = {});

/// "5ms"; not negative, and positive unless `zero_allowed`.
CLI::Option *add_duration(CLI::App &app, const std::string &name, std::optional<Duration> &target,
                          const std::string &help, bool zero_allowed = false);
CLI::Option *add_duration(CLI::App &app, const std::string &name, Duration &target, const std::string &help,
                          bool zero_allowed = false);

/// The values that a number can have, ends included; said in words where it has another one.
template <class Number>
struct Range {
  Number least;
  Number most;
};

/// Where nothing but the machine sets a limit: so many threads, combinations, restarts, recorded events.
inline constexpr std::uint32_t kMaxJobs = 1024;
inline constexpr std::uint32_t kMaxRestarts = 1'000'000;
inline constexpr std::uint64_t kMaxCombinations = 1'000'000'000;
inline constexpr std::uint64_t kMaxEvents = 1'000'000'000;

/// The option of `app` that is called `name` ("--out"), which must exist. CLI::App::get_option() ends the process where
/// memory is short: it compares names in a function that must not throw.
CLI::Option &option_named(CLI::App &app, std::string_view name);

/// A whole number; shows its default.
CLI::Option *add_count(CLI::App &app, const std::string &name, std::uint32_t &target, Range<std::uint32_t> range,
                       const std::string &help);
CLI::Option *add_count(CLI::App &app, const std::string &name, std::uint64_t &target, Range<std::uint64_t> range,
                       const std::string &help);
/// Any whole number below 2^64.
CLI::Option *add_seed(CLI::App &app, std::uint64_t &target, const std::string &help);
/// A finite number; shows its default.
CLI::Option *add_number(CLI::App &app, const std::string &name, double &target, Range<double> range,
                        const std::string &help);

/// "3" within `range`; throws as reject() does.
[[nodiscard]] std::uint32_t parse_count(const std::string &name, const std::string &text, Range<std::uint32_t> range);

/// "0,2-5" -> {0, 2, 3, 4, 5}.
[[nodiscard]] std::optional<std::vector<int>> parse_cpu_list(std::string_view text);

/// The nearest candidate in quotes, "did you mean 'x'?", or the list of all: "one of a, b, c".
[[nodiscard]] std::string suggestion(std::string_view given, const std::vector<std::string> &candidates);

/// A name out of a list of choices; the help shows them. `Target` is Value or std::optional<Value>.
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
    reject(name, in_quotes(given) + " is not a choice", suggestion(given, names));
  };
  return app.add_option_function<std::string>(name, set, help + ": " + listed)->type_name("NAME");
}

[[nodiscard]] const Choices<PolicyKind> &policy_choices();
[[nodiscard]] const Choices<Ties> &ties_choices();
[[nodiscard]] const Choices<PreemptionMode> &preemption_choices();

}  // namespace redag::cli
