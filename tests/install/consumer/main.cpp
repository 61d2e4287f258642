// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A small program outside this repository that uses the installed library. Building or running it fails if the
// installation lacks a symbol, a header or a dependency.
#include <cstdio>

#include "redag/redag.hpp"

int main() {
  using namespace std::chrono_literals;
  redag::runtime::DagBuilder control("control");
  int runs = 0;
  const auto sense = control.timer("sense", 5ms, [] {});
  control.data("act", {sense}, [&runs] { ++runs; });

  redag::runtime::ExecutorOptions options;
  options.workers = 1;
  options.preemption = redag::PreemptionMode::None;
  redag::runtime::Executor executor(options);
  const redag::DagId dag = executor.add(std::move(control));
  executor.run_for(100ms);

  const auto stats = executor.stats(dag);
  const bool right = runs > 0 && stats.size() == 2 && stats[0].jobs.finished > 0;
  std::printf("redag %s: %d runs of %s\n", redag::kVersion, runs, stats[1].task.c_str());
  return right ? 0 : 1;
}
