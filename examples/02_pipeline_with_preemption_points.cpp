// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Two rates share one worker: a control chain every 5 ms and a detector that computes for 40 ms. The program runs them
// three times. Without preemption the chain waits for the detector. With preemption points the chain runs in between.
// With preemption `os`, where the process may use SCHED_FIFO, the detector needs no preemption points at all.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <stdexcept>

#include "redag/redag.hpp"

using namespace std::chrono_literals;
using namespace redag::runtime;

namespace {

void compute(std::chrono::nanoseconds time) {
  while (redag::job_cpu_time() < time.count()) {
  }
}

void run(redag::PreemptionMode mode) {
  Executor executor({.workers = 1, .preemption = mode});
  redag::Time last = 0;
  redag::Duration longest_gap = 0;

  DagBuilder control("control");
  const TaskHandle imu = control.timer("imu", 5ms, [] { compute(200us); }, {.wcet = 300us});
  control.data("pid", {imu}, [&] {
    const redag::Time now = std::chrono::steady_clock::now().time_since_epoch() / 1ns;
    if (last != 0) longest_gap = std::max(longest_gap, now - last);
    last = now;
  });
  const redag::DagId control_id = executor.add(std::move(control));

  DagBuilder vision("vision");
  vision.timer("detect", 100ms, [] {
    for (int row = 1; row <= 400; ++row) {
      compute(row * 100us);
      redag::preemption_point();  // a more urgent job may run here; with `os`, anywhere
    }
  });
  executor.add(std::move(vision));

  executor.run_for(1s);
  const redag::sched::Accounting imu_jobs = executor.stats(control_id)[0].jobs;
  std::printf("%-12s longest time between two pid jobs %6.2f ms, imu jobs skipped %llu of %llu\n",
              redag::to_string(executor.mode().mode), static_cast<double>(longest_gap) / 1e6,
              static_cast<unsigned long long>(imu_jobs.skipped), static_cast<unsigned long long>(imu_jobs.released));
}

}  // namespace

int main() {
  run(redag::PreemptionMode::None);
  run(redag::PreemptionMode::Cooperative);
  try {
    run(redag::PreemptionMode::Os);
  } catch (const std::runtime_error &refused) {
    std::printf("os           %s\n", refused.what());
  }
}
