#include "redag/analysis/paper.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "redag/analysis/arithmetic.hpp"
#include "redag/analysis/one_worker.hpp"
#include "redag/analysis/utilization.hpp"

namespace redag::analysis {
namespace {

constexpr int kMaxSteps = 1'000'000;

// What every equation of the paper takes for granted; the first that does not hold here, or empty.
std::string broken_assumption(const System &system, bool with_blocking) {
  if (system.policy != PolicyKind::RateMonotonic) return "the policy is not rate_monotonic";
  if (auto reason = one_worker::why_not(system)) return *reason;
  if (system.has_edges()) return "callbacks have predecessors: the time they wait for them is not counted";
  for (const SystemTask &task : system.tasks) {
    if (task.jitter > 0) return "task '" + task.name + "' has release jitter";
  }
  for (std::size_t rank = 1; rank < system.by_rank.size(); ++rank) {
    const SystemTask &task = system.tasks[system.by_rank[rank]];
    if (task.period == system.tasks[system.by_rank[rank - 1]].period) {
      return "task '" + task.name + "' has the period of another one, which then counts for neither";
    }
  }
  if (with_blocking) return {};
  if (system.mode != sched::Preemption::Full) return "less urgent callbacks are not preempted at once";
  for (std::uint32_t u = 0; u < system.units.size(); ++u) {
    if (one_worker::view_of(system, u).blocking > 0) return "less urgent callbacks can block";
  }
  return {};
}

// hp(i) of the paper: strictly smaller periods.
std::vector<std::uint32_t> more_urgent(const System &system, const SystemTask &task) {
  std::vector<std::uint32_t> found;
  for (std::uint32_t j = 0; j < system.tasks.size(); ++j) {
    if (system.tasks[j].period < task.period) found.push_back(j);
  }
  return found;
}

// R = start + sum ceil(R / T_j) C_j up to `limit`.
std::optional<Duration> recurrence(const System &system, Duration start, const std::vector<std::uint32_t> &others,
                                   Duration limit) {
  Duration response = start;
  for (int step = 0; step < kMaxSteps && response <= limit; ++step) {
    Int128 sum = start;
    for (const std::uint32_t j : others) {
      sum += Int128{ceil_div(response, system.tasks[j].period)} * system.tasks[j].wcet;
    }
    if (saturate(sum) == response) return response;
    response = saturate(sum);
  }
  return std::nullopt;
}

ResponseBound itemise(const System &system, std::uint32_t t, std::optional<Duration> response, bool once,
                      const std::vector<std::uint32_t> &others, const std::vector<one_worker::Blocker> &blockers) {
  ResponseBound bound;
  const SystemTask &task = system.tasks[t];
  if (!response || *response >= kUnbounded || *response > task.limit) {
    bound.absent = one_worker::kExceedsLimit;
    return bound;
  }
  bound.response = response;
  bound.terms.push_back(Term{Term::Kind::Own, TaskId(t), task.dag, task.wcet - task.overhead, 1});
  if (task.overhead > 0) bound.terms.push_back(Term{Term::Kind::Overhead, TaskId(t), task.dag, task.overhead, 0});
  for (const one_worker::Blocker &blocker : blockers) {
    const DagId dag = system.tasks[blocker.task].dag;
    bound.terms.push_back(Term{Term::Kind::Blocking, TaskId(blocker.task), dag, blocker.amount, 1});
  }
  for (const std::uint32_t j : others) {
    const SystemTask &other = system.tasks[j];
    const std::int64_t jobs = once ? 1 : ceil_div(*response, other.period);
    bound.terms.push_back(Term{Term::Kind::Interference, TaskId(j), other.dag, multiply(jobs, other.wcet), jobs});
  }
  return bound;
}

// DAGs of independent tasks answer with their last one; of others the paper says nothing.
void fill_dags(const System &system, Bound &bound) {
  bound.dags.resize(system.dags.size());
  for (std::size_t d = 0; d < system.dags.size(); ++d) {
    bound.dags[d].absent = "the equations bound callbacks, not DAGs";
    if (system.dags[d].units.size() != system.dags[d].tasks.size() || system.dags[d].tasks.empty()) continue;
    for (const std::uint32_t t : system.dags[d].tasks) {
      const ResponseBound &task = bound.tasks[t];
      if (t == system.dags[d].tasks.front() ||
          task.response.value_or(kNever) > bound.dags[d].response.value_or(kNever)) {
        bound.dags[d] = task;
      }
    }
  }
}

Outcome apply_rm_bound(const System &system) {
  Bound bound;
  const auto n = static_cast<double>(system.tasks.size());
  const double limit = n * std::expm1(std::log(2.0) / n);
  // Nothing is accepted by rounding.
  bound.accepts = !system.tasks.empty() && system.utilization <= limit - 1e-9;
  char text[96];
  std::snprintf(text, sizeof text, "U = %.4f, limit %.4f for %zu callbacks", system.utilization, limit,
                system.tasks.size());
  bound.figures = text;
  // N callbacks are at least as many as tasks or DAGs, and the limit falls with N: sound where Liu and Layland's is.
  const Outcome proper = liu_layland().apply(system);
  if (const auto *reason = std::get_if<NotApplicable>(&proper)) bound.unsound = reason->reason;
  return bound;
}

Outcome apply_interference(const System &system) {
  Bound bound;
  bound.unsound = broken_assumption(system, false);
  for (std::uint32_t t = 0; t < system.tasks.size(); ++t) {
    const SystemTask &task = system.tasks[t];
    const std::vector<std::uint32_t> others = more_urgent(system, task);
    Duration response = task.wcet;
    Duration shortest = kNever;
    for (const std::uint32_t j : others) {
      response = add(response, system.tasks[j].wcet);
      shortest = std::min(shortest, system.tasks[j].period);
    }
    if (bound.unsound.empty() && response > shortest) {
      bound.unsound = "'" + task.name + "': a more urgent task comes again before it ends and is counted once";
    }
    bound.tasks.push_back(itemise(system, t, response, true, others, {}));
  }
  fill_dags(system, bound);
  return bound;
}

Outcome apply_recurrence(const System &system, bool with_blocking) {
  Bound bound;
  bound.unsound = broken_assumption(system, with_blocking);
  for (std::uint32_t t = 0; t < system.tasks.size(); ++t) {
    const SystemTask &task = system.tasks[t];
    const std::vector<std::uint32_t> others = more_urgent(system, task);
    one_worker::View view;
    if (with_blocking) view = one_worker::view_of(system, task.unit);
    const auto response = recurrence(system, add(task.wcet, view.blocking), others, task.period);
    bound.tasks.push_back(itemise(system, t, response, false, others, view.blockers));
  }
  fill_dags(system, bound);
  return bound;
}

Outcome apply_rta(const System &system) { return apply_recurrence(system, false); }
Outcome apply_rta_blocking(const System &system) { return apply_recurrence(system, true); }

Method make(std::string_view name, Subject subject, std::string_view equation, std::string_view sound_only_if,
            std::string_view complexity, Outcome (*apply)(const System &)) {
  Method method;
  method.name = name;
  method.subject = subject;
  method.cite = equation;
  method.assumptions = "none: it computes what the equation says";
  method.sound_only_if = sound_only_if;
  method.complexity = complexity;
  method.apply = apply;
  return method;
}

}  // namespace

Method paper_rm_bound() {
  return make("paper_rm_bound", Subject::System, "ReDAG-RT, eq. rm_bound",
              "one worker, full preemption, rate-monotonic order, D >= T, no jitter, no blocking; DAGs of one rate",
              "O(n)", apply_rm_bound);
}

Method paper_interference() {
  return make("paper_interference", Subject::Task, "ReDAG-RT, eq. interference",
              "one worker, full preemption, rate_monotonic, different periods, no edges, jitter or blocking, and no "
              "more urgent task comes again before the task ends",
              "O(n) a task", apply_interference);
}

Method paper_rta() {
  return make("paper_rta", Subject::Task, "ReDAG-RT, eqs. rta and rta_convergence",
              "one worker, full preemption, rate_monotonic, different periods, no edges, jitter or blocking; R <= T",
              "pseudo-polynomial; O(n) a step", apply_rta);
}

Method paper_rta_blocking() {
  return make("paper_rta_blocking", Subject::Task, "ReDAG-RT, eq. rta_blocking; B_i as on one worker",
              "one worker, rate_monotonic, different periods, no edges or jitter; R <= T",
              "pseudo-polynomial; O(n) a step", apply_rta_blocking);
}

}  // namespace redag::analysis
