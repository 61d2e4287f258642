// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A driver's thread releases the tasks of a DAG: they run when a sensor delivers, not on a grid. The minimum
// inter-arrival time is a promise to the other DAGs. Releases that break it are skipped and counted.
#include <chrono>
#include <cstdio>
#include <thread>

#include "redag/redag.hpp"

using namespace std::chrono_literals;
using namespace redag::runtime;

int main() {
  Executor executor;
  DagBuilder lidar("lidar", {.deadline = 40ms});
  const EventHandle scan = lidar.event("scan", 20ms, [] {}, {.wcet = 2ms});
  int detections = 0;
  lidar.data("detect", {scan}, [&] { ++detections; }, {.wcet = 5ms});
  const redag::DagId dag = executor.add(std::move(lidar));
  executor.start();

  std::thread driver([&] {
    for (int i = 0; i < 10; ++i) {
      std::this_thread::sleep_for(25ms);  // the sensor's rate
      executor.release(scan);
      if (i == 5) executor.release(scan);  // an interrupt that bounces
    }
  });
  driver.join();
  std::this_thread::sleep_for(50ms);
  executor.stop();

  const TaskStats stats = executor.stats(dag)[0];
  std::printf("%d detections of %llu scans, %llu of which came too early\n", detections,
              static_cast<unsigned long long>(stats.jobs.released), static_cast<unsigned long long>(stats.early));
}
