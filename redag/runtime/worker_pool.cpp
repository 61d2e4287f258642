// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/worker_pool.hpp"

#include <algorithm>
#include <string>
#include <utility>

namespace redag::runtime {
namespace {

// Any thread can run most of the jobs, but not all threads can do so at once. Large pools share the room of 64 threads.
std::size_t events_of_thread(std::size_t trace_capacity, std::uint32_t threads) {
  constexpr std::size_t kWhole = 64;
  constexpr std::size_t kLeast = 4096;
  if (threads <= kWhole) return trace_capacity;
  return std::max(std::min(trace_capacity, kLeast), trace_capacity * kWhole / threads);
}

}  // namespace

WorkerPool::WorkerPool(std::uint32_t threads, std::size_t trace_capacity) : caller_(threads, trace_capacity) {
  for (std::uint32_t i = 0; i < threads; ++i) {
    threads_.push_back(std::make_unique<WorkerThread>(i, events_of_thread(trace_capacity, threads)));
  }
  caller_.stack.reserve(1);
}

Result<void> WorkerPool::start(ThreadSetup setup, const std::function<void(WorkerThread &)> &main) {
  const std::string prefix = setup.name + "-";
  for (auto &thread : threads_) {
    setup.name = prefix + std::to_string(thread->index);
    setup.processor = &thread->processor;
    Result<ThreadHandle> started = start_thread(setup, [main, &self = *thread] { main(self); });
    if (!started) return tl::unexpected(started.error());
    thread->handle = *std::move(started);
    thread->cpu_clock = cpu_clock_of(thread->handle);
  }
  return {};
}

void WorkerPool::end() {
  ending_.store(true, std::memory_order_release);
  for (auto &thread : threads_) thread->parker.unpark();
  for (auto &thread : threads_) {
    if (thread->handle.joinable()) thread->handle.join();
  }
}

void WorkerPool::forget_processors() {
  for (auto &thread : threads_) thread->processor = nullptr;
}

}  // namespace redag::runtime
