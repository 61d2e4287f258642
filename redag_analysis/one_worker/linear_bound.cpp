// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/one_worker/linear_bound.hpp"

#include <span>

#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/effort.hpp"
#include "redag_analysis/one_worker/one_worker.hpp"

namespace redag::analysis {
namespace {

// Utilizations have units of 2^-40, durations in the numerator units of 2^-16. All products then stay below 2^126 for
// execution times up to 2^50 ns (13 days).
constexpr int kShareBits = 40;
constexpr int kTimeBits = 16;
constexpr Int128 kShareUnit = Int128{1} << kShareBits;
constexpr Duration kLongest = Duration{1} << 50;

Int128 ceil_of(Int128 numerator, Int128 denominator) { return (numerator + denominator - 1) / denominator; }

// Sums over units.
struct Line {
  Int128 utilization = 0;
  Int128 slopes = 0;  // sum C_j (1 - U_j)

  void add(const Unit &unit, Int128 sign) {
    utilization += sign * ceil_of(Int128{unit.volume} << kShareBits, unit.period);
    if (unit.volume < unit.period) {
      slopes += sign * ceil_of((Int128{unit.volume} << kTimeBits) * (unit.period - unit.volume), unit.period);
    }
  }
};

// `above` holds the sums of all units of its level and above, including itself.
ResponseBound bound_unit(const TaskSet &task_set, const one_worker::Views &views, std::uint32_t u, Line above) {
  const Unit &unit = task_set.units[u];
  above.add(unit, -1);
  const auto &[utilization, slopes] = above;
  const std::vector<one_worker::Blocker> blockers = views.blockers(u);
  Duration blocking = 0;
  for (const one_worker::Blocker &blocker : blockers) blocking = add(blocking, blocker.amount);
  ResponseBound bound;
  if (utilization + ceil_of(Int128{unit.volume} << kShareBits, unit.period) > kShareUnit) {
    bound.absent = "the utilization of its level may exceed one";
    return bound;
  }
  const Int128 fixed = (Int128{blocking} + unit.volume) << kTimeBits;
  const Int128 rest = kShareUnit - utilization;  // > 0, because the unit's own share is
  const Duration response = saturate(((fixed + slopes) << (kShareBits - kTimeBits)) / rest);
  if (response > unit.limit) {
    bound.absent = one_worker::kExceedsLimit;
    return bound;
  }

  bound.response = response;
  if (!Effort::itemises(u)) return bound;
  Duration overhead = 0;
  for (const std::uint32_t t : unit.tasks) overhead += task_set.tasks[t].overhead;
  bound.terms.push_back(Term{Term::Kind::Own, TaskId(), unit.dag, unit.volume - overhead, 1});
  if (overhead > 0) bound.terms.push_back(Term{Term::Kind::Overhead, TaskId(), unit.dag, overhead, 0});
  for (const one_worker::Blocker &blocker : blockers) {
    const DagId dag = task_set.tasks[blocker.task].dag;
    bound.terms.push_back(Term{Term::Kind::Blocking, TaskId(blocker.task), dag, blocker.amount, 1});
  }
  // The formula has no separate share for each of the others.
  const Duration interference = response - unit.volume - blocking;
  if (interference > 0) bound.terms.push_back(Term{Term::Kind::Interference, TaskId(), DagId(), interference, 0});
  return bound;
}

Outcome apply_linear(const TaskSet &task_set) {
  if (auto reason = one_worker::why_not(task_set)) return NotApplicable{*reason};
  if (task_set.mode != sched::Preemption::Full) return NotApplicable{"requires full preemption"};
  for (const Unit &unit : task_set.units) {
    if (unit.jitter > 0) {
      return NotApplicable{"task '" + task_set.tasks[unit.tasks.front()].name + "' has release jitter"};
    }
    if (unit.volume > kLongest) return NotApplicable{"an execution time exceeds 13 days"};
  }
  std::vector<ResponseBound> units(task_set.units.size());
  const one_worker::Views views(task_set);
  Line above;
  std::size_t counted = 0;
  for (const std::uint32_t u : views.order()) {
    const std::span<const std::uint32_t> level = views.down_to(views.level(u));
    for (; counted < level.size(); ++counted) above.add(task_set.units[level[counted]], 1);
    units[u] = bound_unit(task_set, views, u, above);
  }
  return from_units(task_set, std::move(units));
}

}  // namespace

Method linear_bound() {
  return Method{
      .name = "linear_bound",
      .subject = Subject::Task,
      .cite =
          "E. Bini, T. H. C. Nguyen, P. Richard, S. K. Baruah, A response-time bound in fixed-priority scheduling with "
          "arbitrary deadlines, IEEE Transactions on Computers 58(2), 2009",
      .assumptions =
          "one worker, full preemption, static priorities, any deadlines, no jitter; blocking added; a DAG of one rate "
          "counts as one task with C = volume",
      .complexity = "O(n log n)",
      .apply = apply_linear,
  };
}

}  // namespace redag::analysis
