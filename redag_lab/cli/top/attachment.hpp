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
  explicit Attachment(std::optional<LiveTarget> target) : target_(target) {}

  /// Returns the executor to show out of the running ones. Null means that it is gone (is_known()), or that there is
  /// none or several to choose from. An executor that has ended is followed by the next one of the same name and
  /// program.
  [[nodiscard]] const live::Listed *find(const std::vector<live::Listed> &pages);
  void attach(const live::Listed &listed);
  [[nodiscard]] bool is_known() const { return known_.has_value(); }
  [[nodiscard]] bool has_target() const { return target_.has_value(); }

 private:
  struct Known {
    std::string path;
    live::Process process;
    std::string name;
    std::string program;
  };
  std::optional<LiveTarget> target_;
  std::optional<Known> known_;
};

}  // namespace redag::cli
