// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The explorer's own types: fibers, their pending operations, and the tree of tried choices. For explorer*.cpp only.
#pragma once

#include <ucontext.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "tests/testing/explorer.hpp"

namespace redag::testing::exploring {

inline constexpr std::uint32_t kMaxThreads = 10;
inline constexpr ObjectId kClock = 0;
inline constexpr ObjectId kSpurious = 1;  // the remaining wake-ups without a cause
using Mask = std::uint32_t;
inline constexpr Mask bit(std::uint32_t thread) { return Mask{1} << thread; }

// The last event of each thread that is known to have come before. Events are counted from 1 over all of a run.
struct Clock {
  std::array<std::uint32_t, kMaxThreads> at{};
  void join(const Clock &other) {
    for (std::uint32_t t = 0; t < kMaxThreads; ++t) at[t] = std::max(at[t], other.at[t]);
  }
};

// A visible operation: up to two objects, each read or written. Operations of two threads depend on each other if they
// share an object and one of them writes it.
struct Operation {
  const char *what = "";
  std::array<ObjectId, 2> objects{kNoObject, kNoObject};
  std::array<bool, 2> writes{};
};

inline bool dependent(const Operation &a, const Operation &b) {
  for (std::size_t i = 0; i < 2; ++i) {
    if (a.objects[i] == kNoObject) continue;
    for (std::size_t j = 0; j < 2; ++j) {
      if (a.objects[i] == b.objects[j] && (a.writes[i] || b.writes[j])) return true;
    }
  }
  return false;
}

struct Object {
  Clock written;
  Clock read;
  std::vector<std::uint32_t> events;  // that touched the object, in order
  // For a mutex.
  bool locked = false;
  Clock unlocked;
};

enum class State : std::uint8_t {
  Local,     // on its way to its next operation
  Ready,     // its operation can be executed
  Locking,   // ready once the mutex is free
  Joining,   // ready once the thread has ended
  Settling,  // ready once no other thread is
  Sleeping,  // in a futex wait that only a wake ends
  Dozing,    // in a futex wait that can also end without a wake; that end is its operation
  Ended,
};

// The state of a thread's exception handling: each fiber has its own.
struct EhGlobals {
  void *caught = nullptr;
  unsigned int uncaught = 0;
};
static_assert(sizeof(EhGlobals) == 2 * sizeof(void *));

struct Fiber {
  ucontext_t context{};
  std::unique_ptr<char[]> stack;
  std::function<void()> body;
  std::vector<std::uintptr_t> thread_states;
  EhGlobals eh;
  State state = State::Ended;
  Operation pending;
  std::uint32_t target = 0;  // Joining: the thread; Locking: the mutex; Sleeping, Dozing: the word
  std::int64_t deadline = 0;
  bool woken = false;
  std::uint64_t queued = 0;  // order of falling asleep
  Clock clock;
};

struct Event {
  std::uint32_t thread = 0;
  Operation operation;
  Clock clock;  // of this event and all that came before it
  [[nodiscard]] bool after(std::uint32_t whose, std::uint32_t index) const { return clock.at[whose] > index; }
};

// A state that a run passed, with the choices tried there and those still to be tried.
struct Node {
  Mask enabled = 0;
  Mask backtrack = 0;
  Mask done = 0;
  Mask sleep = 0;
  std::uint32_t chosen = 0;
  std::array<Operation, kMaxThreads> pending;
};

class Explorer {
 public:
  Explorer(const std::function<void()> &program, const ExploreOptions &options, std::vector<ThreadState> thread_states)
      : program_(program), options_(options), thread_states_(std::move(thread_states)) {}

  Exploration run();

  // ---- called by fibers ----
  ObjectId new_object() {
    if (object_count_ == objects_.size()) objects_.emplace_back();
    Object &object = objects_[object_count_];
    object.written = object.read = object.unlocked = Clock{};
    object.events.clear();
    object.locked = false;
    return object_count_++;
  }
  void perform(const Operation &operation, State state = State::Ready, std::uint32_t target = 0);
  void unlock(ObjectId mutex);
  bool wait(ObjectId word, const std::function<bool()> &blocked, std::int64_t deadline);
  void wake(ObjectId word, int count);
  std::uint32_t spawn(std::function<void()> body);
  void join(std::uint32_t thread);
  void settle();
  void calm(bool on) { calm_ = on; }
  void lock(ObjectId mutex);
  [[noreturn]] void fail(const std::string &message);
  [[nodiscard]] std::uint32_t self() const { return current_; }

  std::int64_t time = 0;
  [[nodiscard]] bool time_passes() const { return options_.time_passes; }

 private:
  void run_fibers();
  void abandon_fibers();
  static void entry();
  void begin_run();
  void stop_at(State state, const Operation &operation, std::uint32_t target);
  void run_until_visible(std::uint32_t thread);
  void switch_to(std::uint32_t thread);
  void leave();
  [[nodiscard]] bool enabled(std::uint32_t thread) const;
  // True if no wake reached the thread: it could only time out, or wake without a cause.
  [[nodiscard]] bool dozes(std::uint32_t thread) const {
    return fibers_[thread].state == State::Dozing && !fibers_[thread].woken;
  }
  void schedule();
  bool choose(std::uint32_t &thread, Mask can);
  // Prefers the current thread; this keeps changes of thread few.
  [[nodiscard]] std::uint32_t first_of(Mask threads) const {
    return (threads & bit(current_)) != 0 ? current_ : static_cast<std::uint32_t>(__builtin_ctz(threads));
  }
  void record(std::uint32_t thread);
  void synchronise(Fiber &fiber);
  void find_races(const Clock &before);
  void add_backtrack(std::uint32_t event);
  bool next_run();
  [[nodiscard]] std::string describe() const;

  const std::function<void()> &program_;
  ExploreOptions options_;
  std::vector<ThreadState> thread_states_;
  Exploration result_;
  std::vector<Node> nodes_;
  std::deque<Object> objects_;
  ObjectId object_count_ = 0;
  std::vector<Event> events_;
  std::array<Fiber, kMaxThreads> fibers_;
  std::uint32_t count_ = 0;                   // number of fibers in this run
  std::uint32_t current_ = 0;                 // the fiber that executes
  std::vector<std::uint32_t> local_callers_;  // fibers that wait until current_ reaches its next operation
  ucontext_t home_{};
  std::uint32_t steps_ = 0;
  bool calm_ = false;
  bool redundant_ = false;  // this run repeats another; it only has to finish
  bool failed_ = false;
  std::uint64_t queue_ = 0;
  std::uint32_t spurious_left_ = 0;
};

extern Explorer *explorer;  // the running one, or null

}  // namespace redag::testing::exploring
