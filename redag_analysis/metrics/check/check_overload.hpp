// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The checker's rules about budgets and modes: which job has used its limit, and when HI mode begins and ends.
// ReleaseRules checks the skips that follow, and Replay the demotions. The rules see each event before the replay
// applies it. Internal to metrics/.
#pragma once

#include <cstdint>
#include <utility>

#include "redag_analysis/metrics/check/check_context.hpp"

namespace redag::metrics {

class OverloadRules {
 public:
  explicit OverloadRules(CheckContext &context) : context_(context) {}

  void before(const JobEvent &event);
  /// Called before time moves on.
  void end_of_instant();

 private:
  void exceeded(const JobEvent &event, const LiveJob &job);
  void high_mode(const JobEvent &event, const LiveJob *job);
  void low_mode(const JobEvent &event);
  void ended(const JobEvent &event, const LiveJob &job);
  void check_used(const JobEvent &event, const LiveJob &job, Duration limit, const char *what);
  [[nodiscard]] bool is_idle() const;
  [[nodiscard]] bool exact() const {
    return context_.info.driver == trace::Driver::Simulator && context_.info.overheads.empty();
  }

  CheckContext &context_;
  std::pair<TaskId, std::uint32_t> cause_;  // the job that began HI mode last
};

}  // namespace redag::metrics
