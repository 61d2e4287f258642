// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// One worker runs control at 200 Hz beside a camera whose frames need an accelerator for 8 ms, and a service that
// answers on a thread of its own. Both wait without the worker. With plain functions, control would miss its deadlines.
#include <atomic>
#include <chrono>
#include <cstdio>
#include <thread>

#include "redag/redag.hpp"

using namespace std::chrono_literals;
using namespace redag::runtime;

namespace {

// Stands for a driver's call that submits work and returns when it is done.
void infer() { std::this_thread::sleep_for(8ms); }

// Answers each request after a while, as a service in another process would.
class MapService {
 public:
  redag::AsyncEvent answered;

  void request() { requests_.fetch_add(1); }
  void serve_until(const std::atomic<bool> &end) {
    for (int served = 0; !end;) {
      std::this_thread::sleep_for(1ms);
      if (served == requests_) continue;
      ++served;
      answered.set();
    }
  }

 private:
  std::atomic<int> requests_{0};
};

}  // namespace

int main() {
  ExecutorOptions options;
  options.workers = 1;
  options.devices = {{.name = "gpu"}};  // one slot, for the most urgent job that asks
  Executor executor(options);
  const DeviceHandle gpu = executor.device("gpu");
  MapService map;

  DagBuilder control("control");
  control.timer("step", 5ms, [] {}, {.wcet = 100us});
  const redag::DagId control_dag = executor.add(std::move(control));

  int frames = 0;
  DagBuilder camera("camera");
  const TaskHandle grab = camera.timer("grab", 25ms, [] {});
  camera.data("detect", {grab}, [&]() -> redag::Coroutine {
    co_await gpu.run(infer);
    map.request();
    co_await map.answered;
    ++frames;
  });
  executor.add(std::move(camera));

  std::atomic<bool> end{false};
  std::thread service([&] { map.serve_until(end); });
  executor.run_for(500ms);
  end = true;
  service.join();

  const TaskStats stats = executor.stats(control_dag)[0];
  std::printf("%d frames through the accelerator; control ran %llu times beside it, %llu times late\n", frames,
              static_cast<unsigned long long>(stats.jobs.finished), static_cast<unsigned long long>(stats.late));
  return frames > 0 ? 0 : 1;
}
