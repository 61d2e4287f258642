// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Reads /proc and /sys, below a root: "" is this machine, a folder stands for another one. The files are not trusted:
// reads are bounded, values are checked, and texts are made fit for a terminal. All functions that return a value throw
// Unreadable rather than guess. No state; any thread.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace redag::doctor {

/// Why something is not known: "PATH: Permission denied".
class Unreadable : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

class Machine {
 public:
  explicit Machine(std::string root = {}) : root_(std::move(root)) {}

  /// True for the machine on which this program runs.
  [[nodiscard]] bool is_this() const { return root_.empty(); }
  [[nodiscard]] std::string path(std::string_view file) const { return root_ + std::string(file); }

  /// The text without the blanks at its end. A file that is empty, longer than 4 MiB, or cut off is not readable: the
  /// kernel's files end with a line feed or NUL.
  [[nodiscard]] std::string text(const std::string &file) const;
  /// The whole text as a number from -1 to 10^15.
  [[nodiscard]] std::int64_t number(const std::string &file) const;
  /// The whole text as a list of processors, which may be empty.
  [[nodiscard]] std::vector<int> processors(const std::string &file) const;
  /// The target of a link.
  [[nodiscard]] std::string link(const std::string &file) const;
  /// The value of the line that begins with `key`, such as "Max locked memory", without the blanks before it.
  [[nodiscard]] std::string value(const std::string &file, std::string_view key) const;

  /// The names in a folder, sorted; none if it cannot be read.
  [[nodiscard]] std::vector<std::string> names_in(const std::string &folder) const;

 private:
  std::string root_;
};

struct Thread {
  std::int64_t id = 0;
  std::string name;
  int policy = 0;    // SCHED_OTHER, SCHED_FIFO, ...
  int priority = 0;  // real-time; 0: none
  std::vector<int> cpus;
};

struct Process {
  std::string id;  // a number, or "self"

  [[nodiscard]] std::string file(const std::string &name) const { return "/proc/" + id + "/" + name; }
};

inline constexpr std::int64_t kUnlimited = std::numeric_limits<std::int64_t>::max();

/// Returns a soft limit of /proc/PID/limits, such as "Max locked memory".
[[nodiscard]] std::int64_t limit_of(const Machine &machine, const Process &process, const char *name);

/// Returns whether the process has a capability that counts in the kernel's own user namespace: those of a rootless
/// container do not.
[[nodiscard]] bool has_capability(const Machine &machine, const Process &process, unsigned number);

/// Returns the threads of a process that still run, by id.
[[nodiscard]] std::vector<Thread> threads_of(const Machine &machine, const Process &process);

/// Returns the process, or all processes of its container: those with its namespace of process IDs, if that is not the
/// one of this program.
[[nodiscard]] std::vector<Process> processes_with(const Machine &machine, std::int64_t pid);

/// Reads a number that is the whole text.
[[nodiscard]] std::optional<std::int64_t> number_in(std::string_view text);

/// Returns the words of a text, which blanks, line feeds and NUL separate.
[[nodiscard]] std::vector<std::string> words_of(std::string_view text);

}  // namespace redag::doctor
