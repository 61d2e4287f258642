// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Runs a concurrent program in every interleaving that can make a difference. Its threads are fibers of one thread, and
// at each operation visible to others the explorer chooses the next one. Stateless depth-first search with dynamic
// partial-order reduction by source sets (Abdulla, Aronis, Jonsson and Sagonas, POPL 2014) and sleep sets (Godefroid
// 1996): of the orders that differ only in independent operations, one is run. Sequentially consistent: ThreadSanitizer
// covers weaker memory orders and plain memory without a lock. One explorer runs at a time in a process.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace redag::testing {

using ObjectId = std::uint32_t;
inline constexpr ObjectId kNoObject = 0xffffffff;

struct ExploreOptions {
  bool reduce = true;  // false: every interleaving of visible operations
  std::uint64_t max_executions = 50'000'000;
  std::uint32_t spurious_wakeups = 0;  // how many futex waits of an execution may end without a wake
  bool time_passes = false;            // reading the clock is an operation; timed waits and tick() advance it
};

struct Exploration {
  std::uint64_t executions = 0;   // maximal runs, each with another order of dependent operations
  std::uint64_t redundant = 0;    // runs that turned out to repeat another one
  std::uint64_t transitions = 0;  // visible operations executed in all runs
  std::uint32_t longest = 0;      // visible operations of one run
  std::uint32_t threads = 0;      // most in one run
  bool complete = false;          // all interleavings were tried
  std::string failure;            // empty: none; otherwise what broke, and the run that shows it
};

/// Runs `program` from its beginning, each time in another interleaving, until all are tried or one fails. Failures are
/// a check() that does not hold, a state in which no thread can continue, and a run without end. The program must not
/// wait in loops, and must be deterministic apart from the interleaving. `thread_states` give access to thread_local
/// values of the code, because fibers share them. Each is 0 at first.
struct ThreadState {
  std::uintptr_t (*get)();
  void (*set)(std::uintptr_t);
};
[[nodiscard]] Exploration explore(const std::function<void()> &program, const ExploreOptions &options = {},
                                  std::vector<ThreadState> thread_states = {});

/// The operations of the explored program. Outside explore() objects can be created, and used without contention.
namespace explored {

/// True inside explore().
[[nodiscard]] bool active() noexcept;
[[nodiscard]] ObjectId new_object() noexcept;

/// Call these just before the calling thread reads or writes what `object` stands for; other threads may run first.
void read(ObjectId object, const char *what) noexcept;
void write(ObjectId object, const char *what) noexcept;

/// A mutex. There is no try_lock, because an unlock forms one operation with the thread's last one.
void lock(ObjectId mutex) noexcept;
void unlock(ObjectId mutex) noexcept;

/// futex(2): sleeps while `blocked()`, which is evaluated in the operation that falls asleep. The wait ends by a wake,
/// or at any moment from `deadline` on. A deadline of kForever or later never comes, which lets a timer's loop end.
/// Returns false if it timed out.
inline constexpr std::int64_t kForever = std::int64_t{1} << 40U;
[[nodiscard]] bool wait(ObjectId word, const std::function<bool()> &blocked, std::int64_t deadline) noexcept;
void wake(ObjectId word, int count) noexcept;

/// Starts a thread and returns its number.
std::uint32_t spawn(std::function<void()> body);
void join(std::uint32_t thread) noexcept;
[[nodiscard]] std::uint32_t self() noexcept;

/// Waits until no other thread can continue. A thread in a wait that could time out counts as one that cannot.
void settle() noexcept;
/// While calm, nothing is explored. A thread continues as long as it can, then the one with the lowest number does.
/// Waits that could time out do so only if no other thread can continue. Use it to bring a program to the interesting
/// state, and to its end; call settle() before each change.
void calm(bool on) noexcept;

[[nodiscard]] std::int64_t now() noexcept;
/// Lets time pass.
void tick(std::int64_t duration) noexcept;

/// Ends the exploration with `message` and the run that led here.
[[noreturn]] void fail(const std::string &message) noexcept;
inline void check(bool condition, const char *message) noexcept {
  if (!condition) fail(message);
}

}  // namespace explored
}  // namespace redag::testing
