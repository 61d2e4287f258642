// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/watchdog.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "redag/threads/clock.hpp"

namespace redag::runtime {
namespace {

thread_local const Watchdog *watchdog_of_this_thread = nullptr;

}  // namespace

Watchdog::Watchdog(Engine &engine, WatchdogOptions options, Report report)
    : engine_(engine), options_(options), report_(std::move(report)) {
  options_.interval = std::max(options_.interval, kMillisecond);
  overdue_.reserve(engine.thread_count());  // watch() appends under the engine's lock
}

bool Watchdog::is_this_thread() const { return watchdog_of_this_thread == this; }

void Watchdog::stop() {
  if (!thread_.joinable()) return;
  stop_.set();
  thread_.join();
}

Result<void> Watchdog::start(const ThreadSetup &setup) {
  if (thread_.joinable()) return {};
  return start_thread(setup, [this] { main(); }).map([this](ThreadHandle &&thread) { thread_ = std::move(thread); });
}

void Watchdog::look(Time as_of) {
  overdue_.clear();
  engine_.watch(options_.limits, as_of, overdue_);
  for (const OverdueJob &job : overdue_) report_(job);
}

void Watchdog::main() noexcept {
  watchdog_of_this_thread = this;
  while (!stop_.wait_until(monotonic_now() + options_.interval)) look(engine_.now());
}

std::string describe(const OverdueJob &job) {
  const bool mostly_off = job.used < job.elapsed / 2;
  return fmt::format("in progress for {}, with {} of processor time{}", humanize_duration(job.elapsed),
                     humanize_duration(job.used),
                     mostly_off ? "; it waits, or more urgent jobs keep it off the processors" : "");
}

}  // namespace redag::runtime
