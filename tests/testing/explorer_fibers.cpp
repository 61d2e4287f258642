// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The program's threads as fibers of one thread: each runs to its next operation, and stops there until it is chosen.
#include <cxxabi.h>

#include <cstdlib>
#include <utility>

#include "tests/testing/explorer_parts.hpp"

namespace redag::testing::exploring {
namespace {

constexpr std::size_t kStack = std::size_t{256} << 10U;

EhGlobals *eh_globals() { return reinterpret_cast<EhGlobals *>(abi::__cxa_get_globals()); }

}  // namespace

// Runs until all threads have ended, or one has failed.
void Explorer::run_fibers() {
  const EhGlobals eh = *eh_globals();
  swapcontext(&home_, &fibers_[0].context);
  *eh_globals() = eh;
  for (const ThreadState &state : thread_states_) state.set(0);
}

// After a failure the fibers stay where they are: what they own can no longer be destroyed.
void Explorer::abandon_fibers() {
  for (Fiber &fiber : fibers_) {
    static_cast<void>(fiber.stack.release());
    new (&fiber.body) std::function<void()>();
  }
}

void Explorer::entry() {
  Explorer &self = *explorer;
  const std::uint32_t me = self.current_;
  self.fibers_[me].body();
  self.fibers_[me].body = nullptr;
  self.fibers_[me].state = State::Ended;
  self.leave();
}

void Explorer::switch_to(std::uint32_t thread) {
  if (thread == current_) return;
  Fiber &from = fibers_[current_];
  Fiber &to = fibers_[thread];
  for (std::size_t i = 0; i < thread_states_.size(); ++i) {
    from.thread_states[i] = thread_states_[i].get();
    thread_states_[i].set(to.thread_states[i]);
  }
  from.eh = *eh_globals();
  *eh_globals() = to.eh;
  current_ = thread;
  swapcontext(&from.context, &to.context);
}

// Called when the calling fiber has ended.
void Explorer::leave() {
  if (!local_callers_.empty()) {
    const std::uint32_t back = local_callers_.back();
    local_callers_.pop_back();
    switch_to(back);
  }
  schedule();
  std::abort();  // an ended fiber is not chosen
}

std::uint32_t Explorer::spawn(std::function<void()> body) {
  if (count_ == kMaxThreads) fail("too many threads");
  const std::uint32_t thread = count_++;
  Fiber &fiber = fibers_[thread];
  if (!fiber.stack) fiber.stack = std::make_unique<char[]>(kStack);
  fiber.body = std::move(body);
  fiber.thread_states.assign(thread_states_.size(), 0);
  fiber.eh = EhGlobals{};
  fiber.clock = thread == 0 ? Clock{} : fibers_[current_].clock;
  fiber.state = State::Local;
  getcontext(&fiber.context);
  fiber.context.uc_stack.ss_sp = fiber.stack.get();
  fiber.context.uc_stack.ss_size = kStack;
  fiber.context.uc_link = nullptr;
  makecontext(&fiber.context, &Explorer::entry, 0);
  if (thread > 0) run_until_visible(thread);
  return thread;
}

// Runs the thread to its next operation at once, because no other thread can notice what it does until then.
void Explorer::run_until_visible(std::uint32_t thread) {
  local_callers_.push_back(current_);
  switch_to(thread);
}

// Called when the calling fiber has reached its next operation.
void Explorer::stop_at(State state, const Operation &operation, std::uint32_t target) {
  Fiber &fiber = fibers_[current_];
  fiber.state = state;
  fiber.pending = operation;
  fiber.target = target;
  if (!local_callers_.empty()) {
    const std::uint32_t back = local_callers_.back();
    local_callers_.pop_back();
    switch_to(back);
  } else {
    schedule();
  }
}

void Explorer::perform(const Operation &operation, State state, std::uint32_t target) {
  stop_at(state, operation, target);
  fibers_[current_].state = State::Local;
}

void Explorer::lock(ObjectId mutex) {
  perform(Operation{"lock", {mutex, kNoObject}, {true, false}}, State::Locking, mutex);
  objects_[mutex].locked = true;
}

void Explorer::unlock(ObjectId mutex) {
  if (!objects_[mutex].locked) fail("a mutex is unlocked that nobody holds");
  objects_[mutex].locked = false;
  objects_[mutex].unlocked = fibers_[current_].clock;
}

void Explorer::join(std::uint32_t thread) { perform(Operation{"join", {}, {}}, State::Joining, thread); }

void Explorer::settle() { perform(Operation{"settle", {}, {}}, State::Settling); }

bool Explorer::wait(ObjectId word, const std::function<bool()> &blocked, std::int64_t deadline) {
  perform(Operation{"futex wait", {word, kNoObject}, {true, false}});
  if (!blocked()) return true;
  Fiber &fiber = fibers_[current_];
  const bool timed = deadline < explored::kForever;
  fiber.woken = false;
  fiber.deadline = deadline;
  fiber.queued = ++queue_;
  if (!timed && options_.spurious_wakeups == 0) {
    stop_at(State::Sleeping, Operation{"sleep", {}, {}}, word);
    fiber.state = State::Local;
    return true;
  }
  const ObjectId other = timed ? kClock : kSpurious;
  perform(Operation{timed ? "wake or time out" : "wake", {word, other}, {true, true}}, State::Dozing, word);
  if (fiber.woken) return true;
  if (!timed) {
    --spurious_left_;
    return true;
  }
  time = std::max(time, deadline);
  return false;
}

void Explorer::wake(ObjectId word, int count) {
  perform(Operation{"futex wake", {word, kNoObject}, {true, false}});
  for (; count > 0; --count) {
    std::uint32_t first = kMaxThreads;
    for (std::uint32_t t = 0; t < count_; ++t) {
      const Fiber &fiber = fibers_[t];
      const bool asleep = fiber.state == State::Sleeping || (fiber.state == State::Dozing && !fiber.woken);
      if (!asleep || fiber.target != word) continue;
      if (first == kMaxThreads || fiber.queued < fibers_[first].queued) first = t;
    }
    if (first == kMaxThreads) return;
    fibers_[first].woken = true;
    if (fibers_[first].state == State::Sleeping) {
      fibers_[first].clock.join(fibers_[current_].clock);
      run_until_visible(first);
    }
  }
}

void Explorer::fail(const std::string &message) {
  result_.failure = message + "\n" + describe();
  failed_ = true;
  setcontext(&home_);
  std::abort();
}

std::string Explorer::describe() const {
  std::string text = "after";
  std::uint32_t last = kMaxThreads;
  for (const Event &event : events_) {
    if (event.thread != last) text += "\n  thread " + std::to_string(event.thread) + ":";
    last = event.thread;
    text += std::string(" ") + event.operation.what;
    if (event.operation.objects[0] != kNoObject) text += " " + std::to_string(event.operation.objects[0]);
    text += ";";
  }
  text += "\nthen\n";
  for (std::uint32_t t = 0; t < count_; ++t) {
    const Fiber &fiber = fibers_[t];
    text += "  thread " + std::to_string(t) + ": ";
    text += fiber.state == State::Ended ? "ended" : fiber.state == State::Local ? "running" : fiber.pending.what;
    if (fiber.state == State::Sleeping || fiber.state == State::Locking || fiber.state == State::Joining) {
      text += " " + std::to_string(fiber.target);
    }
    text += "\n";
  }
  return text;
}

}  // namespace redag::testing::exploring
