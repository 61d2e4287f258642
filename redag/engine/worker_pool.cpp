// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/engine/worker_pool.hpp"

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
  const BeforeOrdinaryThreads promptly(setup.fifo_priority > 0);
  std::vector<ThreadStart> starts;
  starts.reserve(threads_.size());
  for (auto &thread : threads_) {
    setup.name = prefix + std::to_string(thread->index);
    setup.processor = &thread->processor;
    starts.emplace_back(setup, [main, &self = *thread] { main(self); });
    if (!starts.back().created()) break;
  }
  Result<void> result;
  for (std::size_t i = 0; i < starts.size(); ++i) {
    Result<ThreadHandle> started = starts[i].finish();
    if (started) {
      threads_[i]->handle = *std::move(started);
      threads_[i]->cpu_clock = cpu_clock_of(threads_[i]->handle);
    } else if (result) {
      result = tl::unexpected(started.error());
    }
  }
  return result;
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
