// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/base/check.hpp"
#include "redag/loader/workload_yaml.hpp"
#include "redag_analysis/metrics/files/jobs_csv.hpp"
#include "tests/fuzz/targets.hpp"

namespace redag::fuzz {

void jobs_csv_target(std::string_view input) {
  static const Workload workload = [] {
    auto loaded = parse_workload(R"(name: w
dags:
  - name: d
    period: 10ms
    tasks:
      - {name: a, wcet: 1ms}
      - {name: "b,\"c", wcet: 1ms, after: [a], activation: data}
)",
                                 "w.yaml");
    REDAG_CHECK(loaded.has_value(), "the workload of this target is sound");
    return loaded->workload;
  }();
  const auto jobs = metrics::parse_jobs_csv(input, "jobs.csv", workload);
  if (!jobs) {
    REDAG_CHECK(!jobs.error().empty(), "a refusal says why");
    return;
  }
  for (const metrics::JobRecord &job : *jobs) REDAG_CHECK(job.task.value < workload.task_count(), "tasks are known");
}

}  // namespace redag::fuzz
