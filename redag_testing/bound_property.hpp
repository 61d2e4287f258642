// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The property that every bound must have: no job of a simulated run answers later than the bound says. Random
// workloads, each simulated several times with other offsets, sporadic gaps, execution times and jitter, under the
// scheduler that runs for real. Generic over analysis::Method. Not thread-safe.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "redag/base/rng.hpp"
#include "redag/model/workload.hpp"
#include "redag_analysis/core/bound.hpp"

namespace redag::testing {

struct BoundCase {
  Workload workload;
  analysis::AnalysisPlatform platform;
};
using BoundGenerator = std::function<BoundCase(Rng &)>;

/// rate_monotonic, deadline_monotonic, fixed.
[[nodiscard]] std::vector<PolicyKind> priorities_of_tasks();

/// What random_bound_case() draws from. Times are a few ticks (nanoseconds), so that corners are met often.
struct BoundCaseLimits {
  std::uint32_t min_workers = 1;
  std::uint32_t max_workers = 1;
  sched::Preemption preemption = sched::Preemption::Full;
  std::vector<PolicyKind> policies = priorities_of_tasks();
  bool edges = false;            // each DAG one rate, data tasks and aligned timers; otherwise independent tasks
  bool rates = false;            // with edges: tasks of a DAG have several periods and offsets
  std::uint32_t max_dags = 6;    // with edges; otherwise tasks, a DAG each or a few to a DAG
  std::uint32_t max_tasks = 5;   // of a DAG
  double min_utilization = 0.3;  // per worker
  double max_utilization = 1.0;
  Duration min_period = 4;
  Duration max_period = 60;
  bool equal_periods = true;  // now and then several tasks (DAGs) share a period
  double min_deadline = 0.5;  // of the period; never below the wcet
  double max_deadline = 1.0;
  bool jitter = false;
  bool groups = false;
  bool caps = false;    // max_active
  bool levels = false;  // fewer priority levels than tasks, now and then
  bool overheads = false;
  bool queues = false;  // overrun: queue
};

[[nodiscard]] BoundCase random_bound_case(Rng &rng, const BoundCaseLimits &limits);
/// random_bound_case() within `limits`, case after case.
[[nodiscard]] BoundGenerator cases(const BoundCaseLimits &limits);

/// How many random cases a test tries: `usual`, or what the environment says: REDAG_BOUND_WORKLOADS, for a long run;
/// and never more than REDAG_BOUND_AT_MOST, for a slow build.
[[nodiscard]] std::uint64_t how_many(std::uint64_t usual);

struct BoundPropertyOptions {
  std::uint64_t seed = 1;
  std::uint32_t workloads = 1000;  // to which the method applies; how_many()
  std::uint32_t runs = 5;          // simulations of each
  std::uint32_t periods = 10;      // length of a simulation, in largest periods
  std::string executor = "redag";  // sched::executors(): under which the bound is to hold
  /// Look at bounds that a method itself calls unsound, too (to show that they are).
  bool include_unsound = false;
};

struct BoundPropertyResult {
  std::uint64_t workloads = 0;       // the method applied
  std::uint64_t not_applicable = 0;  // drawn, and it did not
  std::uint64_t bounds = 0;          // response times bounded, of tasks and DAGs of several tasks; or accepted systems
  std::uint64_t jobs = 0;            // finished, of what is bounded
  std::uint64_t violations = 0;      // workloads with a job that breaks a bound
  double mean_ratio = 0;             // largest observed / bound
  double p95_ratio = 0;
  double max_ratio = 0;
  std::string first_violation;  // with the seed to replay it
};

/// REDAG_BOUND_SEED=<seed of one workload> in the environment replays that workload alone.
[[nodiscard]] BoundPropertyResult check_bound(const analysis::Method &method, const BoundGenerator &generator,
                                              const BoundPropertyOptions &options = {});

/// check_bound() as a test: no violation, and the method did apply. Prints a line of figures.
void expect_bound_holds(const analysis::Method &method, const BoundGenerator &generator,
                        const BoundPropertyOptions &options = {});

/// Calls `check` for `count` cases, those that can be analysed, with what they compile to; the first that fails a
/// test's expectation is described and ends it.
void for_cases(const BoundGenerator &generator, std::uint32_t count,
               const std::function<void(const BoundCase &, const analysis::System &, Rng &)> &check);

/// One workload for people: a line a task, with the platform.
[[nodiscard]] std::string describe(const BoundCase &bound_case);

}  // namespace redag::testing
