// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fcntl.h>

#include <algorithm>
#include <string>
#include <vector>

#include "redag/base/check.hpp"
#include "redag/base/time.hpp"
#include "redag/loader/workload_yaml.hpp"
#include "redag_lab/cli/terminal/program.hpp"
#include "tests/fuzz/scratch_file.hpp"
#include "tests/fuzz/targets.hpp"

namespace redag::fuzz {
namespace {

// True if the command exits with 0 (yes) or 1 (no). Any other status is a failure.
bool answers(const std::vector<std::string> &arguments) {
  static const int nowhere = ::open("/dev/null", O_WRONLY | O_CLOEXEC);
  cli::Console console(nowhere, {}, nowhere, {});
  const int status = cli::run_program(arguments, console);
  return status == 0 || status == 1;
}

// Limits the run to some releases of the fastest task: its cost grows with their number.
Duration some_releases(const Workload &workload) {
  constexpr Duration kReleases = 30;
  Duration fastest = kSecond;
  for (const TaskRef &ref : flatten(workload)) fastest = std::min(fastest, ref.task->period);
  return std::max(fastest * kReleases, Duration{1});
}

}  // namespace

void commands_target(std::string_view input) {
  const Result<LoadedWorkload> loaded = parse_workload(input, "fuzz.yaml");
  if (!loaded) return;
  const std::string file = scratch_file("workload.yaml", input);
  const std::string results = scratch_folder() + "/results";
  const std::string duration = format_duration(some_releases(loaded->workload));
  REDAG_CHECK(answers({"validate", file, "--json"}), "validate");
  REDAG_CHECK(answers({"validate", file}), "validate, in words");
  for (const char *executor : {"redag-none", "redag-cooperative", "mte", "ste", "static", "events", "cbg"}) {
    REDAG_CHECK(answers({"simulate", file, "--executor", executor, "--duration", duration, "--json"}), executor);
  }
  REDAG_CHECK(answers({"simulate", file, "--duration", duration, "--out", results}), "simulate");
  REDAG_CHECK(answers({"events", "--check", results}), "events --check: what was simulated is lawful");
  REDAG_CHECK(answers({"report", results}), "report");
  REDAG_CHECK(answers({"analyze", file, "--json"}), "analyze");
  constexpr std::size_t kMostTasks = 4;  // limit for the commands that analyse repeatedly
  if (loaded->workload.task_count() > kMostTasks) return;
  if (!loaded->workload.platform.clusters.empty()) return;  // these commands refuse clusters
  REDAG_CHECK(answers({"analyze", file, "--sensitivity", "--json"}), "analyze --sensitivity");
  REDAG_CHECK(answers({"tune", "--judge", "bounds", file, "--json"}), "tune --judge bounds");
}

}  // namespace redag::fuzz
