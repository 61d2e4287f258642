// The smallest program outside this repository that uses the library: it fails where a symbol, a header or a dependency
// of the installation is missing.
#include <cstdio>

#include "redag/base/time.hpp"
#include "redag/model/workload.hpp"
#include "redag/version.hpp"

int main() {
  redag::Workload workload;
  redag::Task task;
  task.wcet = redag::kMillisecond;
  task.period = 4 * redag::kMillisecond;
  workload.dags.push_back(redag::Dag{.name = "control", .tasks = {task}});

  const bool right = workload.task_count() == 1 && workload.utilization() == 0.25;
  std::printf("redag %s: %s\n", redag::kVersion, right ? redag::format_duration(task.period).c_str() : "wrong");
  return right ? 0 : 1;
}
