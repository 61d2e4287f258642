// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Runs a workload file on real threads, with bodies that use the processor time that the file states. It previews a run
// before the callbacks are written.
//
//     example_05_workload_on_threads [WORKLOAD.yaml]
#include <fmt/format.h>

#include "redag/loader/workload_yaml.hpp"
#include "redag_lab/run/run_workload.hpp"

using namespace redag;

int main(int argc, char **argv) {
  const auto file = load_workload(argc > 1 ? argv[1] : REDAG_SOURCE_DIR "/workloads/contention.yaml");
  if (!file) {
    fmt::print(stderr, "{}\n", to_string(file.error()));
    return 2;
  }
  const Workload &workload = file->workload;
  lab::RunOptions options;
  options.duration = 3 * kSecond;
  const auto result = lab::run_workload(workload, options);
  if (!result) {
    fmt::print(stderr, "{}\n", to_string(result.error()));
    return 2;
  }
  fmt::print("preemption: {} ({}), {} events\n", to_string(result->mode.mode), result->mode.reason,
             result->trace.events.size());
  for (const std::string &warning : result->warnings) fmt::print("warning: {}\n", warning);
  for (std::size_t t = 0; t < result->usage.size(); ++t) {
    const runtime::Usage &usage = result->usage[t];
    fmt::print("{:24} {:5} jobs, longest execution {}\n", trace::task_name(workload, TaskId(t)), usage.jobs,
               humanize_duration(usage.longest));
  }
}
