// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The checker's rule about bodies: a job that was dispatched is only a decision, until a thread begins its body. Sees
// each event before the replay applies it. Internal to metrics/.
#pragma once

#include <string>
#include <vector>

#include "redag_analysis/metrics/check_context.hpp"

namespace redag::metrics {

/// A thread may be late by that much: real-time throttling takes 50 ms in a second, and a hypervisor takes processors
/// one by one.
inline constexpr Duration kLateStart = 100 * kMillisecond;

/// Real threads, full preemption: no body of a strictly less urgent job begins or ends more than kLateStart after a job
/// was dispatched whose own body has not begun. (Only its begin and its end prove that a body runs.)
class StartRules {
 public:
  explicit StartRules(CheckContext &context) : context_(context) {}

  void before(const JobEvent &event);
  void end_of_trace();

 private:
  struct Unbegun {
    Replay::JobRef job;
    Time dispatched = 0;
    Time overtaken = kNever;  // when a less urgent body was first seen to run, too late
    Replay::JobRef by;
  };

  [[nodiscard]] bool applies() const;
  void ran(const LiveJob &job, Time at);
  void settle(const Replay::JobRef &job, Time begun);
  void judge(const Unbegun &job, Time begun);
  [[nodiscard]] bool may_overtake(const LiveJob &job, const LiveJob &waiting) const;

  CheckContext &context_;
  std::vector<Unbegun> unbegun_;  // dispatched, and no thread has begun it
};

}  // namespace redag::metrics
