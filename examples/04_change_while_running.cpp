// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Adds and removes DAGs while others run, and stops on Ctrl-C.
#include <cstdio>

#include "redag/redag.hpp"

using namespace std::chrono_literals;
using namespace redag::runtime;

int main() {
  Executor executor;
  redag::DagId inspection;  // the DAG of the mode that is switched on and off
  bool inspecting = false;
  int seconds = 0;
  DagBuilder supervisor("supervisor");
  supervisor.timer("decide", 200ms, [&] {
    if (inspecting) {
      executor.remove(inspection);
      std::puts("inspection off");
    } else {
      DagBuilder dag("inspection");
      const TaskHandle camera = dag.timer("camera", 50ms, [] { std::puts("  picture"); });
      dag.data("check", {camera}, [] { std::puts("  checked"); });
      inspection = executor.add(std::move(dag));
      std::puts("inspection on");
    }
    inspecting = !inspecting;
    if (++seconds == 6) executor.stop();
  });
  executor.add(std::move(supervisor));
  const int signal = executor.run_until_signal();
  std::printf("stopped by %s\n", signal == 0 ? "itself" : "a signal");
}
