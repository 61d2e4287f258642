// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// An OpenCL device as a device of the executor: two DAGs share it beside control. The camera needs short kernels 20
// times a second, mapping long ones. The jobs wait for the device without a worker. With the executor's queue the
// camera goes first; a driver serves in the order of requests:
//
//     example_accelerator            the most urgent job first
//     example_accelerator --fifo     in the order of requests, for comparison
#include <chrono>
#include <cstdio>
#include <cstring>
#include <exception>

#include "accelerator.hpp"
#include "redag/redag.hpp"

using namespace std::chrono_literals;
using namespace redag::runtime;

namespace {

constexpr auto kShortKernel = 2ms;
constexpr auto kLongKernel = 12ms;

int run(redag::Device::Queue queue) {
  Accelerator accelerator;
  const Accelerator::Work short_work = accelerator.work_of(kShortKernel);
  const Accelerator::Work long_work = accelerator.work_of(kLongKernel);

  ExecutorOptions options;
  options.workers = 1;
  options.measure = true;
  options.devices = {{.name = "opencl", .queue = queue}};  // one slot: one kernel at a time
  Executor executor(options);
  const DeviceHandle device = executor.device("opencl");

  DagBuilder control("control");
  control.timer("step", 5ms, [] {}, {.wcet = 100us});
  const redag::DagId control_dag = executor.add(std::move(control));

  DagBuilder camera("camera");
  camera.timer("detect", 50ms,
               [&]() -> redag::Coroutine { co_await device.run([&] { accelerator.run(short_work); }); });
  const redag::DagId camera_dag = executor.add(std::move(camera));

  for (int i = 1; i <= 4; ++i) {  // their requests queue up while the camera exposes its next frame
    DagBuilder mapping("mapping_" + std::to_string(i));
    mapping.timer("update", 150ms,
                  [&]() -> redag::Coroutine { co_await device.run([&] { accelerator.run(long_work); }); },
                  {.offset = 30ms});
    executor.add(std::move(mapping));
  }
  executor.run_for(2s);

  const TaskStats detect = executor.stats(camera_dag)[0];
  const TaskStats step = executor.stats(control_dag)[0];
  std::printf("%s, %s: camera %llu frames, p99 %.1f ms, longest %.1f ms; control late %llu times of %llu\n",
              accelerator.name().c_str(),
              queue == redag::Device::Queue::Fifo ? "in the order of requests" : "the most urgent first",
              static_cast<unsigned long long>(detect.jobs.finished),
              static_cast<double>(detect.response.percentile(0.99)) / 1e6,
              static_cast<double>(detect.response.longest()) / 1e6, static_cast<unsigned long long>(step.late),
              static_cast<unsigned long long>(step.jobs.finished));
  return detect.jobs.finished > 0 ? 0 : 1;
}

}  // namespace

int main(int argc, char **argv) {
  const bool fifo = argc == 2 && std::strcmp(argv[1], "--fifo") == 0;
  if (argc > 2 || (argc == 2 && !fifo)) {
    std::fprintf(stderr, "usage: %s [--fifo]\n", argv[0]);
    return 2;
  }
  try {
    return run(fifo ? redag::Device::Queue::Fifo : redag::Device::Queue::Priority);
  } catch (const std::exception &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
