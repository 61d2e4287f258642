// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// An event that jobs await and that any thread sets: the answer of a service, the interrupt of a sensor, the callback
// of a driver. A body awaits it with co_await (coroutine.hpp). Any thread; the lock inherits priority.
#pragma once

#include <chrono>
#include <memory>
#include <span>

#include "redag/engine/coroutine.hpp"

namespace redag {

class AsyncEvent {
 public:
  /// Allocates. No job may wait for an event that is destroyed, and every set() of it must have returned.
  AsyncEvent();
  ~AsyncEvent();
  AsyncEvent(const AsyncEvent &) = delete;
  AsyncEvent &operator=(const AsyncEvent &) = delete;

  /// Ends the wait of all jobs that wait for the event. If there is none, the next job that awaits it goes on at once;
  /// several calls then count as one. Takes the locks of the event and of the engine; allocates nothing. From any
  /// thread and any body, but not from a signal handler.
  void set();
  /// set() of several. The jobs of an engine become ready together: the most urgent one goes on first.
  static void set_all(std::span<AsyncEvent *const> events);
  /// Returns true, and takes it back, if set() was called and no job has awaited the event since then.
  [[nodiscard]] bool take();

  struct Awaiter : runtime::detail::Awaiter {
    AsyncEvent *event = nullptr;

    [[nodiscard]] bool await_ready() const { return event->take(); }
  };
  /// For co_await.
  [[nodiscard]] Awaiter in_coroutine() noexcept;

  class Until;
  /// co_await event.wait_until(t): as co_await event, but no longer than until `time`. Returns false if the event was
  /// not set by then.
  [[nodiscard]] Until wait_until(std::chrono::steady_clock::time_point time) noexcept;

 private:
  std::unique_ptr<runtime::detail::EventState> state_;
};

class AsyncEvent::Until : public runtime::detail::Awaiter {
 public:
  Until(AsyncEvent &event, Time until) noexcept : event_(event) {
    wait.kind = runtime::detail::Wait::Kind::Event;
    wait.event = event.state_.get();
    wait.until = until;
  }
  [[nodiscard]] bool await_ready() { return event_.take(); }
  [[nodiscard]] bool await_resume() const {
    runtime::detail::Awaiter::await_resume();
    return !wait.timed_out;
  }
  /// For co_await.
  [[nodiscard]] Until &in_coroutine() noexcept { return *this; }

 private:
  AsyncEvent &event_;
};

inline AsyncEvent::Until AsyncEvent::wait_until(std::chrono::steady_clock::time_point time) noexcept {
  return {*this, std::chrono::nanoseconds(time.time_since_epoch()).count()};
}

}  // namespace redag
