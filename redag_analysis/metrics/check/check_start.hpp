// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The checker's rule about bodies: a dispatch is only a decision until a thread begins the job's body. The rule sees
// each event before the replay applies it. Internal to metrics/.
#pragma once

#include <string>
#include <vector>

#include "redag_analysis/metrics/check/check_context.hpp"

namespace redag::metrics {

/// The time by which a thread may be late. Real-time throttling takes 50 ms in a second, and a hypervisor takes
/// processors one by one.
inline constexpr Duration kLateStart = 100 * kMillisecond;

/// Real threads, full preemption: after a dispatch, no strictly less urgent body may begin or end more than kLateStart
/// later while the dispatched job's own body has not begun. Only the begin and the end of a body prove that it runs.
class StartRules {
 public:
  explicit StartRules(CheckContext &context) : context_(context) {}

  void before(const JobEvent &event);
  void end_of_trace();

 private:
  struct Unbegun {
    Replay::JobRef job;
    Time dispatched = 0;
    Time overtaken = kNever;  // when a less urgent body was first seen to run too late
    Replay::JobRef by;
  };

  [[nodiscard]] bool applies() const;
  void ran(const LiveJob &job, Time at);
  void settle(const Replay::JobRef &job, Time begun);
  void judge(const Unbegun &job, Time begun);

  CheckContext &context_;
  std::vector<Unbegun> unbegun_;  // dispatched jobs whose body no thread has begun
};

}  // namespace redag::metrics
