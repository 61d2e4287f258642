// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The checker's rules about decisions: bounds, groups, workers, preemption, priority, work conservation, deferral and
// execution. They see each event before the replay applies it. Internal to metrics/.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "redag_analysis/metrics/check/check_context.hpp"

namespace redag::metrics {

class DispatchRules {
 public:
  explicit DispatchRules(CheckContext &context);

  void before(const JobEvent &event);
  /// Called before time moves on.
  void end_of_instant();
  void end_of_trace();

 private:
  // `waiting` was eligible when `chosen`, which it outranks, got a worker. Void if `waiting` starts in the same
  // instant.
  struct Complaint {
    Replay::JobRef waiting;
    Replay::JobRef chosen;
  };
  struct Eviction {
    Replay::JobRef job;
    std::uint32_t worker = 0;
  };

  struct Ended {
    Time time = 0;
    std::uint32_t place = 0;
    Replay::JobRef job;
  };

  void dispatched(const JobEvent &event, const LiveJob &job);
  void check_bounds(const JobEvent &event);
  void check_place(const JobEvent &event, const LiveJob &job);
  void check_eviction(const JobEvent &event, const LiveJob &by);
  void check_choice(const LiveJob &chosen, const Urgency &urgency);
  void deferred(const JobEvent &event);
  void preempted(const JobEvent &event, const LiveJob &job);
  void resumed(const JobEvent &event, const LiveJob &job);
  void ended(const JobEvent &event, const LiveJob &job);
  void check_order_of_ends(const JobEvent &event);
  void check_free_workers();
  void check_running();
  [[nodiscard]] Urgency urgency_of(const LiveJob &job) const;
  [[nodiscard]] Urgency urgency_of(const LiveJob &job, const Urgency &looked_at, bool started) const;
  [[nodiscard]] std::string name(const Replay::JobRef &job) const { return context_.job_name(job.task, job.number); }
  [[nodiscard]] sched::Preemption mode() const { return context_.info.config.preemption; }
  [[nodiscard]] bool exact() const {
    return context_.info.driver == trace::Driver::Simulator && context_.info.overheads.empty();
  }

  CheckContext &context_;
  std::vector<Complaint> complaints_;
  std::vector<Eviction> evictions_;
  std::vector<std::uint32_t> places_;  // by TaskId: DAG by DAG, in topological order
  std::optional<Ended> last_ended_;
};

}  // namespace redag::metrics
