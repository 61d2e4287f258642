// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/core/rate_edges.hpp"

#include <algorithm>
#include <vector>

#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/effort.hpp"
#include "redag_analysis/core/jobs_in_progress.hpp"

namespace redag::analysis {
namespace {

constexpr std::string_view kFasterThanData =
    "a predecessor has a larger period than this task, so data is missing for some jobs, which are skipped by design";
constexpr std::string_view kNoData = "a predecessor of another rate has no bound";
constexpr std::string_view kLateData = "data of its predecessors can arrive after its next release";
constexpr std::string_view kGaveUp = "gave up: waiting times and response times did not converge in a thousand steps";
constexpr std::string_view kBinds =
    "a max_active over several parts of the DAG is only known not to bind if all its tasks have a bound";
constexpr std::string_view kFewThreads = "fewer threads than tasks are only known to suffice if all tasks have a bound";

constexpr int kMaxRounds = 1000;

// What a waiting unit knows of a predecessor: data of its job k arrive within [offset + k period, ... + response].
struct Data {
  Duration period = 0;
  Duration offset = 0;
  Duration response = 0;
};

// The latest that the first task of a unit can become ready after its grid point; docs/analysis.md has the cases.
// `seen` is the latest arrival of data on its own grid and of its own timer. `others` are predecessors on other grids,
// none of a larger period. Completions of one instant have an order: a task's next datum can arrive at the instant at
// which another is taken.
std::optional<Duration> wait_for(const Unit &unit, Duration seen, const std::vector<Data> &others) {
  if (others.empty()) return seen;
  const Duration period = unit.period;
  Duration first = seen;  // of the first job, which finds no earlier data
  Duration between = 0;   // the longest time between two data of another grid
  for (const Data &data : others) {
    first = std::max(first, data.offset - unit.offset + data.response);
    between = std::max(between, add(data.period, data.response) - 1);
  }
  if (between <= period) return first;
  Duration wait = std::max(first, add(seen, between));
  if (others.size() == 1) {
    const Data &other = others.front();
    const Duration behind = std::max(other.offset - unit.offset, seen - 1 + other.period - period);
    wait = std::min(wait, std::max(seen, behind + other.response));
  }
  return wait;
}

class Resolver {
 public:
  Resolver(const TaskSet &task_set, Outcome (*apply)(const TaskSet &))
      : task_set_(task_set), alone_(task_set), apply_(apply) {
    take_away();
    absent_.resize(task_set.units.size());
    responses_.resize(task_set.units.size());
    for (std::uint32_t u = 0; u < task_set.units.size(); ++u) responses_[u] = task_set.units[u].length;
  }

  Outcome run() {
    for (int round = 0; update_waits(round); ++round) {
      Outcome outcome = apply_(alone_);
      const Bound *bound = std::get_if<Bound>(&outcome);
      if (bound == nullptr) return outcome;
      found_ = *bound;
      for (std::uint32_t u = 0; u < task_set_.units.size(); ++u) {
        responses_[u] = absent_[u].empty() ? of_unit(u).response : std::nullopt;
      }
    }
    return result();
  }

 private:
  [[nodiscard]] const ResponseBound &of_unit(std::uint32_t u) const {
    return found_.tasks[task_set_.units[u].tasks.front()];
  }

  void take_away() {
    alone_.threads_suffice_if_bounded = false;
    if (task_set_.threads_suffice_if_bounded) alone_.platform.max_started = 0;
    conditional_.resize(task_set_.dags.size());
    for (std::uint32_t d = 0; d < task_set_.dags.size(); ++d) {
      CompiledDag &dag = alone_.dags[d];
      if (dag.max_active == 0 || dag.units.size() < 2) continue;
      if (most_jobs_in_progress(task_set_, DagId(d)) > dag.max_active) continue;
      dag.max_active = 0;
      conditional_[d] = true;
    }
    const auto leaves_unit = [&](std::uint32_t t) {
      return [&, t](std::uint32_t other) { return task_set_.tasks[other].unit != task_set_.tasks[t].unit; };
    };
    for (std::uint32_t t = 0; t < alone_.tasks.size(); ++t) {
      std::erase_if(alone_.tasks[t].predecessors, leaves_unit(t));
      std::erase_if(alone_.tasks[t].successors, leaves_unit(t));
    }
    for (Unit &unit : alone_.units) {
      unit.awaits.clear();
      unit.has_edges = std::any_of(unit.tasks.begin(), unit.tasks.end(),
                                   [&](std::uint32_t t) { return !alone_.tasks[t].predecessors.empty(); });
    }
  }

