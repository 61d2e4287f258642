// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The smallest program: one task runs every 100 ms, and its body ends the run.
#include <cstdio>

#include "redag/redag.hpp"

using namespace std::chrono_literals;
using redag::runtime::DagBuilder;
using redag::runtime::Executor;

int main() {
  Executor executor;
  int jobs = 0;
  DagBuilder greeter("greeter");
  greeter.timer("hello", 100ms, [&] {
    std::printf("hello %d\n", ++jobs);
    if (jobs == 5) executor.stop();
  });
  executor.add(std::move(greeter));

  const auto &mode = executor.mode();
  std::printf("preemption: %s (%s)\n", redag::to_string(mode.mode), mode.reason.c_str());
  executor.run();
}
