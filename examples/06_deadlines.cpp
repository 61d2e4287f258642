// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Tells whether deadlines are met: a DAG with an end-to-end deadline, misses as they happen, and the distributions of
// the run. The planner is too slow on purpose, now and then.
#include <cstdio>

#include "redag/redag.hpp"

using namespace std::chrono_literals;
using namespace redag::runtime;

namespace {

void compute(std::chrono::nanoseconds time) {
  while (redag::job_cpu_time() < time.count()) {
  }
}

double in_ms(redag::Duration time) { return static_cast<double>(time) / 1e6; }

}  // namespace

int main() {
  ExecutorOptions options;
  options.measure = true;
  options.on_deadline_miss = [](const MissInfo &miss) { std::printf("missed: %s\n", miss.text.c_str()); };
  Executor executor(options);

  DagBuilder control("control", {.deadline = 15ms});
  int plans = 0;
  const TaskHandle scan = control.timer("scan", 20ms, [] { compute(1ms); }, {.wcet = 2ms});
  control.data("plan", {scan}, [&] { compute(++plans % 10 == 0 ? 18ms : 3ms); }, {.wcet = 4ms, .deadline = 10ms});
  const redag::DagId dag = executor.add(std::move(control));
  executor.run_for(1s);

  const DagStats stats = executor.dag_stats(dag);
  for (const TaskStats &task : stats.tasks) {
    std::printf("%-14s missed %2llu of %2llu, response p50 %6.3f p99 %6.3f longest %6.3f ms, lateness p99 %7.3f ms\n",
                task.task.c_str(), static_cast<unsigned long long>(task.misses()),
                static_cast<unsigned long long>(task.jobs.released), in_ms(task.response.quantile(0.5)),
                in_ms(task.response.quantile(0.99)), in_ms(task.response.longest()), in_ms(task.lateness(0.99)));
  }
  for (const SinkStats &sink : stats.sinks) {
    std::printf("%s answers end to end within %.3f ms (p99 %.3f ms); %llu answers were later than %.0f ms\n",
                stats.dag.c_str(), in_ms(sink.end_to_end.longest()), in_ms(sink.end_to_end.quantile(0.99)),
                static_cast<unsigned long long>(sink.late), in_ms(stats.deadline));
  }
  std::puts(stats.met_every_deadline() ? "every deadline was met" : "not every deadline was met");
}
