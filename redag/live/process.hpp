// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Identifies a process beyond its number, which is used again: when it began, and in which namespace its number counts.
// Reads /proc; any thread.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace redag::live {

struct Process {
  std::int64_t pid = 0;
  std::uint64_t start = 0;          // clock ticks after boot
  std::uint64_t pid_namespace = 0;  // inode; 0: not known

  friend bool operator==(const Process &, const Process &) = default;
};

[[nodiscard]] Process this_process();

/// Returns the text of a file of /proc. Empty if it is not there, or its process ends meanwhile.
[[nodiscard]] std::string text_of_proc(const std::string &path);

enum class Life : std::uint8_t {
  Alive,
  Dead,
  Unknown,  // in another namespace: its number says nothing here
};

[[nodiscard]] Life life_of(const Process &process);

/// Returns the clock ticks after boot at which the process began, from the text of /proc/PID/stat. Works for any
/// program name. Empty if the text has another form.
[[nodiscard]] std::optional<std::uint64_t> start_time_in(const std::string &stat);

}  // namespace redag::live
