// What the commands that analyse a workload ask for alike: the workload, and the platform on which it is looked at.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>

#include "redag/analysis/system.hpp"
#include "redag/cli/run_arguments.hpp"
#include "redag/model/workload.hpp"

namespace redag::cli {

struct AnalysisArguments {
  RunArguments run;
  std::uint32_t levels = 0;  // 0: one a task
};

/// --json, --all-tasks, --check (with this help) and everything about the platform. FILE is the command's own.
void add_analysis_arguments(CLI::App &app, AnalysisArguments &arguments, const std::string &check_help);

[[nodiscard]] analysis::AnalysisPlatform platform_for(const Workload &workload, const AnalysisArguments &arguments);

}  // namespace redag::cli
