// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The model that docs/model.md defines ("Workload"): a workload is a platform, a policy and DAGs of tasks. Plain
// values: no behaviour, no validation (see validate.hpp), no text form (see workload_yaml.hpp).
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "redag/base/ids.hpp"
#include "redag/base/time.hpp"

namespace redag {

enum class Criticality : std::uint8_t { Low, Normal, High };

/// What releases a task's jobs.
enum class Activation : std::uint8_t {
  Timer,  // job k at offset + k * period
  Data,   // when every predecessor has completed once more since this task's last job (AND-join)
};

/// What happens to releases that find earlier jobs of the same task unfinished.
enum class Overrun : std::uint8_t {
  Skip,   // at most one job waits; the next release replaces (skips) one that has not started
  Queue,  // up to `queue_depth` ready jobs wait, oldest first; a release beyond that is skipped
};

/// What happens when a job has used its task's budget. It has a result all the same, unless it is cut off.
enum class OnBudget : std::uint8_t {
  Abort,     // cut off at its next preemption point
  Log,       // told in the trace, nothing else
  Demote,    // goes on below everything else
  SkipNext,  // goes on; the next release of its task is skipped
};

/// How long a synthetic job executes, in processor time.
struct ExecutionTime {
  enum class Kind : std::uint8_t {
    Constant,   // always `wcet`
    Uniform,    // [bcet, wcet]
    Normal,     // mean, stddev; truncated to [bcet, wcet]
    Empirical,  // one of `samples`, equally likely
  };
  Kind kind = Kind::Constant;
  Duration mean = 0;
  Duration stddev = 0;
  std::vector<Duration> samples;

  friend bool operator==(const ExecutionTime &, const ExecutionTime &) = default;
};

/// Which ROS 2 callback a task is. Names are patterns: "*" stands for any run of characters, "?" for one.
struct Callback {
  enum class Kind : std::uint8_t { Timer, Subscription, Service, Client, Action, Waitable };

  std::string node;  // fully qualified: "/nav/planner", "/lidar_*"
  Kind kind = Kind::Timer;
  std::string name;                    // of the topic, service or action; empty for timers and waitables
  Duration period = 0;                 // of the timer; 0: any, and for all other kinds
  std::optional<std::uint32_t> index;  // n-th timer (waitable) of its node by creation, from 0; none: any

  friend bool operator==(const Callback &, const Callback &) = default;
};

/// tau_i = (C_i, T_i, D_i, chi_i) of the paper (eq. task_tuple), and what a real callback needs besides.
struct Task {
  std::string name;
  Duration wcet = 0;      // C_i, > 0
  Duration bcet = 0;      // shortest execution, <= wcet
  Duration period = 0;    // T_i; of a data task: the largest period among its predecessors
  Duration deadline = 0;  // D_i, relative to the release
  Duration offset = 0;    // first release (timer tasks)
  Duration jitter = 0;    // a release happens up to this much after its point on the grid (timer tasks)
  Duration region = 0;    // longest stretch without a preemption point (cooperative mode); 0: the whole job
  Duration budget = 0;    // processor time after which `on_budget` happens to a job; 0: none
  OnBudget on_budget = OnBudget::Abort;
  Duration wcet_low = 0;  // C(LO) of a task of a high-criticality DAG, <= wcet = C(HI); 0: none
  Criticality criticality = Criticality::Normal;
  Activation activation = Activation::Timer;
  Overrun overrun = Overrun::Skip;
  std::uint32_t queue_depth = 1;            // for Overrun::Queue, >= 1
  std::optional<int> priority;              // for PolicyKind::Fixed; larger is more urgent
  std::uint32_t concurrency = 1;            // jobs in progress at once (a reentrant callback)
  std::string group;                        // jobs of one group never overlap; empty: no group; shared by all DAGs
  std::vector<std::uint32_t> predecessors;  // positions in the same DAG
  ExecutionTime execution;
  std::optional<Callback> callback;  // what runs its jobs under ROS 2; its wcet may then be unknown (0)

