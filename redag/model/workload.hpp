// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The model that docs/model.md defines ("Workload"): a workload is a platform, a policy and DAGs of tasks. Plain
// values: no behaviour, no validation (see validate.hpp), no text form (see workload_yaml.hpp).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <type_traits>
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

/// What the releases of a timer task have in common with those of the others.
enum class Phase : std::uint8_t {
  Common,   // one clock: at offset + k * period from an instant that all tasks of an executor share
  Unknown,  // periodic as well, but nothing synchronises it with the others
  Event,    // from outside, at least a period apart: nothing bounds how long none comes
};

/// What happens to releases while earlier jobs of the same task are unfinished.
enum class Overrun : std::uint8_t {
  Skip,   // at most one job waits; the next release replaces (skips) it if it has not started
  Queue,  // up to `queue_depth` ready jobs wait, oldest first; a release beyond that is skipped
};

/// What happens when a job has used its task's budget. The job still has a result, unless it is cut off.
enum class OnBudget : std::uint8_t {
  Abort,     // cut off at its next preemption point
  Log,       // recorded in the trace, nothing else
  Demote,    // continues below everything else
  SkipNext,  // continues; the next release of its task is skipped
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

/// The ROS 2 callback of a task. Names are patterns: "*" stands for any run of characters, "?" for one.
struct Callback {
  enum class Kind : std::uint8_t { Timer, Subscription, Service, Client, Action, Waitable };

  std::string node;  // fully qualified: "/nav/planner", "/lidar_*"
  Kind kind = Kind::Timer;
  std::string name;                    // of the topic, service or action; empty for timers and waitables
  Duration period = 0;                 // of the timer; 0: any; 0 for all other kinds
  std::optional<std::uint32_t> index;  // n-th timer (waitable) of its node by creation, from 0; empty: any

  friend bool operator==(const Callback &, const Callback &) = default;
};

/// A stretch of a job in which it holds no worker: a device serves it, or it waits for something else.
struct Wait {
  Duration after = 0;     // processor time of the job before it, of a job that executes for its wcet; in (0, wcet)
  Duration longest = 0;   // > 0; at a device without the time in its queue
  Duration shortest = 0;  // <= longest; 0: always `longest`
  DeviceId device;        // in Platform::devices; none: it waits for no device (a service, a file, a sleep)

  friend bool operator==(const Wait &, const Wait &) = default;
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
  Duration budget = 0;    // processor time after which `on_budget` happens; 0: none
  OnBudget on_budget = OnBudget::Abort;
  Duration wcet_low = 0;  // C(LO) of a task of a high-criticality DAG, <= wcet = C(HI); 0: none
  Criticality criticality = Criticality::Normal;
  Activation activation = Activation::Timer;
  Phase phase = Phase::Common;  // of a timer task
  Overrun overrun = Overrun::Skip;
  std::uint32_t queue_depth = 1;            // for Overrun::Queue, >= 1
  std::optional<int> priority;              // for PolicyKind::Fixed; larger is more urgent
  std::uint32_t concurrency = 1;            // most jobs in progress at once (a reentrant callback)
  std::string group;                        // jobs of one group never overlap; empty: no group; shared by all DAGs
  std::vector<std::uint32_t> predecessors;  // indices in the same DAG
  ExecutionTime execution;
  std::optional<Callback> callback;  // runs its jobs under ROS 2; its wcet may then be unknown (0)
  std::vector<Wait> waits = {};      // ascending by `after`; empty: its jobs keep their worker until they end

  friend bool operator==(const Task &, const Task &) = default;
};

/// Which releases a DAG of lower criticality keeps in HI mode (docs/model.md, "Criticality").
struct Degrade {
  enum class Kind : std::uint8_t {
    Stop,     // no releases
    Skip,     // after each period that is let through, `skip` periods are skipped
    Stretch,  // lets a timer release through once `stretch` periods have passed since the last one let through
  };
  Kind kind = Kind::Stop;
  std::uint32_t skip = 1;
  double stretch = 2;

