// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// One worker runs control at 200 Hz beside a logger whose writes block for 12 ms. Inside a redag::Blocking the logger
// has no worker. Without the scope, control would wait for it.
#include <chrono>
#include <cstdio>
#include <thread>

#include "redag/redag.hpp"

using namespace std::chrono_literals;
using namespace redag::runtime;

namespace {

// Stands for fsync(), a serial line or a library's answer: the thread sleeps until it is done.
void write_to_disk() { std::this_thread::sleep_for(12ms); }

}  // namespace

int main() {
  ExecutorOptions options;
  options.workers = 1;
  options.threads = options.workers + 1;  // for the thread that blocks (modes none and cooperative)
  Executor executor(options);

  DagBuilder control("control");
  control.timer("step", 5ms, [] {}, {.wcet = 100us});
  const redag::DagId control_dag = executor.add(std::move(control));

  DagBuilder logger("logger");
  logger.timer("flush", 50ms, [] {
    const redag::Blocking scope;
    write_to_disk();
  });
  const redag::DagId logger_dag = executor.add(std::move(logger));

  executor.run_for(500ms);

  const TaskStats step = executor.stats(control_dag)[0];
  const TaskStats flush = executor.stats(logger_dag)[0];
  std::printf("control ran %llu times, %llu times late, beside %llu writes; %llu of them kept the worker\n",
              static_cast<unsigned long long>(step.jobs.finished), static_cast<unsigned long long>(step.late),
              static_cast<unsigned long long>(flush.jobs.finished), static_cast<unsigned long long>(flush.kept_worker));
  return flush.jobs.finished > 0 && flush.kept_worker == 0 ? 0 : 1;
}
