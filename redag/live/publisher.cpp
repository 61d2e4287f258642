// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/live/publisher.hpp"

#include <pthread.h>

#include <algorithm>
#include <cerrno>
#include <ctime>
#include <system_error>
#include <utility>

#include "redag/base/blocked_signals.hpp"

namespace redag::live {
namespace {

Time read_clock(clockid_t clock) {
  timespec now{};
  clock_gettime(clock, &now);
  return static_cast<Time>(now.tv_sec) * kSecond + now.tv_nsec;
}

}  // namespace

Result<std::unique_ptr<Publisher>> Publisher::start(const PublisherOptions &options, Sampler sampler) {
  Result<std::unique_ptr<PageWriter>> writer = PageWriter::create(options.folder);
  if (!writer) return tl::unexpected<Diagnostics>(std::move(writer.error()));
  std::unique_ptr<Publisher> publisher(new Publisher(options, std::move(sampler), *std::move(writer)));
  try {
    const BlockedSignals inherited;
    publisher->thread_ = std::thread([self = publisher.get()] { self->main(); });
  } catch (const std::system_error &error) {
    return make_error(std::string("no live page is published, because its thread cannot be created: ") + error.what());
  }
  return publisher;
}

Publisher::Publisher(const PublisherOptions &options, Sampler sampler, std::unique_ptr<PageWriter> writer)
    : interval_(options.interval),
      sampler_(std::move(sampler)),
      writer_(std::move(writer)),
      builder_(read_clock(CLOCK_MONOTONIC), options.window) {
  frame_.name = options.name;
  frame_.program = program_invocation_short_name;
  frame_.driver = options.driver;
  frame_.preemption = options.preemption;
  frame_.policy = options.policy;
  frame_.workers = options.workers;
  frame_.interval = interval_;
}

Publisher::~Publisher() {
  stop_.store(1, std::memory_order_relaxed);
  futex_wake(stop_, 1);
  if (thread_.joinable()) thread_.join();
}

void Publisher::main() {
  pthread_setname_np(pthread_self(), "redag-live");
  while (stop_.load(std::memory_order_relaxed) == 0) {
    const Time now = read_clock(CLOCK_MONOTONIC);
    publish(now);
    while (stop_.load(std::memory_order_relaxed) == 0 && futex_wait_until(stop_, 0, now + interval_)) {
    }
  }
}

void Publisher::publish(Time now) {
  sample_.alert.clear();
  sample_.dags.clear();
  sample_.tasks.clear();
  sample_.threads.clear();
  sample_.devices.clear();
  sampler_(sample_);
  builder_.build(sample_, now, frame_);
  frame_.publisher_cpu = read_clock(CLOCK_THREAD_CPUTIME_ID);
  writer_->publish(frame_);
}

}  // namespace redag::live