  // Recomputes the waits from the latest responses; false if none exceeds the assumed one. Waits only grow, and a unit
  // that has lost its wait never regains one.
  bool update_waits(int round) {
    bool changed = round == 0;  // the method has not been applied yet
    for (std::uint32_t u = 0; u < task_set_.units.size(); ++u) {
      const Unit &unit = task_set_.units[u];
      if (unit.awaits.empty() || !absent_[u].empty()) continue;
      std::optional<Duration> wait = round < kMaxRounds ? wait_of(u) : std::nullopt;
      if (!wait && round >= kMaxRounds) absent_[u] = kGaveUp;
      if (wait && *wait > unit.limit) {
        absent_[u] = kLateData;
        wait.reset();
      }
      Duration &jitter = alone_.units[u].jitter;
      const Duration larger = std::max(jitter, wait ? *wait : jitter_of_number(u));
      changed = changed || larger > jitter || !wait;
      jitter = larger;
    }
    return changed;
  }

  // Returns the wait of a unit; sets absent_ if there is none.
  std::optional<Duration> wait_of(std::uint32_t u) {
    const Unit &unit = task_set_.units[u];
    const CompiledTask &first = task_set_.tasks[unit.tasks.front()];
    Duration seen = unit.jitter;
    std::vector<Data> others;
    for (const std::uint32_t p : unit.awaits) {
      const CompiledTask &before = task_set_.tasks[p];
      if (before.period > first.period) {
        absent_[u] = kFasterThanData;
        return std::nullopt;
      }
      const std::optional<Duration> response = responses_[before.unit];
      if (!response) {
        absent_[u] = kNoData;
        return std::nullopt;
      }
      if (before.period == unit.period && before.offset == unit.offset) {
        seen = std::max(seen, *response);
      } else {
        others.push_back(Data{before.period, before.offset, *response});
      }
    }
    return wait_for(unit, seen, others);
  }

  // The jitter that explains how many jobs become ready in any interval, for any responses. It is at least the period.
  Duration jitter_of_number(std::uint32_t u) const {
    const Unit &unit = task_set_.units[u];
    const CompiledTask &first = task_set_.tasks[unit.tasks.front()];
    // A timer's job becomes ready before the next release is seen, or is skipped.
    if (!first.data) return add(unit.period, unit.jitter);
    // Each job takes a datum of every predecessor, of which one can be from before the interval. The jobs that complete
    // in the interval became ready in it, were ready before, or had started.
    Duration least = kUnbounded;
    for (const std::uint32_t p : unit.awaits) {
      const CompiledTask &before = task_set_.tasks[p];
      if (before.period != unit.period) continue;
      const Unit &from = task_set_.units[before.unit];
      const Duration number = from.awaits.empty() ? from.jitter : std::max(from.jitter, jitter_of_number(before.unit));
      const auto hops = static_cast<Duration>(from.tasks.size());
      const Duration ready = std::max<Duration>(1, before.limit / before.period);
      least = std::min(least, add(number, multiply(unit.period, hops * (ready + 2))));
    }
    return least;
  }

  // ---- the answer ----

  Outcome result() {
    const bool all = std::all_of(responses_.begin(), responses_.end(), [](const auto &r) { return r.has_value(); });
    if (task_set_.threads_suffice_if_bounded && !all) return nothing(kFewThreads);
    for (std::uint32_t u = 0; u < task_set_.units.size(); ++u) {
      if (conditional_[task_set_.units[u].dag.value] && !responses_[u]) return nothing(kBinds);
    }
    Bound bound = found_;
    for (std::uint32_t u = 0; u < task_set_.units.size(); ++u) {
      if (!task_set_.units[u].awaits.empty()) bound_tasks(u, bound);
    }
    ages_.resize(task_set_.units.size());
    for (std::uint32_t d = 0; d < task_set_.dags.size(); ++d) {
      const auto waits = [&](std::uint32_t u) { return !task_set_.units[u].awaits.empty(); };
      const std::vector<std::uint32_t> &units = task_set_.dags[d].units;
      if (std::any_of(units.begin(), units.end(), waits)) bound.dags[d] = if_bounded(end_to_end(d));
    }
    return bound;
  }

  [[nodiscard]] Bound nothing(std::string_view why) const {
    ResponseBound none;
    none.absent = why;
    return from_units(task_set_, std::vector<ResponseBound>(task_set_.units.size(), none));
  }

  // The longest time from the first task's readiness to the end of the unit. Further timers of the unit can be seen
  // later than that task; the unit's window then need not have begun at its readiness.
  [[nodiscard]] Duration from_ready(std::uint32_t u) const {
    const ResponseBound &bound = of_unit(u);
    const std::vector<std::uint32_t> &tasks = task_set_.units[u].tasks;
    const bool is_seen_later = std::any_of(tasks.begin() + 1, tasks.end(), [&](std::uint32_t t) {
      return !task_set_.tasks[t].data && task_set_.tasks[t].jitter > 0;
    });
    if (is_seen_later) return *bound.response;
    // A timer's jitter also counts the time that the machine can take during the response.
    return add(std::max(bound.from_ready, *bound.response - alone_.units[u].jitter), task_set_.frozen);
  }

