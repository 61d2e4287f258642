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
constexpr std::string_view kNoData = "a predecessor that is released apart from this task has no bound";
constexpr std::string_view kNoOrder =
    "nothing synchronises its timer with a predecessor of the same period, so data is missing for some jobs, which are "
    "skipped";
constexpr std::string_view kNoRate =
    "it joins data of a shorter period that come by events, and nothing bounds the time until the next";
constexpr std::string_view kNoAge =
    "it joins data that come by events, and nothing bounds how long other data wait for the next";
constexpr std::string_view kLateData = "data of its predecessors can arrive after its next release";
constexpr std::string_view kGaveUp = "gave up: waiting times and response times did not converge in a thousand steps";
constexpr std::string_view kBinds =
    "a max_active over several parts of the DAG is only known not to bind if all its tasks have a bound";
constexpr std::string_view kFewThreads = "fewer threads than tasks are only known to suffice if all tasks have a bound";

constexpr int kMaxRounds = 1000;

// What a waiting unit knows of a predecessor on a grid of the same clock: data of its job k arrive within [offset + k
// period, ... + response].
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
    for (const CompiledTask &task : task_set.tasks) responses_.emplace_back(task.wcet);
  }

  Outcome run() {
    gaps_.assign(task_set_.tasks.size(), std::nullopt);
    for (int round = 0; update_waits(round); ++round) {
      Outcome outcome = apply_(alone_);
      const Bound *bound = std::get_if<Bound>(&outcome);
      if (bound == nullptr) return outcome;
      found_ = *bound;
      for (std::uint32_t t = 0; t < task_set_.tasks.size(); ++t) {
        responses_[t] = absent_[task_set_.tasks[t].unit].empty() ? found_.tasks[t].response : std::nullopt;
      }
      gaps_.assign(task_set_.tasks.size(), std::nullopt);
    }
    return result();
  }

 private:
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
      unit.has_edges = unit.tasks.size() > 1;
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

  [[nodiscard]] const CompiledTask &first_of(std::uint32_t u) const {
    return task_set_.tasks[task_set_.units[u].tasks.front()];
  }

  // True if the unit is released by a data task that joins several clocks, and so has a grid of its own.
  [[nodiscard]] bool joins_clocks(std::uint32_t u) const {
    const std::vector<std::uint32_t> &awaits = task_set_.units[u].awaits;
    return first_of(u).data && !awaits.empty() && task_set_.tasks[awaits.front()].clock != first_of(u).clock;
  }

  // In each interval (t, t + gap] a job of the task completes; kUnbounded if nothing says so.
  Duration gap_of(std::uint32_t t) {
    if (gaps_[t]) return *gaps_[t];
    const std::uint32_t u = task_set_.tasks[t].unit;
    Duration gap = 0;
    if (joins_clocks(u)) {
      for (const std::uint32_t p : task_set_.units[u].awaits) gap = std::max(gap, gap_of(p));
      gap = add(gap, found_.tasks.empty() ? task_set_.units[u].length : from_ready(t));
    } else {
      gap = first_of(u).has_gaps || !responses_[t] ? kUnbounded : add(task_set_.units[u].period, *responses_[t]) - 1;
    }
    gaps_[t] = gap;
    return gap;
  }

  // The wait where nothing synchronises the predecessors with each other or with the unit's own timer. `seen` is the
  // latest arrival of data, and of its own timer, after their own grid points.
  std::optional<Duration> wait_for_clocks(std::uint32_t u) {
    const CompiledTask &first = first_of(u);
    Duration seen = task_set_.units[u].jitter;
    Duration between = 0;  // the longest time between two data of a shorter period
    for (const std::uint32_t p : task_set_.units[u].awaits) {
      const CompiledTask &before = task_set_.tasks[p];
      if (before.period < first.period) {
        between = std::max(between, gap_of(p));
      } else if (first.data || is_released_with(before, first)) {
        seen = std::max(seen, *responses_[p]);
      } else {
        absent_[u] = kNoOrder;
        return std::nullopt;
      }
    }
    if (between == kUnbounded) {
      absent_[u] = kNoRate;
      return std::nullopt;
    }
    return between <= first.period ? std::max(seen, between) : add(seen, between);
  }

  // Returns the wait of a unit; sets absent_ if there is none.
  std::optional<Duration> wait_of(std::uint32_t u) {
    const Unit &unit = task_set_.units[u];
    const CompiledTask &first = first_of(u);
    bool is_one_clock = true;
    Duration seen = unit.jitter;
    std::vector<Data> others;
    for (const std::uint32_t p : unit.awaits) {
      const CompiledTask &before = task_set_.tasks[p];
      if (before.period > first.period) {
        absent_[u] = kFasterThanData;
        return std::nullopt;
      }
      const std::optional<Duration> response = responses_[p];
      if (!response) {
        absent_[u] = kNoData;
        return std::nullopt;
      }
      is_one_clock = is_one_clock && before.clock == first.clock;
      if (is_released_with(before, first)) {
        seen = std::max(seen, *response);
      } else {
        others.push_back(Data{before.period, before.offset, *response});
      }
    }
    return is_one_clock ? wait_for(unit, seen, others) : wait_for_clocks(u);
  }

  // The jitter that explains how many jobs become ready in any interval, for any responses. It is at least the period.
  Duration jitter_of_number(std::uint32_t u) const {
    const Unit &unit = task_set_.units[u];
    const CompiledTask &first = task_set_.tasks[unit.tasks.front()];
    // A timer's job becomes ready before the next release that is not refused is seen, or is skipped.
    if (!first.data) return add(first.replaced, unit.jitter);
    // Each job takes a datum of every predecessor, of which one can be from before the interval. The jobs that complete
    // in the interval became ready in it, were ready before, or had started.
    Duration least = kUnbounded;
    for (const std::uint32_t p : unit.awaits) {
      const CompiledTask &before = task_set_.tasks[p];
      if (before.period != unit.period) continue;
      const Unit &from = task_set_.units[before.unit];
      const Duration number = from.awaits.empty() ? from.jitter : std::max(from.jitter, jitter_of_number(before.unit));
      Duration unfinished = 0;
      for (const std::uint32_t t : from.tasks) {
        const CompiledTask &task = task_set_.tasks[t];
        unfinished = add(unfinished, std::max<Duration>(1, task.limit / task.period) + 1 + task.at_once);
      }
      least = std::min(least, add(number, multiply(unit.period, unfinished)));
    }
    return least;
  }

  // ---- the answer ----

  Outcome result() {
    const bool all = std::all_of(responses_.begin(), responses_.end(), [](const auto &r) { return r.has_value(); });
    if (task_set_.threads_suffice_if_bounded && !all) return nothing(kFewThreads);
    for (std::uint32_t t = 0; t < task_set_.tasks.size(); ++t) {
      if (conditional_[task_set_.tasks[t].dag.value] && !responses_[t]) return nothing(kBinds);
    }
    Bound bound = found_;
    for (std::uint32_t u = 0; u < task_set_.units.size(); ++u) {
      if (!task_set_.units[u].awaits.empty()) bound_tasks(u, bound);
    }
    ages_.resize(task_set_.units.size());
    for (std::uint32_t d = 0; d < task_set_.dags.size(); ++d) {
      const auto waits = [&](std::uint32_t u) { return !task_set_.units[u].awaits.empty(); };
      const std::vector<std::uint32_t> &units = task_set_.dags[d].units;
      if (std::none_of(units.begin(), units.end(), waits)) continue;
      bound.dags[d] = if_bounded(end_to_end(d));
      for (const std::uint32_t t : task_set_.dags[d].tasks) {
        if (!bound.tasks[t].response) continue;
        const Duration hop = oldest(t);
        if (hop < kUnbounded) bound.tasks[t].hop = hop;
      }
    }
    return bound;
  }

  [[nodiscard]] Bound nothing(std::string_view why) const {
    ResponseBound none;
    none.absent = why;
    return from_units(task_set_, std::vector<ResponseBound>(task_set_.units.size(), none));
  }

  // The longest time from the readiness of its unit's first task to the end of the task. Further timers of the unit can
  // be seen later than that task; the window then need not have begun at its readiness.
  [[nodiscard]] Duration from_ready(std::uint32_t t) const {
    const ResponseBound &bound = found_.tasks[t];
    const std::uint32_t u = task_set_.tasks[t].unit;
    const std::vector<std::uint32_t> &tasks = task_set_.units[u].tasks;
    const bool is_seen_later = std::any_of(tasks.begin() + 1, tasks.end(), [&](std::uint32_t other) {
      return !task_set_.tasks[other].data && task_set_.tasks[other].jitter > 0;
    });
    if (is_seen_later) return *bound.response;
    // A timer's jitter also counts the time that the machine can take during the response.
    return add(std::max(bound.from_ready, *bound.response - alone_.units[u].jitter), task_set_.frozen);
  }

  // Returns the task's bound for the given `response`: one Wait term replaces the jitter and covers the time before
  // readiness.
  [[nodiscard]] ResponseBound with_wait(std::uint32_t t, Duration response) const {
    ResponseBound bound = found_.tasks[t];
    const std::uint32_t u = task_set_.tasks[t].unit;
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
        task = if_bounded(with_wait(t, task_set_.tasks[t].data ? from_ready(t) : *task.response));
      }
    }
  }

  // How long before its grid point the data of a unit's job can have been released. Of a unit that joins clocks: how
  // long before it became ready.
  Duration age_of(std::uint32_t u) {
    if (ages_[u]) return *ages_[u];
    Duration age = 0;
    for (const std::uint32_t p : task_set_.units[u].awaits) {
      Duration since = 0;
      if (joins_clocks(u)) {
        since = std::min(oldest(p), add(at_most_after(p), longest_other(u, p)));
      } else if (!is_released_with(task_set_.tasks[p], first_of(u))) {
        since = oldest(p);
      }
      age = std::max(age, add(age_of(task_set_.tasks[p].unit), since));
    }
    ages_[u] = age;
    return age;
  }

  // The longest time from the point that age_of() counts to, to the end of the task.
  [[nodiscard]] Duration at_most_after(std::uint32_t t) const {
    return joins_clocks(task_set_.tasks[t].unit) ? from_ready(t) : *responses_[t];
  }

  // A datum that is taken waits for data of the other predecessors, for the next of each at most.
  Duration longest_other(std::uint32_t u, std::uint32_t predecessor) {
    Duration longest = 0;
    for (const std::uint32_t p : task_set_.units[u].awaits) {
      if (p != predecessor) longest = std::max(longest, gap_of(p));
    }
    return longest;
  }

  // The greatest age of a predecessor's latest datum. The next one arrives later, or at the same instant after it.
  Duration oldest(std::uint32_t t) { return joins_clocks(task_set_.tasks[t].unit) ? gap_of(t) : add(gap_of(t), 1); }

  ResponseBound end_to_end(std::uint32_t dag) {
    ResponseBound worst;
    for (const std::uint32_t t : task_set_.dags[dag].tasks) {
      const std::uint32_t u = task_set_.tasks[t].unit;
      if (!responses_[t]) {
        worst = ResponseBound{};
        worst.absent = absent_[u].empty() ? found_.tasks[t].absent : absent_[u];
        return worst;
      }
      ResponseBound bound = found_.tasks[t];
      if (!task_set_.units[u].awaits.empty()) {
        const Duration response = since_origin(t);
        if (response >= kUnbounded) {
          worst = ResponseBound{};
          worst.absent = kNoAge;
          return worst;
        }
        bound = with_wait(t, response);
      }
      if (!worst.response || *bound.response > *worst.response) worst = bound;
    }
    return worst;
  }

  // From the release of the earliest data behind a job of the task to its end.
  Duration since_origin(std::uint32_t t) {
    const std::uint32_t u = task_set_.tasks[t].unit;
    if (joins_clocks(u)) return add(from_ready(t), age_of(u));
    Duration longest = 0;
    for (const std::uint32_t p : task_set_.units[u].awaits) {
      const bool is_on_grid = is_released_with(task_set_.tasks[p], first_of(u));
      const Duration since_data = is_on_grid ? *responses_[t] : add(from_ready(t), oldest(p));
      longest = std::max(longest, add(since_data, age_of(task_set_.tasks[p].unit)));
    }
    return longest;
  }

  const TaskSet &task_set_;
  TaskSet alone_;  // without rate edges; the jitter of a waiting unit includes its wait
  Outcome (*apply_)(const TaskSet &);
  std::vector<bool> conditional_;                   // by DagId: its max_active was removed
  std::vector<std::optional<Duration>> responses_;  // by TaskId
  std::vector<std::string_view> absent_;            // by unit: why it has no wait
  std::vector<std::optional<Duration>> ages_;       // by unit
  std::vector<std::optional<Duration>> gaps_;       // by TaskId; of the latest round
  Bound found_;
};

bool shares_max_active(const TaskSet &task_set) {
  return std::any_of(task_set.dags.begin(), task_set.dags.end(),
                     [](const CompiledDag &dag) { return dag.max_active > 0 && dag.units.size() > 1; });
}

}  // namespace

std::optional<std::string> why_not_directly(const TaskSet &task_set) {
  if (task_set.has_rate_edges()) return "edges join tasks that are not released together: see the bounds for DAGs";
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
