// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Functions of bytes that run the readers of outside input. A target returns, or it ends the process: a failed
// REDAG_CHECK, a sanitizer's finding, too much time or memory. Single-threaded.
#pragma once

#include <array>
#include <string_view>

namespace redag::fuzz {

/// Reads workload YAML, for the simulator and for ROS 2 (callbacks, no wcet). An accepted workload must survive being
/// written.
void workload_target(std::string_view input);
/// Reads robots, with their unions and plans.
void robot_target(std::string_view input);
/// Reads plans of experiments.
void plan_target(std::string_view input);
/// Reads events.redag, and makes everything that is made of a trace: checks, summary, jobs.csv, Perfetto, report.
void events_target(std::string_view input);
/// Reads comparison.json beside recorded runs.
void comparison_target(std::string_view input);
/// Reads units.csv of an experiment.
void units_target(std::string_view input);
/// Reads the page of shared memory of `redag top`.
void live_page_target(std::string_view input);
/// Reads what an executor states of its rates.
void order_page_target(std::string_view input);
/// Takes events of ros2_tracing in any order, and makes a workload of every process.
void recording_target(std::string_view input);
/// Parses values of the command line and of files: durations, processors, utilizations, patterns of ROS names.
void values_target(std::string_view input);
/// Runs every subcommand on a workload that the loader accepts.
void commands_target(std::string_view input);

struct Target {
  std::string_view name;
  void (*run)(std::string_view input);
};

inline constexpr std::array kTargets = {
    Target{"workload", workload_target},   Target{"plan", plan_target},
    Target{"events", events_target},       Target{"comparison", comparison_target},
    Target{"units", units_target},         Target{"live_page", live_page_target},
    Target{"values", values_target},       Target{"commands", commands_target},
    Target{"robot", robot_target},         Target{"order_page", order_page_target},
    Target{"recording", recording_target},
};

}  // namespace redag::fuzz
