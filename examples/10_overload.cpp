// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A DAG of high criticality keeps its deadlines when one of its jobs takes longer than planned: the others are degraded
// until the overload is over. Each DAG says by itself what is to become of it.
#include <cstdio>

#include "redag/redag.hpp"

using namespace std::chrono_literals;
using namespace redag;
using namespace redag::runtime;

namespace {

void compute(std::chrono::nanoseconds time) {
  while (job_cpu_time() < time.count()) preemption_point();
}

}  // namespace

int main() {
  Executor executor({.workers = 1, .preemption = PreemptionMode::Cooperative});

  DagBuilder brake("brake", {.criticality = Criticality::High, .deadline = 20ms});
  int jobs = 0;
  // It mostly needs 1 ms. Whoever plans with 8 ms, its proven worst case, wastes the processor.
  brake.timer("check", 20ms, [&] { compute(++jobs % 8 == 0 ? 7ms : 1ms); },
              {.wcet = 8ms, .bcet = 1ms, .wcet_low = 2ms, .region = 10us});
  const DagId brake_id = executor.add(std::move(brake));

  // In an overload two of three pictures are left out.
  DagBuilder camera("camera", {.criticality = Criticality::Low, .degrade = {.kind = Degrade::Kind::Skip, .skip = 2}});
  const TaskHandle picture = camera.timer("picture", 30ms, [] { compute(5ms); }, {.wcet = 6ms, .jitter = 1ms});
  // A search that takes too long continues behind everything else. Two searches may overlap.
  camera.data("search", {picture}, [] { compute(5ms); },
              {.wcet = 6ms, .budget = 5ms, .on_budget = OnBudget::Demote, .concurrency = 2});
  const DagId camera_id = executor.add(std::move(camera));

  executor.run_for(1s);
  for (const DagId dag : {brake_id, camera_id}) {
    for (const TaskStats &task : executor.stats(dag)) {
      std::printf("%-14s released %2llu, finished late %2llu, skipped %2llu\n", task.task.c_str(),
                  static_cast<unsigned long long>(task.jobs.released), static_cast<unsigned long long>(task.late),
                  static_cast<unsigned long long>(task.jobs.skipped));
    }
  }
}
