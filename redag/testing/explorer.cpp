#include "redag/testing/explorer.hpp"

#include <cxxabi.h>
#include <ucontext.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <utility>
#include <vector>

namespace redag::testing {
namespace {

constexpr std::uint32_t kMaxThreads = 10;
constexpr std::size_t kStack = std::size_t{256} << 10U;
constexpr std::uint32_t kMostSteps = 20'000;  // of one run
constexpr ObjectId kClock = 0;
constexpr ObjectId kSpurious = 1;  // the wake-ups for no reason that are left
using Mask = std::uint32_t;
constexpr Mask bit(std::uint32_t thread) { return Mask{1} << thread; }

// Which event of each thread, counted from 1 over all of a run, is known to have come before.
struct Clock {
  std::array<std::uint32_t, kMaxThreads> at{};
  void join(const Clock &other) {
    for (std::uint32_t t = 0; t < kMaxThreads; ++t) at[t] = std::max(at[t], other.at[t]);
  }
};

// A visible operation: up to two objects, read or written. Operations of two threads depend on each other if they share
// an object and one of them writes it.
struct Operation {
  const char *what = "";
  std::array<ObjectId, 2> objects{kNoObject, kNoObject};
  std::array<bool, 2> writes{};
};

bool dependent(const Operation &a, const Operation &b) {
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
  std::vector<std::uint32_t> events;  // that touched it, in order
  // Of a mutex.
  bool locked = false;
  Clock unlocked;
};

enum class State : std::uint8_t {
  Local,     // on its way to its next operation
  Ready,     // its operation can be executed
  Locking,   // ready once the mutex is free
  Joining,   // ready once the thread has ended
  Settling,  // ready once nobody else is
  Sleeping,  // in a futex wait that only a wake ends
  Dozing,    // in a futex wait that can also end otherwise: that is its operation
  Ended,
};

// The exceptions of a thread that are being handled: each fiber has its own.
struct EhGlobals {
  void *caught = nullptr;
  unsigned int uncaught = 0;
};
static_assert(sizeof(EhGlobals) == 2 * sizeof(void *));

struct Fiber {
  ucontext_t context{};
  std::unique_ptr<char[]> stack;
  std::function<void()> body;
  void *thread_state = nullptr;
  EhGlobals eh;
  State state = State::Ended;
  Operation pending;
  std::uint32_t target = 0;  // Joining: whom; Locking: the mutex; Sleeping, Dozing: the word
  std::int64_t deadline = 0;
  bool woken = false;
  std::uint64_t queued = 0;  // order of falling asleep
  Clock clock;
};

struct Event {
  std::uint32_t thread = 0;
  Operation operation;
  Clock clock;  // this event and all that came before it
  [[nodiscard]] bool after(std::uint32_t thread_, std::uint32_t index) const { return clock.at[thread_] > index; }
};

// A state that a run passed, and what has been and what is to be tried there.
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
  Explorer(const std::function<void()> &program, const ExploreOptions &options, ThreadState thread_state)
      : program_(program), options_(options), thread_state_(thread_state) {}

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
  static void entry();
  void begin_run();
  void stop_at(State state, const Operation &operation, std::uint32_t target);
  void run_until_visible(std::uint32_t thread);
  void switch_to(std::uint32_t thread);
  void leave();
  [[nodiscard]] bool enabled(std::uint32_t thread) const;
  // Nobody woke it: it could only time out, or wake for no reason.
  [[nodiscard]] bool dozes(std::uint32_t thread) const {
    return fibers_[thread].state == State::Dozing && !fibers_[thread].woken;
  }
  void schedule();
  bool choose(std::uint32_t &thread, Mask can);
  // Who is on its way goes on: as few changes of thread as can be.
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
  ThreadState thread_state_;
  Exploration result_;
  std::vector<Node> nodes_;
  std::deque<Object> objects_;
  ObjectId object_count_ = 0;
  std::vector<Event> events_;
  std::array<Fiber, kMaxThreads> fibers_;
  std::uint32_t count_ = 0;                   // of fibers in this run
  std::uint32_t current_ = 0;                 // the fiber that executes
  std::vector<std::uint32_t> local_callers_;  // who waits until current_ reaches its next operation
  ucontext_t home_{};
  std::uint32_t steps_ = 0;
  bool calm_ = false;
  bool redundant_ = false;  // this run repeats another: to be finished somehow
  bool failed_ = false;
  std::uint64_t queue_ = 0;
  std::uint32_t spurious_left_ = 0;
};

Explorer *explorer = nullptr;

EhGlobals *eh_globals() { return reinterpret_cast<EhGlobals *>(abi::__cxa_get_globals()); }

// ---- fibers ----

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
  if (thread_state_.get != nullptr) {
    from.thread_state = thread_state_.get();
    thread_state_.set(to.thread_state);
  }
  from.eh = *eh_globals();
  *eh_globals() = to.eh;
  current_ = thread;
  swapcontext(&from.context, &to.context);
}

// The calling fiber has ended.
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
  fiber.thread_state = nullptr;
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

// What a thread does up to its next operation nobody can notice: it is done at once.
void Explorer::run_until_visible(std::uint32_t thread) {
  local_callers_.push_back(current_);
  switch_to(thread);
}

// The calling fiber has come to its next operation.
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

// ---- the search ----

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

// Chooses who executes the operation that it stands before, and goes there.
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

// False: all that could be done here is done elsewhere.
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

// What made it possible that `fiber` goes on came before.
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

// Thread `thread` executes its operation now.
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

// The events that the last one could have come before: those it depends on, with nothing in between that forces the
// order. `before`: what its thread knew of.
void Explorer::find_races(const Clock &before) {
  const Event &last = events_.back();
  Clock known = before;
  std::array<std::size_t, 2> left{};  // of the events of each of its objects, the older ones not looked at yet
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

// The last event should also be tried before `event`, with whatever came in between and does not need `event`: whoever
// can begin with that is to be tried there. Not always the thread of the last event itself: something in between that
// it depends on may be what has not been tried in this order (`source sets': Abdulla, Aronis, Jonsson, Sagonas, POPL
// 2014).
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

// Goes back to the last state where something is left to try. False: nowhere.
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
  const EhGlobals eh = *eh_globals();
  do {
    begin_run();
    swapcontext(&home_, &fibers_[0].context);
    // Here again once all threads have ended, or one failed.
    *eh_globals() = eh;
    if (thread_state_.set != nullptr) thread_state_.set(nullptr);
    ++(redundant_ ? result_.redundant : result_.executions);
    result_.longest = std::max(result_.longest, static_cast<std::uint32_t>(events_.size()));
    result_.threads = std::max(result_.threads, count_);
    if (failed_) break;
    result_.complete = !next_run();
  } while (!result_.complete && result_.executions + result_.redundant < options_.max_executions);
  if (failed_) {
    // The fibers are left where they stood: what they own cannot be destroyed any more.
    for (Fiber &fiber : fibers_) {
      static_cast<void>(fiber.stack.release());
      new (&fiber.body) std::function<void()>();
    }
  }
  explorer = nullptr;
  return result_;
}

}  // namespace

Exploration explore(const std::function<void()> &program, const ExploreOptions &options, ThreadState thread_state) {
  const auto it = std::make_unique<Explorer>(program, options, thread_state);
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
