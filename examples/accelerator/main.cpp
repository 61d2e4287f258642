// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// An accelerator as a device of the executor: five DAGs share it beside control. The camera needs short kernels 20
// times a second, mapping long ones. The jobs wait for it without a worker. Built with OpenCL (example_accelerator) and
// with CUDA (example_accelerator_cuda):
//
//     example_accelerator                 the executor's queue: the most urgent job first
//     example_accelerator fifo            the executor's queue, in the order of requests
//     example_accelerator streams         each DAG submits to a queue of the driver, the camera to an urgent one
//     example_accelerator equal-streams   the same, and none is urgent
//     example_accelerator priority 60     for that many seconds (default: 2)
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <functional>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>

#include "accelerator.hpp"
#include "redag/redag.hpp"

using namespace std::chrono_literals;
using namespace redag::runtime;

namespace {

constexpr auto kShortKernel = 2ms;
constexpr auto kLongKernel = 12ms;

enum class Order { Priority, Fifo, Streams, EqualStreams };

struct Named {
  Order order;
  std::string_view name;
  const char *text;
};
constexpr Named kOrders[] = {{Order::Priority, "priority", "the most urgent first"},
                             {Order::Fifo, "fifo", "in the order of requests"},
                             {Order::Streams, "streams", "streams of the driver, one of them urgent"},
                             {Order::EqualStreams, "equal-streams", "streams of the driver, none of them urgent"}};

/// The body of a task whose kernel the executor's device runs.
std::function<redag::Coroutine()> queued(Accelerator &accelerator, DeviceHandle device, Accelerator::Work work) {
  return [&accelerator, device, work]() -> redag::Coroutine {
    co_await device.run([&accelerator, work] { accelerator.run(work); });
  };
}

/// The body of a task that submits its kernel to the driver, which calls back.
std::function<redag::Coroutine()> submitted(Accelerator &accelerator, bool urgent, Accelerator::Work work) {
  return [&accelerator, work, stream = accelerator.stream(urgent),
          done = std::make_shared<redag::AsyncEvent>()]() -> redag::Coroutine {
    accelerator.submit(*stream, work, [done] { done->set(); });
    // A driver does not call back for a kernel that failed.
    if (!co_await done->wait_until(std::chrono::steady_clock::now() + 5s)) {
      throw std::runtime_error("the device has not answered for 5 s");
    }
  };
}

int run(const Named &named, std::chrono::seconds duration) {
  Accelerator accelerator;
  const Accelerator::Work short_work = accelerator.work_of(kShortKernel);
  const Accelerator::Work long_work = accelerator.work_of(kLongKernel);
  const bool streams = named.order == Order::Streams || named.order == Order::EqualStreams;

  ExecutorOptions options;
  options.workers = 1;
  options.measure = true;
  options.devices = {
      {.name = "accelerator",  // one slot: one kernel at a time
       .queue = named.order == Order::Fifo ? redag::Device::Queue::Fifo : redag::Device::Queue::Priority}};
  Executor executor(options);
  const DeviceHandle device = executor.device("accelerator");
  const auto body = [&](Accelerator::Work work, bool urgent) {
    return streams ? submitted(accelerator, urgent && named.order == Order::Streams, work)
                   : queued(accelerator, device, work);
  };

  DagBuilder control("control");
  control.timer("step", 5ms, [] {}, {.wcet = 100us});
  const redag::DagId control_dag = executor.add(std::move(control));

  DagBuilder camera("camera");
  camera.timer("detect", 50ms, body(short_work, true));
  const redag::DagId camera_dag = executor.add(std::move(camera));

  for (int i = 1; i <= 4; ++i) {  // their requests queue up while the camera exposes its next frame
    DagBuilder mapping("mapping_" + std::to_string(i));
    mapping.timer("update", 150ms, body(long_work, false), {.offset = 30ms});
    executor.add(std::move(mapping));
  }
  executor.run_for(duration);

  const TaskStats detect = executor.stats(camera_dag)[0];
  const TaskStats step = executor.stats(control_dag)[0];
  const auto ms = [&](redag::Duration time) { return static_cast<double>(time) / 1e6; };
  std::printf(
      "%s, %s: camera %llu frames, median %.2f ms, p99 %.2f ms, longest %.2f ms; control late %llu times of %llu\n",
      accelerator.name().c_str(), named.text, static_cast<unsigned long long>(detect.jobs.finished),
      ms(detect.response.quantile(0.5)), ms(detect.response.quantile(0.99)), ms(detect.response.longest()),
      static_cast<unsigned long long>(step.late), static_cast<unsigned long long>(step.jobs.finished));
  return detect.jobs.finished > 0 ? 0 : 1;
}

std::optional<Named> find(std::string_view name) {
  for (const Named &named : kOrders) {
    if (named.name == name) return named;
  }
  return std::nullopt;
}

}  // namespace

int main(int argc, char **argv) {
  const std::optional<Named> named = argc > 1 ? find(argv[1]) : kOrders[0];
  const std::chrono::seconds duration{argc > 2 ? std::atoi(argv[2]) : 2};
  if (!named || argc > 3 || duration < 1s) {
    std::fprintf(stderr, "usage: %s [priority|fifo|streams|equal-streams [SECONDS]]\n", argv[0]);
    return 2;
  }
  try {
    return run(*named, duration);
  } catch (const std::exception &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