  friend bool operator==(const Degrade &, const Degrade &) = default;
};

/// Under ROS 2, what the edges of a DAG do. Everywhere else they are executed.
enum class Edges : std::uint8_t {
  Executed,  // a callback waits for its message and for its predecessors
  Seen,      // a callback waits for its message only: the edges were learned, and serve the analysis
};

/// G_k = (V_k, E_k) (eq. dag). Tasks are in no particular order; the edges are acyclic.
struct Dag {
  std::string name;
  std::vector<Task> tasks;
  std::uint32_t max_active = 0;   // jobs started and not finished at any time; 0: no bound
  std::uint32_t max_pending = 0;  // jobs released and not started at any time; 0: no bound
  Duration deadline = 0;          // end to end, from a source's release to a sink's finish; 0: none
  Criticality criticality = Criticality::Normal;
  Degrade degrade;  // only used if the DAG is not of high criticality
  Edges edges = Edges::Executed;
  std::string cluster = {};  // name of the cluster that serves it; empty: the only one, or the whole platform
  bool is_foreign = false;   // stands for threads of other programs, which have no deadline to meet
  /// Which of several executors starts its jobs. Each has its own clock and its own HI mode.
  std::uint32_t executor = 0;

  /// Its share of U (eq. utilization). Tasks without a period have none.
  [[nodiscard]] double utilization() const;

  friend bool operator==(const Dag &, const Dag &) = default;
};

enum class PolicyKind : std::uint8_t { RateMonotonic, DeadlineMonotonic, Fixed, Edf, Fifo, ChainAware };

/// True for policies that order two jobs by their tasks alone.
[[nodiscard]] constexpr bool is_static(PolicyKind policy) {
  return policy != PolicyKind::Edf && policy != PolicyKind::Fifo;
}

/// How jobs that the policy ranks equal are ordered. See docs/model.md, "Ties".
enum class Ties : std::uint8_t {
  Share,  // take turns: the earlier release first; none preempts another
  Fixed,  // always by the order of tasks
};

/// What can interrupt a running job. See docs/model.md.
enum class PreemptionMode : std::uint8_t { None, Cooperative, Os, Auto };

/// Processors with workers and an order of jobs of their own. A DAG's jobs never leave its cluster (clusters.hpp).
struct Cluster {
  std::string name;
  std::uint32_t workers = 1;
  std::vector<int> cpus = {};  // of its workers, as Platform::cpus

  friend bool operator==(const Cluster &, const Cluster &) = default;
};

/// An accelerator or another resource that serves jobs while they hold no worker. Its service is never preempted.
struct Device {
  /// Which of the jobs that wait for a slot comes next.
  enum class Queue : std::uint8_t {
    Priority,  // the first in the order of jobs
    Fifo,      // the one that asked first, as in most drivers
  };
  std::string name;
  std::uint32_t slots = 1;  // jobs that it serves at the same time
  Queue queue = Queue::Priority;
  Duration others = 0;  // in the part of a cluster: the longest time for which others use it before a request

  friend bool operator==(const Device &, const Device &) = default;
};

struct Platform {
  std::uint32_t workers = 1;  // m: jobs that execute at the same time; with clusters, the sum of theirs
  PreemptionMode preemption = PreemptionMode::Auto;
  std::vector<Cluster> clusters = {};  // empty: all workers serve all DAGs
  std::vector<Device> devices = {};
  /// Not one scheduler but several start the jobs, each without knowing those of the others: the processes of a robot.
  bool several_executors = false;
  std::vector<int> cpus = {};  // processors of the workers, ascending; empty: any, or those of the clusters

  friend bool operator==(const Platform &, const Platform &) = default;
};

struct Workload {
  std::string name;
  Platform platform;
  PolicyKind policy = PolicyKind::RateMonotonic;
  Ties ties = Ties::Share;
  std::vector<Dag> dags;

  /// Number of tasks of all DAGs. TaskIds are smaller, and follow the order of DAGs.
  [[nodiscard]] std::size_t task_count() const;