  // Returns the unit's bound for the given `response`: one Wait term replaces the jitter and covers the time before
  // readiness.
  [[nodiscard]] ResponseBound with_wait(std::uint32_t u, Duration response) const {
    ResponseBound bound = of_unit(u);
    std::erase_if(bound.terms, [](const Term &term) { return term.kind == Term::Kind::Jitter; });
    const Duration wait = response - (*bound.response - alone_.units[u].jitter);
    const TaskId first(task_set_.units[u].tasks.front());
    if (wait > 0 && Effort::itemises(u))
      bound.terms.push_back(Term{Term::Kind::Wait, first, task_set_.units[u].dag, wait, 0});
    bound.response = response;
    return bound;
  }

  void bound_tasks(std::uint32_t u, Bound &bound) const {
    for (const std::uint32_t t : task_set_.units[u].tasks) {
      ResponseBound &task = bound.tasks[t];
      if (!absent_[u].empty()) {
        task = ResponseBound{};
        task.absent = absent_[u];
      } else if (task.response) {
        task = if_bounded(with_wait(u, task_set_.tasks[t].data ? from_ready(u) : *task.response));
      }
    }
  }

  // How long before its grid point the data of a unit's job can have been released.
  Duration age_of(std::uint32_t u) {
    if (ages_[u]) return *ages_[u];
    const Unit &unit = task_set_.units[u];
    Duration age = 0;
    for (const std::uint32_t p : unit.awaits) {
      const std::uint32_t before = task_set_.tasks[p].unit;
      const Duration origin = age_of(before);
      age = std::max(age, is_on_grid(u, p) ? origin : add(origin, oldest(before)));
    }
    ages_[u] = age;
    return age;
  }

  [[nodiscard]] bool is_on_grid(std::uint32_t u, std::uint32_t task) const {
    const CompiledTask &before = task_set_.tasks[task];
    return before.period == task_set_.units[u].period && before.offset == task_set_.units[u].offset;
  }

  // The greatest age of a predecessor's latest datum. The next one arrives later, or at the same instant after it.
  [[nodiscard]] Duration oldest(std::uint32_t u) const { return add(task_set_.units[u].period, *responses_[u]); }

  ResponseBound end_to_end(std::uint32_t dag) {
    ResponseBound worst;
    for (const std::uint32_t u : task_set_.dags[dag].units) {
      const Unit &unit = task_set_.units[u];
      if (!responses_[u] || !absent_[u].empty()) {
        worst = ResponseBound{};
        worst.absent = absent_[u].empty() ? of_unit(u).absent : absent_[u];
        return worst;
      }
      ResponseBound bound = of_unit(u);
      if (!unit.awaits.empty()) {
        Duration response = 0;
        for (const std::uint32_t p : unit.awaits) {
          const std::uint32_t before = task_set_.tasks[p].unit;
          const Duration since_data = is_on_grid(u, p) ? *responses_[u] : add(from_ready(u), oldest(before));
          response = std::max(response, add(since_data, age_of(before)));
        }
        bound = with_wait(u, response);
      }
      if (!worst.response || *bound.response > *worst.response) worst = bound;
    }
    return worst;
  }

  const TaskSet &task_set_;
  TaskSet alone_;  // without rate edges; the jitter of a waiting unit includes its wait
  Outcome (*apply_)(const TaskSet &);
  std::vector<bool> conditional_;                   // by DagId: its max_active was removed
  std::vector<std::optional<Duration>> responses_;  // by unit
  std::vector<std::string_view> absent_;            // by unit: why it has no wait
  std::vector<std::optional<Duration>> ages_;
  Bound found_;
};

bool shares_max_active(const TaskSet &task_set) {
  return std::any_of(task_set.dags.begin(), task_set.dags.end(),
                     [](const CompiledDag &dag) { return dag.max_active > 0 && dag.units.size() > 1; });
}

}  // namespace

std::optional<std::string> why_not_directly(const TaskSet &task_set) {
  if (task_set.has_rate_edges()) return "edges join tasks of different periods or offsets: see the bounds for DAGs";
  if (task_set.threads_suffice_if_bounded)
    return "there are fewer threads than tasks: see the bounds on response times";
  return std::nullopt;
}

bool is_across_rates(const TaskSet &task_set) { return why_not_directly(task_set) || shares_max_active(task_set); }

Outcome across_rates(const TaskSet &task_set, Outcome (*apply)(const TaskSet &task_set)) {
  if (!is_across_rates(task_set)) return apply(task_set);
  return Resolver(task_set, apply).run();
}

}  // namespace redag::analysis
