// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Bodies that wait without a thread: a body is a coroutine if it returns redag::Coroutine. While it waits at a
// co_await, its worker runs other jobs, and it may go on on another thread. docs/runtime.md, "Bodies that wait", has
// the rules. Frames come from a pool: once as many exist as are needed at a time, nothing allocates.
#pragma once

#include <chrono>
#include <coroutine>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <utility>

#include "redag/base/ids.hpp"
#include "redag/base/time.hpp"

namespace redag {

/// Thrown by a co_await whose wait was ended because the executor stops, or because the job's task is removed from it
/// (in ROS 2: its node). It is not a std::exception, so that it passes a body's own handlers. Let it pass: the job then
/// ends, and counts as in flight.
struct WaitCancelled {};

namespace runtime {

class Engine;

namespace detail {

struct EventState;

/// One wait of a job, from its co_await until it goes on. It lives in the frame of the coroutine that waits.
struct Wait {
  enum class Kind : std::uint8_t { Sleep, Event, Device };

  Kind kind = Kind::Sleep;
  bool cancelled = false;       // see WaitCancelled
  bool timed_out = false;       // Event: `until` has passed
  bool is_over = false;         // the job is woken
  Time until = kNever;          // Sleep, Event: when it ends at the latest (CLOCK_MONOTONIC)
  EventState *event = nullptr;  // Event
  DeviceId device{};            // Device
  // Device: what its thread calls while it serves the job.
  void (*function)(void *argument) = nullptr;
  void *argument = nullptr;
  std::exception_ptr exception{};  // that left the function
  // Set when the wait begins:
  std::coroutine_handle<> coroutine{};
  Engine *engine = nullptr;
  JobSlot job{};
  Wait *next = nullptr;  // Event: another wait for it

  /// Tells the engine that the calling job waits. The engine begins the wait once the coroutine is suspended.
  void suspend(std::coroutine_handle<> its_coroutine) noexcept;
  /// Throws WaitCancelled, or what left the function, if there is anything to throw.
  void resume() const;
};

[[nodiscard]] void *allocate_frame(std::size_t size);
void free_frame(void *frame, std::size_t size) noexcept;

struct Awaiter {
  Wait wait{};

  [[nodiscard]] bool await_ready() const noexcept { return false; }
  void await_suspend(std::coroutine_handle<> coroutine) noexcept { wait.suspend(coroutine); }
  void await_resume() const { wait.resume(); }
};

struct Sleep : Awaiter {};

}  // namespace detail
}  // namespace runtime

/// The body of a job that can wait, or a part of such a body that another Coroutine awaits. It begins when the engine,
/// or a co_await, begins it. Owns its frame.
class [[nodiscard]] Coroutine {
 public:
  struct promise_type;
  using Handle = std::coroutine_handle<promise_type>;

  Coroutine() = default;
  explicit Coroutine(Handle handle) noexcept : handle_(handle) {}
  Coroutine(Coroutine &&other) noexcept : handle_(std::exchange(other.handle_, {})) {}
  Coroutine &operator=(Coroutine &&other) noexcept {
    std::swap(handle_, other.handle_);
    return *this;
  }
  ~Coroutine() {
    if (handle_) handle_.destroy();
  }

  /// For the engine.
  [[nodiscard]] Handle handle() const noexcept { return handle_; }

  struct Part;

 private:
  Handle handle_{};
};

/// Awaits another Coroutine: that one runs at once, as a function that is called.
struct Coroutine::Part {
  Handle handle;

  [[nodiscard]] bool await_ready() const noexcept { return false; }
  [[nodiscard]] Handle await_suspend(std::coroutine_handle<> caller) const noexcept;
  void await_resume() const;
};

struct Coroutine::promise_type {
  std::coroutine_handle<> caller = std::noop_coroutine();  // goes on when this one has ended
  std::exception_ptr exception;

  [[nodiscard]] Coroutine get_return_object() noexcept { return Coroutine(Handle::from_promise(*this)); }
  [[nodiscard]] std::suspend_always initial_suspend() const noexcept { return {}; }
  [[nodiscard]] auto final_suspend() const noexcept {
    struct Final {
      [[nodiscard]] bool await_ready() const noexcept { return false; }
      [[nodiscard]] std::coroutine_handle<> await_suspend(Handle ended) const noexcept {
        return ended.promise().caller;
      }
      void await_resume() const noexcept {}
    };
    return Final{};
  }
  void return_void() const noexcept {}
  void unhandled_exception() noexcept { exception = std::current_exception(); }

  // A Coroutine awaits only what the engine knows: anything else would never go on.
  [[nodiscard]] static Part await_transform(const Coroutine &part) noexcept { return Part{part.handle()}; }
  template <class Awaited>
  requires requires(Awaited &&awaited) { std::forward<Awaited>(awaited).in_coroutine(); }
  [[nodiscard]] static decltype(auto) await_transform(Awaited &&awaited) {
    return std::forward<Awaited>(awaited).in_coroutine();
  }
  [[nodiscard]] static runtime::detail::Sleep await_transform(runtime::detail::Sleep sleep) noexcept { return sleep; }

  [[nodiscard]] static void *operator new(std::size_t size) { return runtime::detail::allocate_frame(size); }
  static void operator delete(void *frame, std::size_t size) noexcept { runtime::detail::free_frame(frame, size); }
};

inline Coroutine::Handle Coroutine::Part::await_suspend(std::coroutine_handle<> caller) const noexcept {
  handle.promise().caller = caller;
  return handle;
}

inline void Coroutine::Part::await_resume() const {
  if (handle.promise().exception) std::rethrow_exception(handle.promise().exception);
}

/// co_await sleep_until(t): the job goes on at `time`, or when a worker is free for it after that.
[[nodiscard]] inline runtime::detail::Sleep sleep_until(std::chrono::steady_clock::time_point time) noexcept {
  return {{.wait = {.until = std::chrono::nanoseconds(time.time_since_epoch()).count()}}};
}

/// The time this long from now; the last one that there is if it is later.
template <class Rep, class Period>
[[nodiscard]] std::chrono::steady_clock::time_point from_now(std::chrono::duration<Rep, Period> duration) noexcept {
  using std::chrono::nanoseconds;
  using std::chrono::steady_clock;
  const std::chrono::duration<double, std::nano> about = duration;
  const bool is_endless = about.count() >= static_cast<double>(kMaxDuration);
  const Duration exactly = is_endless ? kNever : std::chrono::duration_cast<nanoseconds>(duration).count();
  const nanoseconds now = steady_clock::now().time_since_epoch();
  return steady_clock::time_point(nanoseconds(saturated_add(now.count(), exactly)));
}

/// co_await sleep_for(d): as sleep_until(), `duration` from now.
[[nodiscard]] inline runtime::detail::Sleep sleep_for(std::chrono::nanoseconds duration) noexcept {
  return sleep_until(from_now(duration));
}

}  // namespace redag
