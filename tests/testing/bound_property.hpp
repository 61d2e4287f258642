// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The property that every bound must have: no job of a simulated run answers later than its bound. Random workloads are
// simulated several times, each time with other offsets, sporadic gaps, execution times and jitter, under the scheduler
// that runs for real. Generic over analysis::Method. Not thread-safe.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "redag/derived/rng.hpp"
#include "redag/model/workload.hpp"
#include "redag_analysis/core/bound.hpp"

namespace redag::testing {

struct BoundCase {
  Workload workload;
  analysis::AnalysisPlatform platform;
};
using BoundGenerator = std::function<BoundCase(Rng &)>;

/// Compiles a workload that can be compiled; otherwise the test fails. Without a platform it is platform_of(workload).
[[nodiscard]] analysis::TaskSet compiled(const Workload &workload, const analysis::AnalysisPlatform &platform);
[[nodiscard]] analysis::TaskSet compiled(const Workload &workload);
[[nodiscard]] analysis::TaskSet compiled(const Workload &workload, sched::Preemption preemption);
[[nodiscard]] analysis::TaskSet compiled(const BoundCase &bound_case);

/// rate_monotonic, deadline_monotonic and fixed.
[[nodiscard]] std::vector<PolicyKind> priorities_of_tasks();

/// The ranges that random_bound_case() draws from. Times are a few ticks (nanoseconds), because corner cases are then
/// frequent.
struct BoundCaseLimits {
  std::uint32_t min_workers = 1;
  std::uint32_t max_workers = 1;
  sched::Preemption preemption = sched::Preemption::Full;
  std::vector<PolicyKind> policies = priorities_of_tasks();
  bool edges = false;            // each DAG has one rate, data tasks and aligned timers; otherwise tasks are
                                 // independent
  bool rates = false;            // with edges: tasks of a DAG have several periods and offsets
  bool phases = true;            // with edges: sometimes nothing synchronises the sources of a DAG
  std::uint32_t max_dags = 6;    // with edges; otherwise the number of tasks, a DAG each or a few to a DAG
  std::uint32_t max_tasks = 5;   // of a DAG
  double min_utilization = 0.3;  // per worker
  double max_utilization = 1.0;
  Duration min_period = 4;
  Duration max_period = 60;
  bool equal_periods = true;  // sometimes several tasks (DAGs) share a period
  double min_deadline = 0.5;  // of the period; never below the wcet
  double max_deadline = 1.0;
  bool jitter = false;
  bool groups = false;
  bool caps = false;    // max_active
  bool levels = false;  // sometimes fewer priority levels than tasks
  bool overheads = false;
  bool queues = false;  // overrun: queue
};

[[nodiscard]] BoundCase random_bound_case(Rng &rng, const BoundCaseLimits &limits);
/// Returns a generator that calls random_bound_case() with `limits`.
[[nodiscard]] BoundGenerator cases(const BoundCaseLimits &limits);

/// Returns how many random cases a test tries: REDAG_BOUND_WORKLOADS of the environment (for a long run), or else
/// `usual`. The number never exceeds REDAG_BOUND_AT_MOST (for a slow build).
[[nodiscard]] std::uint64_t how_many(std::uint64_t usual);

struct BoundPropertyOptions {
  std::uint64_t seed = 1;
  std::uint32_t workloads = 1000;  // number to which the method applies; see how_many()
  std::uint32_t runs = 5;          // simulations of each workload
  std::uint32_t periods = 10;      // length of a simulation, in largest periods
  std::string executor = "redag";  // one of executors::all(), under which the bound must hold
  /// Each task of a DAG of one rate is bounded from its source's release; otherwise from its own, as its deadline is.
  bool from_source = false;
  bool keeps_grids = false;  // timers of a DAG keep their periods, and their offsets to each other
  /// Also asks the method about task sets that it must not bound as a whole.
  bool include_refused = false;
  /// Also tests bounds that a method itself calls unsound, to show that they are.
  bool include_unsound = false;
};

struct BoundPropertyResult {
  std::uint64_t workloads = 0;       // workloads to which the method applied
  std::uint64_t not_applicable = 0;  // workloads drawn to which it did not apply
  std::uint64_t bounds = 0;          // bounded response times, of tasks and of DAGs of several tasks; or accepted
                                     // task sets
  std::uint64_t jobs = 0;            // finished jobs with a bound
  std::uint64_t violations = 0;      // workloads with a job that breaks a bound
  double mean_ratio = 0;             // largest observed / bound
  double p95_ratio = 0;
  double max_ratio = 0;
  std::string first_violation;  // with the seed to replay it
};

/// Checks the property for random workloads. REDAG_BOUND_SEED=<seed of one workload> in the environment replays that
/// workload alone.
[[nodiscard]] BoundPropertyResult check_bound(const analysis::Method &method, const BoundGenerator &generator,
                                              const BoundPropertyOptions &options = {});

/// Runs check_bound() as a test: there must be no violation, and the method must have applied. Prints a line of
/// figures.
void expect_bound_holds(const analysis::Method &method, const BoundGenerator &generator,
                        const BoundPropertyOptions &options = {});

/// Calls `check` for `count` cases that can be analysed, with their compiled task sets. The first case that fails an
/// expectation is described and ends the loop.
void for_cases(const BoundGenerator &generator, std::uint32_t count,
               const std::function<void(const BoundCase &, const analysis::TaskSet &, Rng &)> &check);

/// Describes one workload: a line per task, and the platform.
[[nodiscard]] std::string describe(const BoundCase &bound_case);

}  // namespace redag::testing
