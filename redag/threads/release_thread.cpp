// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/threads/release_thread.hpp"

#include <utility>

#include "redag/base/lock_guard.hpp"

namespace redag::runtime {
namespace {

constexpr Time kUnknown = -1;  // of alarm_at_: whatever comes next is to be set

}  // namespace

ReleaseThread::~ReleaseThread() {
  stop();
  join();
}

Result<void> ReleaseThread::start(const ThreadSetup &setup) {
  if (thread_.joinable()) return {};
  if (!alarm_.open()) {
    return make_error("the release timer needs a file descriptor, and the process may open no more files",
                      "raise the limit: ulimit -n");
  }
  const LockGuard guard(priority_lock_);
  ThreadSetup own = setup;
  if (priority_ > 0) own.fifo_priority = priority_;
  Result<ThreadHandle> started = start_thread(own, [this] { main(); });
  if (!started) return tl::unexpected(started.error());
  thread_ = *std::move(started);
  alive_ = thread_.native_handle();
  return {};
}

bool ReleaseThread::set_priority(int priority) noexcept {
  const LockGuard guard(priority_lock_);
  if (std::exchange(priority_, priority) == priority || !alive_ || priority == 0) return true;
  return set_fifo_priority(*alive_, priority);
}

Time ReleaseThread::release_due() {
  const LockGuard guard(lock_);
  const Time next = expire();
  set_alarm();
  return next;
}

Time ReleaseThread::lead(Duration patience) {
  const LockGuard guard(lock_);
  led_ = expire();
  patience_ = patience;
  set_alarm();
  return led_;
}

void ReleaseThread::follow() {
  const LockGuard guard(lock_);
  led_ = kNever;
  set_alarm();
}

void ReleaseThread::stop() noexcept {
  stopping_.store(true, std::memory_order_release);
  alarm_.ring();
}

void ReleaseThread::join() {
  if (thread_.joinable()) thread_.join();
}

void ReleaseThread::main() noexcept {
  run();
  const LockGuard guard(priority_lock_);  // start() has left it
  alive_.reset();
}

void ReleaseThread::run() noexcept {
  for (;;) {
    // Read before the clock: a stop seen here happened before the clock is read. Releases due by then are all made.
    const bool stopping = stopping_.load(std::memory_order_acquire);
    {
      const LockGuard guard(lock_);
      expire();
      alarm_at_ = kUnknown;  // it has gone off, or was rung
      set_alarm();
      ended_ = stopping;  // other threads release nothing after this one's end
    }
    if (stopping) return;
    alarm_.wait();
  }
}

Time ReleaseThread::expire() {
  const MustReact here;
  const Time next = ended_ ? kNever : expire_();
  next_.store(next, std::memory_order_relaxed);
  return next;
}

void ReleaseThread::set_alarm() {
  Time at = next_.load(std::memory_order_relaxed);
  if (at == led_) at = patience_ == kNever || at == kNever ? kNever : at + patience_;
  if (at == alarm_at_) return;
  alarm_at_ = at;
  alarm_.set(at);
}

}  // namespace redag::runtime
