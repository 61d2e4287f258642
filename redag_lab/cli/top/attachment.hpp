// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Which of the running executors is watched. Values.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "redag/live/reader.hpp"

namespace redag::cli {

struct LiveTarget {
  std::int64_t pid = 0;
  std::optional<std::uint32_t> number;  // of the process's executors

  [[nodiscard]] bool names(const live::Listed &listed) const {
    return listed.pid == pid && (!number || *number == listed.number);
  }
};

/// Parses "PID" or "PID.N".
[[nodiscard]] std::optional<LiveTarget> parse_target(const std::string &text);

/// Remembers the watched executor, also across its restarts.
class Attachment {
 public:
  /// Without a target, the first readable executor is watched.
  explicit Attachment(std::optional<LiveTarget> target) : target_(target) {}

  /// Returns the watched executor out of the running ones; null: it is gone, or there is none yet. An executor that has
  /// ended is followed by the next one of the same name and program.
  [[nodiscard]] const live::Listed *find(const std::vector<live::Listed> &pages);

  /// Watches the readable executor after the present one, around the list.
  void step(const std::vector<live::Listed> &pages);

 private:
  struct Known {
    std::string path;
    live::Process process;
    std::string name;
    std::string program;
  };
  void attach(const live::Listed &listed);

  std::optional<LiveTarget> target_;
  std::optional<Known> known_;
};

}  // namespace redag::cli
