// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The threads and interrupts of this machine as Linux has them, and changes to them: names from /proc, the rest by
// system calls. Keeps no state. Any thread.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/base/time.hpp"

namespace redag::robot {

/// How Linux schedules a thread.
struct Scheduling {
  enum class Class : std::uint8_t { Other, Fifo, RoundRobin, Batch, Idle, Deadline };
  Class kind = Class::Other;
  int priority = 0;  // Fifo, RoundRobin
  int nice = 0;      // Other, Batch
  // Threads that it creates begin as ordinary ones. Whoever raises a foreign thread wants this: otherwise it would
  // raise others without knowing.
  bool resets_on_fork = false;
  // Deadline: the processor time that it has in each period, until the deadline.
  Duration budget = 0;
  Duration deadline = 0;
  Duration period = 0;

  friend bool operator==(const Scheduling &, const Scheduling &) = default;
};

/// For people: "FIFO 80", "nice -5", "2ms every 10ms".
[[nodiscard]] std::string to_string(const Scheduling &scheduling);

/// True if both have the same class, priority, nice and reservation.
[[nodiscard]] bool is_same_level(const Scheduling &a, const Scheduling &b);

struct ThreadState {
  Scheduling scheduling;
  std::vector<int> cpus;  // ascending

  friend bool operator==(const ThreadState &, const ThreadState &) = default;
};

/// A thread for ever: the kernel uses its number again, but not with the same start.
struct ThreadId {
  std::int64_t pid = 0;
  std::int64_t tid = 0;
  std::uint64_t start = 0;  // clock ticks after boot

  friend bool operator==(const ThreadId &, const ThreadId &) = default;
};

struct LiveThread {
  ThreadId id;
  std::string name;
  ThreadState state;
};

struct LiveProcess {
  std::int64_t pid = 0;
  std::string name;
  std::string command;  // joined by spaces; of a kernel thread empty
  std::string cgroup;
  std::vector<LiveThread> threads;
};

struct LiveInterrupt {
  int number = 0;
  std::string name;  // of its device or devices, as /proc/interrupts has it at the end of a line
  std::vector<int> cpus;
};

struct Snapshot {
  std::vector<LiveProcess> processes;
  std::vector<LiveInterrupt> interrupts;
  std::vector<int> cpus;  // of the machine, those that are in use
};

class System {
 public:
  /// `proc`: the folder of /proc, for tests.
  explicit System(std::string proc = "/proc") : proc_(std::move(proc)) {}

  /// Returns what runs now, without this process. What ends meanwhile is left out.
  [[nodiscard]] Snapshot read() const;

  /// Returns the state of a thread; nothing if it has ended.
  [[nodiscard]] std::optional<ThreadState> state_of(const ThreadId &thread) const;
  /// Changes what differs. A thread that has ended is no error.
  [[nodiscard]] Result<void> set(const ThreadId &thread, const std::string &name, const ThreadState &wanted) const;

  /// Returns the processors of an interrupt; nothing if there is no such interrupt.
  [[nodiscard]] std::optional<std::vector<int>> cpus_of(int interrupt) const;
  [[nodiscard]] Result<void> set_cpus(int interrupt, const std::vector<int> &cpus) const;

  /// Returns the value of a variable in the environment that a process began with; nothing: not set, or not readable.
  [[nodiscard]] std::optional<std::string> environment_of(std::int64_t pid, const std::string &name) const;

  /// A text that every boot of the machine has of its own; empty if it is unknown.
  [[nodiscard]] std::string boot() const;

 private:
  [[nodiscard]] std::vector<LiveInterrupt> interrupts() const;
  [[nodiscard]] std::vector<LiveThread> threads_of(std::int64_t pid) const;
  [[nodiscard]] std::optional<std::uint64_t> start_of(std::int64_t pid, std::int64_t tid) const;

  std::string proc_;
};

}  // namespace redag::robot
