// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Runs one job with the core alone: the linker fails where the core needs another part of the library.
#include <fmt/format.h>

#include <atomic>
#include <memory>
#include <vector>

#include "redag/engine/engine.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag/threads/clock.hpp"

namespace {

redag::Workload one_task() {
  redag::Task task;
  task.name = "task";
  task.period = task.deadline = redag::kMillisecond;
  redag::Dag dag;
  dag.name = "dag";
  dag.tasks.push_back(task);
  redag::Workload workload;
  workload.dags.push_back(dag);
  return workload;
}

}  // namespace

int main() {
  using namespace redag;
  const Workload workload = one_task();
  runtime::EngineOptions options;
  options.config.policy = workload.policy;
  std::atomic<bool> done{false};
  runtime::Engine engine(std::make_unique<sched::PriorityScheduler>(workload, options.config), options);
  engine.bind(workload, {[&](const runtime::Job &) {
                done = true;
                done.notify_one();
                return sched::Outcome::Finished;
              }});
  if (!engine.start()) return 1;
  engine.set_origin(runtime::monotonic_now());
  engine.release(TaskId(0), 0);
  done.wait(false);
  fmt::print("one job ran\n");
  return 0;
}
