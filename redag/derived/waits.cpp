// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/derived/waits.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "redag/base/int128.hpp"

namespace redag {

bool has_waits(const Workload &workload) {
  return std::any_of(workload.dags.begin(), workload.dags.end(), [](const Dag &dag) {
    return std::any_of(dag.tasks.begin(), dag.tasks.end(), [](const Task &task) { return !task.waits.empty(); });
  });
}

Result<void> refuse_waits(const Workload &workload, std::string_view who) {
  for (const Dag &dag : workload.dags) {
    for (const Task &task : dag.tasks) {
      if (task.waits.empty()) continue;
      return make_error(fmt::format("{} cannot handle waits, and task '{}.{}' has segments", who, dag.name, task.name),
                        "state 'wcet:' in place of 'segments:', or use what knows them (docs/model.md, \"Waits\")");
    }
  }
  return {};
}

Duration wait_point(const Task &task, std::size_t wait, Duration demand) {
  // The first nanosecond of each stretch is not scaled. Therefore the points keep their order, with none on another.
  const Duration fixed = static_cast<Duration>(wait) + 1;
  const Duration of_wcet = task.wcet - shortest_demand(task);
  if (of_wcet == 0) return fixed;
  const Int128 scaled = Int128{task.waits[wait].after - fixed} * (demand - shortest_demand(task)) / of_wcet;
  return fixed + static_cast<Duration>(scaled);
}

Duration shortest_demand(const Task &task) { return static_cast<Duration>(task.waits.size()) + 1; }

Duration longest_waits(const Task &task) {
  Duration sum = 0;
  for (const Wait &wait : task.waits) sum = std::min(kMaxDuration, sum + std::min(kMaxDuration, wait.longest));
  return sum;
}

}  // namespace redag
