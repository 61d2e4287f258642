// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Records a run. Afterwards the program's tools read the folder:
//
//     example_07_record results/robot
//     redag report results/robot
//     redag why results/robot
//     redag events results/robot --check
//
// If the program is killed meanwhile, they read what it had recorded.
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

}  // namespace

int main(int argc, char **argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: %s FOLDER\n", argv[0]);
    return 2;
  }
  try {
    Executor executor({.name = "robot", .workers = 1, .preemption = redag::PreemptionMode::None, .record = argv[1]});
    DagBuilder control("control", {.deadline = 5ms});
    const TaskHandle imu = control.timer("imu", 5ms, [] { compute(300us); }, {.wcet = 500us});
    control.data("pid", {imu}, [] { compute(200us); }, {.wcet = 500us});
    executor.add(std::move(control));
    DagBuilder vision("vision");
    vision.timer("detect", 100ms, [] { compute(12ms); }, {.wcet = 15ms});  // control waits for it, and misses
    executor.add(std::move(vision));
    executor.run_for(1s);
    for (const std::string &warning : executor.warnings()) std::printf("warning: %s\n", warning.c_str());
  } catch (const std::runtime_error &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
}
