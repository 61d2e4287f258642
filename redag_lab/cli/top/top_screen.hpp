// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// `redag top` on a terminal: keys, the choice of an executor, its display. Holds the screen until the user quits; one
// thread.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "redag/base/time.hpp"
#include "redag/live/reader.hpp"
#include "redag_lab/cli/run/live_text.hpp"
#include "redag_lab/cli/terminal/screen.hpp"

namespace redag::cli {

struct LiveTarget {
  std::int64_t pid = 0;
  std::optional<std::uint32_t> number;  // of the process's executors

  [[nodiscard]] bool names(const live::Listed &listed) const {
    return listed.pid == pid && (!number || *number == listed.number);
  }
};

struct TopOptions {
  std::string folder;
  Duration interval = kSecond;
  std::optional<LiveTarget> target;
  LiveView view;
  bool colour = true;
};

/// Remembers the watched executor, also across its restarts. A value.
class Attachment {
 public:
  explicit Attachment(std::optional<LiveTarget> target) : target_(target) {}

  /// Returns the executor to show out of the running ones. Null means that it is gone (is_known()), or that there is
  /// none or several to choose from. An executor that has ended is followed by the next one of the same name and
  /// program.
  [[nodiscard]] const live::Listed *find(const std::vector<live::Listed> &pages);
  void attach(const live::Listed &listed);
  [[nodiscard]] bool is_known() const { return known_.has_value(); }
  [[nodiscard]] const std::string &name() const { return known_->name; }

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

/// Returns the exit status.
[[nodiscard]] int run_top(const TopOptions &options);

}  // namespace redag::cli