  friend bool operator==(const Task &, const Task &) = default;
};

/// What a DAG of lower criticality is left with in HI mode (docs/model.md, "Criticality").
struct Degrade {
  enum class Kind : std::uint8_t {
    Stop,     // no releases
    Skip,     // after each period that is let through, `skip` ones are skipped
    Stretch,  // a release of a timer task is let through when `stretch` periods have passed since the last such
  };
  Kind kind = Kind::Stop;
  std::uint32_t skip = 1;
  double stretch = 2;

  friend bool operator==(const Degrade &, const Degrade &) = default;
};

/// G_k = (V_k, E_k) (eq. dag). Tasks are in no particular order; the edges are acyclic.
struct Dag {
  std::string name;
  std::vector<Task> tasks;
  std::uint32_t max_active = 0;   // jobs started and not finished at any time; 0: no bound
  std::uint32_t max_pending = 0;  // jobs released and not started at any time; 0: no bound
  Duration deadline = 0;          // end to end, from a source's release to a sink's finish; 0: none
  Criticality criticality = Criticality::Normal;
  Degrade degrade;  // not of high criticality

  friend bool operator==(const Dag &, const Dag &) = default;
};

enum class PolicyKind : std::uint8_t { RateMonotonic, DeadlineMonotonic, Fixed, Edf, Fifo, ChainAware };

/// True for policies that order two jobs by their tasks alone.
[[nodiscard]] constexpr bool is_static(PolicyKind policy) {
  return policy != PolicyKind::Edf && policy != PolicyKind::Fifo;
}

/// How jobs that the policy ranks equal are ordered. See docs/model.md, "Ties".
enum class Ties : std::uint8_t {
  Share,  // they take turns: the earlier release first, and none preempts another
  Fixed,  // by the order of their tasks, always
};

/// What can interrupt a running job. See docs/model.md.
enum class PreemptionMode : std::uint8_t { None, Cooperative, Os, Auto };

struct Platform {
  std::uint32_t workers = 1;  // m: jobs that execute at the same time
  PreemptionMode preemption = PreemptionMode::Auto;

  friend bool operator==(const Platform &, const Platform &) = default;
};

struct Workload {
  std::string name;
  Platform platform;
  PolicyKind policy = PolicyKind::RateMonotonic;
  Ties ties = Ties::Share;
  std::vector<Dag> dags;

  /// Tasks of all DAGs together; TaskIds run from 0 to this, DAG by DAG.
  [[nodiscard]] std::size_t task_count() const;

  /// U = sum C_i / T_i (eq. utilization).
  [[nodiscard]] double utilization() const;

  friend bool operator==(const Workload &, const Workload &) = default;
};

/// One row per TaskId: where the task stands in its workload. Valid while the workload is unchanged.
struct TaskRef {
  DagId dag;
  std::uint32_t index = 0;  // position in the DAG
  const Task *task = nullptr;
  TaskId id;
};

[[nodiscard]] std::vector<TaskRef> flatten(const Workload &workload);

/// Positions in a topological order: result[i] is the rank of task i; ties by position. Requires acyclic edges.
[[nodiscard]] std::vector<std::uint32_t> topological_ranks(const Dag &dag);

/// Gives every data task the largest period among its predecessors (in topological order), and the deadline to go with
/// it where none is set (0). Requires acyclic edges.
void inherit_periods(Dag &dag);

[[nodiscard]] const char *to_string(Criticality value);
[[nodiscard]] const char *to_string(Activation value);
[[nodiscard]] const char *to_string(Callback::Kind value);
[[nodiscard]] const char *to_string(OnBudget value);
[[nodiscard]] const char *to_string(PolicyKind value);
[[nodiscard]] const char *to_string(Ties value);
[[nodiscard]] const char *to_string(PreemptionMode value);

}  // namespace redag
