// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Readers of input from outside as functions of bytes. A target ends by returning; what is wrong with the reader ends
// the process: a failed REDAG_CHECK, a sanitizer's finding, too much time or memory. One thread.
#pragma once

#include <array>
#include <string_view>

namespace redag::fuzz {

/// Workload YAML, for the simulator and for ROS 2 (callbacks, no wcet); what is accepted survives being written.
void workload_target(std::string_view input);
/// Plans of experiments.
void plan_target(std::string_view input);
/// events.jsonl, and everything that is made of a trace: checks, summary, jobs.csv, Perfetto, report.
void trace_target(std::string_view input);
/// jobs.csv.
void jobs_csv_target(std::string_view input);
/// comparison.json beside recorded runs.
void comparison_target(std::string_view input);
/// units.csv of an experiment.
void units_target(std::string_view input);
/// The page of shared memory that `redag top` reads.
void live_page_target(std::string_view input);
/// The record of a run that was killed; what is recovered makes results.
void flight_target(std::string_view input);
/// Values of the command line and of files: durations, processors, utilizations, patterns of ROS names.
void values_target(std::string_view input);
/// A workload that the loader accepts, and every subcommand.
void commands_target(std::string_view input);

struct Target {
  std::string_view name;
  void (*run)(std::string_view input);
};

inline constexpr std::array kTargets = {
    Target{"workload", workload_target},     Target{"plan", plan_target},
    Target{"trace", trace_target},           Target{"jobs_csv", jobs_csv_target},
    Target{"comparison", comparison_target}, Target{"units", units_target},
    Target{"live_page", live_page_target},   Target{"values", values_target},
    Target{"commands", commands_target},     Target{"flight", flight_target},
};

}  // namespace redag::fuzz
