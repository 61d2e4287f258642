// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Runs the Autoware reference system (github.com/ros-realtime/reference-system) under every executor. Measures the
// latency of its hot path from the lidar drivers to the collision estimator, the samples dropped on this path, the
// jitter of the behavior planner, and processor time. Executors take turns, each in a process of its own. Built if the
// package autoware_reference_system is present.
//
//   ros2 run redag_rclcpp_lab bench_reference_system [--rounds 3] [--seconds 20] [--only mte,redag-os]
//
// Prefix it with `chrt -f 40` to give rclcpp's executors real-time threads as well.
#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include "autoware_reference_system/autoware_system_builder.hpp"
#include "autoware_reference_system/system/timing/default.hpp"
#include "contenders.hpp"
#include "rclcpp/rclcpp.hpp"
#include "reference_system/system/type/rclcpp_system.hpp"
#include "samples.hpp"

namespace {

using redag_rclcpp::lab::Contender;
using redag_rclcpp::lab::contenders;
using redag_rclcpp::lab::median;

constexpr double kWarmUp = 2;  // seconds at the start that are left out

// Runs the system under one executor, and prints the measurements to standard output.
int run_system(const Contender &contender, double seconds) {
  rclcpp::init(0, nullptr);
  rclcpp::get_logger("redag_rclcpp").set_level(rclcpp::Logger::Level::Error);
  auto nodes = create_autoware_nodes<RclcppSystem, nodes::timing::Default>();
  const auto executor = contender.make();
  for (auto &node : nodes) executor->add_node(node);
  std::thread timer([&] {
    std::this_thread::sleep_for(std::chrono::duration<double>(kWarmUp + seconds));
    executor->cancel();
  });
  executor->spin();
  timer.join();
  for (auto &node : nodes) executor->remove_node(node);
  nodes.clear();
  rclcpp::shutdown();
  return 0;
}

struct Series {
  std::vector<double> values;
  [[nodiscard]] double sum() const {
    double sum = 0;
    for (const double value : values) sum += value;
    return sum;
  }
  [[nodiscard]] double mean() const { return values.empty() ? 0 : sum() / static_cast<double>(values.size()); }
  [[nodiscard]] double max() const { return values.empty() ? 0 : *std::max_element(values.begin(), values.end()); }
  [[nodiscard]] double deviation() const {
    double squares = 0;
    for (const double value : values) squares += (value - mean()) * (value - mean());
    return values.size() < 2 ? 0 : std::sqrt(squares / static_cast<double>(values.size() - 1));
  }
};

using Figures = std::map<std::string, double>;

// Runs this program again as `contender` and reads its measurements. Exits if it fails.
Figures measure(const Contender &contender, double seconds) {
  int ends[2];
  if (pipe(ends) != 0) {
    std::perror("pipe");
    std::exit(1);
  }
  const pid_t child = fork();
  if (child == 0) {
    dup2(ends[1], STDOUT_FILENO);
    close(ends[0]);
    const std::string duration = std::to_string(seconds);
    execl("/proc/self/exe", "bench_reference_system", "--system", contender.name.c_str(), duration.c_str(), nullptr);
    _exit(2);
  }
  close(ends[1]);
  std::map<std::string, Series> series;
  const std::vector<std::string> known = {"hot path latency:", "hot path drops:", "behavior planner period:"};
  FILE *out = fdopen(ends[0], "r");
  const auto begin = std::chrono::steady_clock::now();
  for (char line[512]; std::fgets(line, sizeof line, out) != nullptr;) {
    if (std::chrono::steady_clock::now() - begin < std::chrono::duration<double>(kWarmUp)) continue;
    for (const std::string &name : known) {
      const char *found = std::strstr(line, name.c_str());
      if (found != nullptr) series[name].values.push_back(std::atof(found + name.size()));
    }
  }
  std::fclose(out);
  int status = 0;
  rusage usage{};
  wait4(child, &status, 0, &usage);
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0 || series.empty()) {
    std::fprintf(stderr, "%s: the system did not run to its end\n", contender.name.c_str());
    std::exit(1);
  }
  const auto in_seconds = [](const timeval &t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  const Series &latency = series["hot path latency:"];
  const Series &period = series["behavior planner period:"];
  return {{"hot path mean, ms", latency.mean()},
          {"hot path max, ms", latency.max()},
          {"hot path sigma, ms", latency.deviation()},
          {"hot path samples", static_cast<double>(latency.values.size())},
          {"hot path drops", series["hot path drops:"].sum()},
          {"planner sigma, ms", period.deviation()},
          {"processors", (in_seconds(usage.ru_utime) + in_seconds(usage.ru_stime)) / (kWarmUp + seconds)}};
}

}  // namespace

int main(int argc, char **argv) {
  const std::vector<Contender> all = contenders();
  if (argc == 4 && std::string(argv[1]) == "--system") {
    for (const Contender &contender : all) {
      if (contender.name == argv[2]) return run_system(contender, std::atof(argv[3]));
    }
    return 2;
  }
  int rounds = 3;
  double seconds = 20;
  std::string only;
  for (int i = 1; i < argc; i += 2) {
    const std::string option = argv[i];
    if (i + 1 == argc || (option != "--rounds" && option != "--seconds" && option != "--only")) {
      std::fprintf(stderr, "usage: %s [--rounds 3] [--seconds 20] [--only mte,redag-os]\n", argv[0]);
      return 2;
    }
    if (option == "--rounds") rounds = std::atoi(argv[i + 1]);
    if (option == "--seconds") seconds = std::atof(argv[i + 1]);
    if (option == "--only") only = argv[i + 1];
  }
  std::map<std::string, std::map<std::string, std::vector<double>>> results;  // by figure, then by executor
  std::vector<std::string> names;
  for (int round = 0; round < rounds; ++round) {
    for (const Contender &contender : all) {
      if (!only.empty() && ("," + only + ",").find("," + contender.name + ",") == std::string::npos) continue;
      if (round == 0) names.push_back(contender.name);
      std::fprintf(stderr, "round %d of %d: %s\n", round + 1, rounds, contender.name.c_str());
      for (const auto &[figure, value] : measure(contender, seconds)) results[figure][contender.name].push_back(value);
    }
  }
  if (names.empty()) {
    std::fprintf(stderr, "no executor is called '%s'\n", only.c_str());
    return 2;
  }
  fmt::print("{:20}", "medians");
  for (const std::string &name : names) fmt::print("{:>12}", name);
  for (auto &[figure, by_name] : results) {
    fmt::print("\n{:20}", figure);
    for (const std::string &name : names) fmt::print("{:>12.3f}", median(by_name[name]));
  }
  fmt::print("\n");
}
