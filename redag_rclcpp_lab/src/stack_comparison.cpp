// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "stack_comparison.hpp"

#include <fmt/format.h>
#include <stdlib.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <sstream>
#include <stdexcept>

#include "samples.hpp"

namespace redag_rclcpp::lab {

namespace {

double read_number(const std::string &option, const std::string &text, bool whole) {
  std::size_t read = 0;
  double value = 0;
  try {
    value = std::stod(text, &read);
  } catch (const std::exception &) {
    read = 0;
  }
  if (read != text.size() || text.empty() || !(value > 0) || !std::isfinite(value)) {
    throw std::invalid_argument(fmt::format("{} is '{}', but must be a number above 0", option, text));
  }
  if (whole && (value != std::floor(value) || value > 1e6)) {
    throw std::invalid_argument(fmt::format("{} is '{}', but must be a whole number of at most 1000000", option, text));
  }
  return value;
}

/// Throws std::invalid_argument for an unknown option or a bad value.
StackOptions parse(const StackComparison &comparison, const std::vector<std::string> &arguments) {
  StackOptions options;
  options.config = comparison.config;
  for (std::size_t i = 0; i < arguments.size(); i += 2) {
    const std::string &option = arguments[i];
    if (i + 1 == arguments.size()) throw std::invalid_argument(option + " needs a value, or is no option (see --help)");
    const std::string &value = arguments[i + 1];
    const auto number = std::find_if(comparison.numbers.begin(), comparison.numbers.end(),
                                     [&](const NumberOption &candidate) { return candidate.name == option; });
    if (number != comparison.numbers.end()) {
      *number->value = read_number(option, value, number->whole);
    } else if (option == "--rounds") {
      options.rounds = static_cast<int>(read_number(option, value, true));
    } else if (option == "--seconds") {
      options.seconds = read_number(option, value, false);
    } else if (option == "--only") {
      options.only = value;
    } else if (option == "--config") {
      options.config = value;
    } else if (option == "--logs") {
      options.logs = value;
    } else {
      throw std::invalid_argument(option + " is no option (see --help)");
    }
  }
  if (options.config != "none" && !std::filesystem::is_regular_file(options.config)) {
    throw std::invalid_argument(fmt::format("--config: there is no file '{}'", options.config));
  }
  return options;
}

/// The contenders that --only names. Throws std::invalid_argument for an unknown one.
std::vector<std::string> selected(const std::vector<std::string> &all, const std::string &only) {
  if (only.empty()) return all;
  std::vector<std::string> some;
  std::istringstream names(only);
  for (std::string name; std::getline(names, name, ',');) {
    if (std::find(all.begin(), all.end(), name) == all.end()) {
      throw std::invalid_argument(
          fmt::format("--only: '{}' is not in this comparison, which has: {}", name, fmt::join(all, ", ")));
    }
    some.push_back(name);
  }
  return some;
}

using Results = std::map<std::string, std::map<std::string, std::vector<double>>>;  // by figure, then by contender

void print_medians(const Results &results, const std::vector<std::string> &contenders) {
  fmt::print("{:28}", "medians");
  for (const std::string &contender : contenders) fmt::print("{:>12}", contender);
  for (const auto &[figure, by_contender] : results) {
    fmt::print("\n{:28}", figure);
    for (const std::string &contender : contenders) {
      const auto values = by_contender.find(contender);
      if (values == by_contender.end()) {
        fmt::print("{:>12}", "-");
      } else {
        fmt::print("{:>12.3f}", median(values->second));
      }
    }
  }
  fmt::print("\n");
}

int compare(const StackComparison &comparison, const StackOptions &options,
            const std::vector<std::string> &contenders) {
  std::string folder = options.logs;
  if (folder.empty()) {
    folder = (std::filesystem::temp_directory_path() / (comparison.program + ".XXXXXX")).string();
    if (mkdtemp(folder.data()) == nullptr) throw std::runtime_error("cannot make a folder such as " + folder);
  }
  Results results;
  for (int round = 1; round <= options.rounds; ++round) {
    for (const std::string &contender : contenders) {
      const StackRun run{contender, fmt::format("{}/{}.{}", folder, contender, round)};
      std::filesystem::remove_all(run.folder);  // of an earlier comparison with the same --logs
      std::filesystem::create_directories(run.folder);
      try {
        const Figures figures = comparison.measure(run, options);
        fmt::print(stderr, "round {} of {}: {}:", round, options.rounds, contender);
        for (const auto &[figure, value] : figures) {
          results[figure][contender].push_back(value);
          fmt::print(stderr, " {} {:.2f};", figure, value);
        }
        fmt::print(stderr, "\n");
      } catch (const std::exception &error) {
        fmt::print(stderr, "{}: {}: {}; what its processes printed is in {}\n", comparison.program, contender,
                   error.what(), run.folder);
        return 1;
      }
    }
  }
  if (options.logs.empty()) std::filesystem::remove_all(folder);
  print_medians(results, contenders);
  return 0;
}

}  // namespace

int run_comparison(const StackComparison &comparison, const std::vector<std::string> &arguments) {
  if (std::count(arguments.begin(), arguments.end(), "--help") != 0) {
    fmt::print("{}", comparison.help);
    return 0;
  }
  StackOptions options;
  std::vector<std::string> contenders;
  try {
    options = parse(comparison, arguments);
    contenders = selected(comparison.contenders, options.only);
  } catch (const std::invalid_argument &error) {
    fmt::print(stderr, "{}: {}\n", comparison.program, error.what());
    return 2;
  }
  try {
    return compare(comparison, options, contenders);
  } catch (const std::exception &error) {
    fmt::print(stderr, "{}: {}\n", comparison.program, error.what());
    return 1;
  }
}

}  // namespace redag_rclcpp::lab
