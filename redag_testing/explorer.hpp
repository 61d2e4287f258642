// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Runs a concurrent program in every interleaving that can make a difference: its threads are fibers of one thread, and
// at each operation that another thread could notice the explorer chooses who goes on. Stateless depth-first search
// with dynamic partial-order reduction by source sets (Abdulla, Aronis, Jonsson and Sagonas, POPL 2014) and sleep sets
// (Godefroid 1996): of the orders that differ in independent operations alone, one is run. Sequentially consistent:
// weaker memory orders, and accesses to plain memory without a lock, are ThreadSanitizer's part. One explorer runs at a
// time in a process.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

namespace redag::testing {

using ObjectId = std::uint32_t;
inline constexpr ObjectId kNoObject = 0xffffffff;

struct ExploreOptions {
  bool reduce = true;  // false: every interleaving of visible operations
  std::uint64_t max_executions = 50'000'000;
  std::uint32_t spurious_wakeups = 0;  // how many futex waits of an execution may end for no reason
  bool time_passes = false;            // reading the clock is an operation: timed waits and tick() move it
};

struct Exploration {
  std::uint64_t executions = 0;   // maximal runs, each another order of dependent operations
  std::uint64_t redundant = 0;    // runs begun and found to repeat another one
  std::uint64_t transitions = 0;  // visible operations executed, in all of them
  std::uint32_t longest = 0;      // visible operations of one run
  std::uint32_t threads = 0;      // most in one run
  bool complete = false;          // all were tried
  std::string failure;            // empty: none; otherwise what broke, and the run that shows it
};

/// Runs `program` again and again, each time from its beginning and in another interleaving, until all are tried or one
/// fails: a check() that does not hold, a state in which nobody can go on, a run without end. It must not wait in
/// loops, and apart from the interleaving must always do the same. `thread_state`: what the code keeps in a
/// thread_local pointer, which fibers share.
struct ThreadState {
  void *(*get)() = nullptr;
  void (*set)(void *) = nullptr;
};
[[nodiscard]] Exploration explore(const std::function<void()> &program, const ExploreOptions &options = {},
                                  ThreadState thread_state = {});

/// What the explored program consists of. Outside explore() objects can be made, and used without contention.
namespace explored {

/// True inside explore().
[[nodiscard]] bool active() noexcept;
[[nodiscard]] ObjectId new_object() noexcept;

/// To be called just before the calling thread reads or writes what `object` stands for; others may run first.
void read(ObjectId object, const char *what) noexcept;
void write(ObjectId object, const char *what) noexcept;

/// A mutex. There is no try_lock: an unlock is taken for one operation with what its thread did last.
void lock(ObjectId mutex) noexcept;
void unlock(ObjectId mutex) noexcept;

/// futex(2): sleeps while `blocked()`, looked at in the same operation that falls asleep; until woken, or until time
/// `deadline` at the earliest, and any moment may be that. Far off, from kForever on, is never: so a timer's loop ends.
/// False: timed out.
inline constexpr std::int64_t kForever = std::int64_t{1} << 40U;
[[nodiscard]] bool wait(ObjectId word, const std::function<bool()> &blocked, std::int64_t deadline) noexcept;
void wake(ObjectId word, int count) noexcept;

/// The new thread's number.
std::uint32_t spawn(std::function<void()> body);
void join(std::uint32_t thread) noexcept;
[[nodiscard]] std::uint32_t self() noexcept;

/// Waits until no other thread can go on (one in a wait that could time out counts as one that cannot).
void settle() noexcept;
/// While calm, who can go on goes on as long as it can, then the one with the lowest number, and waits that could time
/// out do so only if nobody else can go on: nothing is explored. For bringing a program to where it is of interest, and
/// to its end; settle() before each change.
void calm(bool on) noexcept;

[[nodiscard]] std::int64_t now() noexcept;
/// Time passes.
void tick(std::int64_t duration) noexcept;

/// Ends the exploration with `message` and the run that led here.
[[noreturn]] void fail(const std::string &message) noexcept;
inline void check(bool condition, const char *message) noexcept {
  if (!condition) fail(message);
}

}  // namespace explored
}  // namespace redag::testing
