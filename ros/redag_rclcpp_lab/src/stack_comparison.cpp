// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "stack_comparison.hpp"

#include <fmt/format.h>
#include <stdlib.h>

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <stdexcept>

#include "command_line.hpp"

namespace redag_rclcpp::lab {
namespace {

using Results = std::map<std::string, std::map<std::string, std::vector<double>>>;  // by figure, then by contender

void print_medians(const Results &results, const std::vector<std::string> &contenders) {
  std::size_t width = 28;
  for (const auto &[figure, by_contender] : results) width = std::max(width, figure.size() + 1);
  fmt::print("{:{}}", "medians", width);
  for (const std::string &contender : contenders) fmt::print("{:>12}", contender);
  for (const auto &[figure, by_contender] : results) {
    fmt::print("\n{:{}}", figure, width);
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

// With an empty `logs`, what the processes print is kept only if a run fails.
int compare(const StackComparison &comparison, const StackOptions &options, const std::vector<std::string> &contenders,
            const std::string &logs) {
  std::string folder = logs;
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
        return kExitNo;
      }
    }
  }
  if (logs.empty()) std::filesystem::remove_all(folder);
  print_medians(results, contenders);
  return kExitOk;
}

}  // namespace

void add_samples(Figures &figures, const std::string &name, const Samples &samples) {
  if (samples.size() == 0) return;
  figures[name + ", ms, p50"] = samples.milliseconds(0.5);
  figures[name + ", ms, p99"] = samples.milliseconds(0.99);
}

int run_comparison(const StackComparison &comparison, int argc, char **argv) {
  StackOptions options;
  options.config = comparison.config;
  std::vector<std::string> contenders = comparison.contenders;
  std::string logs;
  CLI::App app(comparison.description, comparison.program);
  app.footer(comparison.explanation);
  add_number<int>(app, "--rounds", options.rounds, 1, "Runs of each contender, which take turns");
  add_number<double>(app, "--seconds", options.seconds, 0.001, "Measured time of a run");
  add_list(app, "--only", contenders, "Some of the contenders")
      ->check(CLI::Validator(CLI::IsMember(comparison.contenders)).description(""));
  app.add_option("--config", options.config,
                 fmt::format("Workload file of ReDAGExecutor (default:\n"
                             "config/stacks/{} of redag_rclcpp);\n"
                             "none: it starts without a file",
                             std::filesystem::path(comparison.config).filename().string()))
      ->type_name("FILE")
      ->check([](const std::string &file) {
        return file == "none" || std::filesystem::is_regular_file(file) ? std::string()
                                                                        : fmt::format("there is no file '{}'", file);
      });
  app.add_option("--logs", logs, "Keeps what the processes print and note")->type_name("FOLDER");
  comparison.add_options(app);
  if (const std::optional<int> status = parse_arguments(app, argc, argv)) return *status;
  try {
    return compare(comparison, options, contenders, logs);
  } catch (const std::exception &error) {
    fmt::print(stderr, "{}: {}\n", comparison.program, error.what());
    return kExitNo;
  }
}

}  // namespace redag_rclcpp::lab
