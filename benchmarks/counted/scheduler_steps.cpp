// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Runs jobs through the scheduler, for tools/count_instructions to count the instructions.
//
//   redag_scheduler_steps TASKS PREEMPTION MAX_ACTIVE STEPS       PREEMPTION: 0 none, 1 cooperative, 2 full
#include <cstdio>
#include <cstdlib>

#include "benchmarks/scheduler_loop.hpp"

int main(int argc, char **argv) {
  if (argc != 5) {
    std::fputs("usage: redag_scheduler_steps TASKS PREEMPTION MAX_ACTIVE STEPS\n", stderr);
    return 2;
  }
  const auto number = [&](int i) { return std::strtoul(argv[i], nullptr, 10); };
  redag::benchmarks::SchedulerLoop loop(number(1), static_cast<redag::sched::Preemption>(number(2)),
                                        static_cast<std::uint32_t>(number(3)));
  for (unsigned long i = number(4); i > 0; --i) loop.step();
  return 0;
}