  /// U = sum C_i / T_i (eq. utilization).
  [[nodiscard]] double utilization() const;

  friend bool operator==(const Workload &, const Workload &) = default;
};

/// One row for each TaskId: the task's place in its workload. Valid while the workload is unchanged.
struct TaskRef {
  DagId dag;
  std::uint32_t index = 0;  // index in the DAG
  const Task *task = nullptr;
  TaskId id;
};

[[nodiscard]] std::vector<TaskRef> flatten(const Workload &workload);

/// Ranks in a topological order: result[i] is the rank of task i; ties by index. Requires acyclic edges.
[[nodiscard]] std::vector<std::uint32_t> topological_ranks(const Dag &dag);

/// Gives every data task the largest period among its predecessors, in topological order. Sets its deadline to that
/// period where none is set (0). Requires acyclic edges.
void inherit_periods(Dag &dag);

/// A value of an enumeration, and its name in files and options.
template <class Enum>
struct Named {
  Enum value;
  const char *name;
};
template <class Enum>
Named(Enum, const char *) -> Named<Enum>;

/// All values of an enumeration of workloads, in the order in which messages list them. Empty for other types.
template <class Enum>
inline constexpr std::array<Named<Enum>, 0> kValues{};
template <>
inline constexpr std::array kValues<Criticality> = {
    Named{Criticality::Low, "low"}, Named{Criticality::Normal, "normal"}, Named{Criticality::High, "high"}};
template <>
inline constexpr std::array kValues<Activation> = {Named{Activation::Timer, "timer"}, Named{Activation::Data, "data"}};
template <>
inline constexpr std::array kValues<Edges> = {Named{Edges::Executed, "executed"}, Named{Edges::Seen, "seen"}};
template <>
inline constexpr std::array kValues<Callback::Kind> = {
    Named{Callback::Kind::Timer, "timer"},     Named{Callback::Kind::Subscription, "subscription"},
    Named{Callback::Kind::Service, "service"}, Named{Callback::Kind::Client, "client"},
    Named{Callback::Kind::Action, "action"},   Named{Callback::Kind::Waitable, "waitable"}};
template <>
inline constexpr std::array kValues<OnBudget> = {Named{OnBudget::Abort, "abort"}, Named{OnBudget::Log, "log"},
                                                 Named{OnBudget::Demote, "demote"},
                                                 Named{OnBudget::SkipNext, "skip_next"}};
template <>
inline constexpr std::array kValues<PolicyKind> = {Named{PolicyKind::RateMonotonic, "rate_monotonic"},
                                                   Named{PolicyKind::DeadlineMonotonic, "deadline_monotonic"},
                                                   Named{PolicyKind::Fixed, "fixed"},
                                                   Named{PolicyKind::Edf, "edf"},
                                                   Named{PolicyKind::Fifo, "fifo"},
                                                   Named{PolicyKind::ChainAware, "chain_aware"}};
template <>
inline constexpr std::array kValues<Ties> = {Named{Ties::Share, "share"}, Named{Ties::Fixed, "fixed"}};
template <>
inline constexpr std::array kValues<PreemptionMode> = {
    Named{PreemptionMode::None, "none"}, Named{PreemptionMode::Cooperative, "cooperative"},
    Named{PreemptionMode::Os, "os"}, Named{PreemptionMode::Auto, "auto"}};
template <>
inline constexpr std::array kValues<Device::Queue> = {Named{Device::Queue::Priority, "priority"},
                                                      Named{Device::Queue::Fifo, "fifo"}};

/// Returns the name of a value, or "?".
template <class Enum>
requires(std::is_enum_v<Enum> && !kValues<Enum>.empty()) [[nodiscard]] const char *to_string(Enum value) {
  for (const Named<Enum> &named : kValues<Enum>) {
    if (named.value == value) return named.name;
  }
  return "?";
}

/// How a file states the phases of a task: `activation: event`, `offset: any`.
inline constexpr const char *kEventActivation = "event";
inline constexpr const char *kAnyOffset = "any";

}  // namespace redag
