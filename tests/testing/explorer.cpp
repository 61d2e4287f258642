// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The search: which fiber continues, and which other orders must be tried.
#include "tests/testing/explorer.hpp"

#include <cstdlib>
#include <utility>

#include "tests/testing/explorer_parts.hpp"

namespace redag::testing {
namespace exploring {
namespace {

constexpr std::uint32_t kMostSteps = 20'000;  // of one run

}  // namespace

Explorer *explorer = nullptr;

bool Explorer::enabled(std::uint32_t thread) const {
  const Fiber &fiber = fibers_[thread];
  switch (fiber.state) {
    case State::Ready: return true;
    case State::Locking: return !objects_[fiber.target].locked;
    case State::Joining: return fibers_[fiber.target].state == State::Ended;
    case State::Dozing: return fiber.woken || fiber.deadline < explored::kForever || spurious_left_ > 0;
    case State::Settling:
      for (std::uint32_t t = 0; t < count_; ++t) {
        if (t == thread || dozes(t)) continue;
        if (fibers_[t].state == State::Settling || enabled(t)) return false;
      }
      return true;
    case State::Local:
    case State::Sleeping:
    case State::Ended: break;
  }
  return false;
}

// Chooses the fiber that executes its pending operation, and switches to it.
void Explorer::schedule() {
  Mask can = 0;
  Mask awake = 0;
  bool all_ended = true;
  for (std::uint32_t t = 0; t < count_; ++t) {
    if (enabled(t)) can |= bit(t);
    if (enabled(t) && !dozes(t)) awake |= bit(t);
    all_ended = all_ended && fibers_[t].state == State::Ended;
  }
  if (all_ended) {
    setcontext(&home_);
    std::abort();
  }
  if (can == 0) fail("nobody can go on: a wake-up was lost, or a deadlock");
  std::uint32_t next = 0;
  if (redundant_ || calm_ || !choose(next, can)) next = first_of(awake != 0 ? awake : can);
  record(next);
  if (++steps_ == kMostSteps) fail("no end in sight: somebody waits in a loop");
  switch_to(next);
}

// Returns false if everything possible here was or will be done elsewhere.
bool Explorer::choose(std::uint32_t &thread, Mask can) {
  const std::size_t depth = events_.size();
  if (depth < nodes_.size()) {
    thread = nodes_[depth].chosen;
    if (nodes_[depth].enabled != can) fail("the program does not do the same twice");
    return true;
  }
  Node node;
  node.enabled = can;
  for (std::uint32_t t = 0; t < count_; ++t) node.pending[t] = fibers_[t].pending;
  if (depth > 0 && options_.reduce) {
    const Node &before = nodes_[depth - 1];
    const Mask asleep = before.sleep | (before.done & ~bit(before.chosen));
    for (std::uint32_t t = 0; t < count_; ++t) {
      const bool sleeps = (asleep & bit(t)) != 0;
      if (sleeps && !dependent(before.pending[t], before.pending[before.chosen])) node.sleep |= bit(t);
    }
  }
  const Mask open = can & ~node.sleep;
  if (open == 0) {
    redundant_ = true;
    return false;
  }
  thread = first_of(open);
  node.chosen = thread;
  node.backtrack = options_.reduce ? bit(thread) : can;
  nodes_.push_back(node);
  return true;
}

// Joins the clocks of what enabled `fiber` to continue.
void Explorer::synchronise(Fiber &fiber) {
  switch (fiber.state) {
    case State::Locking: fiber.clock.join(objects_[fiber.target].unlocked); break;
    case State::Joining: fiber.clock.join(fibers_[fiber.target].clock); break;
    case State::Settling:
      for (std::uint32_t t = 0; t < count_; ++t) fiber.clock.join(fibers_[t].clock);
      break;
    default: break;
  }
}

// Records that `thread` now executes its operation.
void Explorer::record(std::uint32_t thread) {
  Fiber &fiber = fibers_[thread];
  const Operation operation = fiber.pending;
  const Clock before = fiber.clock;
  ++result_.transitions;
  synchronise(fiber);
  if (calm_) return;
  const auto index = static_cast<std::uint32_t>(events_.size());
  for (std::size_t i = 0; i < 2; ++i) {
    if (operation.objects[i] == kNoObject) continue;
    const Object &object = objects_[operation.objects[i]];
    fiber.clock.join(object.written);
    if (operation.writes[i]) fiber.clock.join(object.read);
  }
  fiber.clock.at[thread] = index + 1;
  events_.push_back(Event{thread, operation, fiber.clock});
  if (options_.reduce && !redundant_) find_races(before);
  for (std::size_t i = 0; i < 2; ++i) {
    if (operation.objects[i] == kNoObject) continue;
    Object &object = objects_[operation.objects[i]];
    object.events.push_back(index);
    (operation.writes[i] ? object.written : object.read).join(fiber.clock);
  }
}

// Finds the events before which the last one could have come. It depends on them, and nothing in between forces the
// order. `before` is the clock that its thread had.
void Explorer::find_races(const Clock &before) {
  const Event &last = events_.back();
  Clock known = before;
  std::array<std::size_t, 2> left{};  // number of events of each of its objects that were not yet looked at, the oldest
                                      // ones
  for (std::size_t i = 0; i < 2; ++i) {
    if (last.operation.objects[i] != kNoObject) left[i] = objects_[last.operation.objects[i]].events.size();
  }
  const auto newest = [&](std::size_t i) { return objects_[last.operation.objects[i]].events[left[i] - 1]; };
  while (left[0] > 0 || left[1] > 0) {  // from the newest on
    const std::size_t i = left[1] == 0 || (left[0] > 0 && newest(0) > newest(1)) ? 0 : 1;
    const std::uint32_t index = newest(i);
    --left[i];
    const Event &event = events_[index];
    if (event.thread == last.thread || known.at[event.thread] > index) continue;
    if (!dependent(event.operation, last.operation)) continue;
    add_backtrack(index);
    known.join(event.clock);
  }
}

// The last event should also be tried before `event`, together with the events in between that do not need `event`. A
// thread that can begin this sequence is to be tried there. That is not always the thread of the last event: it may
// depend on an event in between that was not tried in this order (`source sets': Abdulla, Aronis, Jonsson, Sagonas,
// POPL 2014).
void Explorer::add_backtrack(std::uint32_t event) {
  Node &node = nodes_[event];
  const std::uint32_t reversed = events_[event].thread;
  const auto last = static_cast<std::uint32_t>(events_.size() - 1);
  std::array<std::uint32_t, kMaxThreads> first{};  // of each thread in between: its first event there
  Mask seen = 0;
  Mask initials = 0;
  for (std::uint32_t index = event + 1; index <= last; ++index) {
    const Event &later = events_[index];
    if (index != last && later.after(reversed, event)) continue;
    if ((seen & bit(later.thread)) != 0) continue;
    bool initial = true;
    for (std::uint32_t t = 0; t < count_; ++t) {
      if ((seen & bit(t)) != 0 && later.after(t, first[t])) initial = false;
    }
    first[later.thread] = index;
    seen |= bit(later.thread);
    if (initial) initials |= bit(later.thread);
  }
  initials &= node.enabled;
  if (initials == 0) {
    node.backtrack |= node.enabled;
  } else if ((initials & (node.backtrack | node.sleep)) == 0) {
    const Mask preferred = initials & bit(events_[last].thread);
    node.backtrack |= preferred != 0 ? preferred : initials & (~initials + 1);
  }
}

// Goes back to the last state with an untried choice; returns false if there is none.
bool Explorer::next_run() {
  while (!nodes_.empty()) {
    Node &node = nodes_.back();
    node.done |= bit(node.chosen);
    const Mask open = node.backtrack & ~node.done & ~node.sleep;
    if (open != 0) {
      node.chosen = static_cast<std::uint32_t>(__builtin_ctz(open));
      return true;
    }
    nodes_.pop_back();
  }
  return false;
}

void Explorer::begin_run() {
  object_count_ = 0;
  static_cast<void>(new_object());  // kClock
  static_cast<void>(new_object());  // kSpurious
  events_.clear();
  local_callers_.clear();
  count_ = 0;
  current_ = 0;
  queue_ = 0;
  time = 0;
  steps_ = 0;
  calm_ = false;
  redundant_ = false;
  spurious_left_ = options_.spurious_wakeups;
  static_cast<void>(spawn(program_));
}

Exploration Explorer::run() {
  explorer = this;
  do {
    begin_run();
    run_fibers();
    ++(redundant_ ? result_.redundant : result_.executions);
    result_.longest = std::max(result_.longest, static_cast<std::uint32_t>(events_.size()));
    result_.threads = std::max(result_.threads, count_);
    if (failed_) break;
    result_.complete = !next_run();
  } while (!result_.complete && result_.executions + result_.redundant < options_.max_executions);
  if (failed_) abandon_fibers();
  explorer = nullptr;
  return result_;
}

}  // namespace exploring

using exploring::Explorer;
using exploring::explorer;
using exploring::kClock;
using exploring::Operation;

Exploration explore(const std::function<void()> &program, const ExploreOptions &options,
                    std::vector<ThreadState> thread_states) {
  const auto it = std::make_unique<Explorer>(program, options, std::move(thread_states));
  return it->run();
}

namespace explored {

bool active() noexcept { return explorer != nullptr; }
ObjectId new_object() noexcept { return active() ? explorer->new_object() : kNoObject; }
void read(ObjectId object, const char *what) noexcept {
  if (active()) explorer->perform(Operation{what, {object, kNoObject}, {false, false}});
}
void write(ObjectId object, const char *what) noexcept {
  if (active()) explorer->perform(Operation{what, {object, kNoObject}, {true, false}});
}
void lock(ObjectId mutex) noexcept {
  if (active()) explorer->lock(mutex);
}
void unlock(ObjectId mutex) noexcept {
  if (active()) explorer->unlock(mutex);
}
bool wait(ObjectId word, const std::function<bool()> &blocked, std::int64_t deadline) noexcept {
  return explorer->wait(word, blocked, deadline);
}
void wake(ObjectId word, int count) noexcept {
  if (active()) explorer->wake(word, count);
}
std::uint32_t spawn(std::function<void()> body) { return explorer->spawn(std::move(body)); }
void join(std::uint32_t thread) noexcept { explorer->join(thread); }
void settle() noexcept { explorer->settle(); }
void calm(bool on) noexcept { explorer->calm(on); }
std::uint32_t self() noexcept { return explorer->self(); }
std::int64_t now() noexcept {
  if (active() && explorer->time_passes()) read(kClock, "clock");
  return active() ? explorer->time : 0;
}
void tick(std::int64_t duration) noexcept {
  write(kClock, "tick");
  explorer->time += duration;
}
void fail(const std::string &message) noexcept {
  if (active()) explorer->fail(message);
  std::fputs((message + "\n").c_str(), stderr);
  std::abort();
}

}  // namespace explored
}  // namespace redag::testing
