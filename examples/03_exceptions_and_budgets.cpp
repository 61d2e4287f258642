// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Shows what happens when a body throws, and when it computes for too long.
#include <cstdio>
#include <stdexcept>

#include "redag/redag.hpp"

using namespace std::chrono_literals;
using namespace redag::runtime;

int main() {
  ExecutorOptions options;
  options.on_exception = [](const ExceptionInfo &info) {
    try {
      std::rethrow_exception(info.exception);
    } catch (const std::runtime_error &error) {
      std::printf("%s, job %u: %s; going on\n", info.task.c_str(), info.job, error.what());
      return OnException::Continue;
    } catch (...) {
      return OnException::Stop;  // run() rethrows the exception
    }
  };
  Executor executor(options);

  DagBuilder sensors("sensors");
  int reads = 0;
  const TaskHandle lidar = sensors.timer("lidar", 50ms, [&] {
    if (++reads % 3 == 0) throw std::runtime_error("no scan");  // the job releases no successor
    if (reads == 10) throw std::logic_error("this one is a bug");
  });
  // This planner would never end. After 5 ms of processor time its next preemption point ends the job.
  sensors.data("plan", {lidar},
               [] {
                 for (;;) redag::preemption_point();
               },
               {.budget = 5ms});
  const redag::DagId dag = executor.add(std::move(sensors));

  try {
    executor.run();
  } catch (const std::logic_error &error) {
    std::printf("stopped by: %s\n", error.what());
  }
  for (const TaskStats &task : executor.stats(dag)) {
    std::printf("%-14s released %2llu finished %2llu aborted %2llu, longest %6.3f ms\n", task.task.c_str(),
                static_cast<unsigned long long>(task.jobs.released),
                static_cast<unsigned long long>(task.jobs.finished), static_cast<unsigned long long>(task.jobs.aborted),
                static_cast<double>(task.usage.longest) / 1e6);
  }
}
