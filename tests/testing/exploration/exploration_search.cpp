// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// explore() searches breadth first, with a level for each number of dispatched jobs.
//
// Jobs. It covers all jobs from time 0 on: the initial offsets, then hyperperiod after hyperperiod. States that lie
// within a followed state of an earlier hyperperiod continue as that one did, and are dropped. The search ends when no
// state is left. It ends early (Overrun) where a job can end after its unit's next release, because jobs would be
// skipped there. Without an overrun, neither the overrun rule nor `concurrency` matters, and job k of a task takes the
// data of job k of its predecessors.
//
// States. A node is the number of dispatched jobs of each task. A state of a node is a row of intervals: when the x-th
// worker is free, when the places of each max_active below m and of each group are free, and when the last job of each
// task ended that successors wait for. With one worker its own interval is enough: when it is free, every job has
// ended.
//
// Step. The candidates are each task's next job, if all its predecessors' jobs have been dispatched. Let E be the
// interval in which a candidate becomes eligible, and A_x the interval of the x-th worker. A candidate can be the next
// to start at t only if: (1) t >= max(A_1, E), earliest ends; (2) t <= max(A_1, least E), latest ends, because no
// worker idles from then on; (3) t < the latest end of E of every more urgent candidate. A job's turn among equals is
// the nominal release of its unit, so the order is known in every state. The job ends in [t + bcet, t + wcet]. For (3),
// the ends that the candidate or a started job also waited for do not count, nor does a job that surely ends before A_2
// begins. For (2) they count, because it bounds t from the last start.
//
// One worker: exact. By induction, every instant at which the worker becomes free is reached, whatever the later
// releases are: within the worker's interval take its end as t, otherwise let the candidate's release be seen at t.
// Several workers: safe. Intervals forget that a worker and its job's successor become free at one instant, and merging
// unites rows. Ranges can be too wide, never too narrow.
#include <algorithm>
#include <limits>

#include "redag/base/check.hpp"
#include "tests/testing/exploration/exploration.hpp"
#include "tests/testing/exploration/exploration_model.hpp"
#include "tests/testing/exploration/exploration_states.hpp"

namespace redag::analysis {
namespace {

constexpr std::uint32_t kNone = 0xffffffff;
constexpr Interval kForgotten{std::numeric_limits<Time>::min(), std::numeric_limits<Time>::min()};

const ExploredTask kAlone;

template <class Value>
bool contains(const std::vector<Value> &values, const Value &value) {
  return std::find(values.begin(), values.end(), value) != values.end();
}

class Explorer {
 public:
  Explorer(const TaskSet &task_set, std::uint64_t max_states)
      : task_set_(task_set),
        max_states_(max_states),
        model_(exploration_model(task_set, max_states)),
        workers_(model_.workers),
        tasks_(model_.tasks) {
    result_.hyperperiod = model_.hyperperiod;
    result_.jobs = model_.jobs;
    result_.exact = workers_ == 1;
    for (const ExploredTask &task : tasks_) result_.responses.emplace_back(task.jobs);
  }

  Exploration run() {
    if (result_.jobs > max_states_) return std::move(result_);
    StateSet now(tasks_.size(), model_.width, workers_);
    StateSet next = now;
    StateSet seen = now;  // at the ends of hyperperiods
    start(now);
    seen = now;
    for (std::uint64_t level = 1;; ++level) {
      next.clear();
      next_earliest_.clear();
      for (std::uint32_t node = 0; node < now.size(); ++node) {
        if (!follow(now, node, next)) return std::move(result_);
      }
      if (level % result_.jobs == 0) {
        ++result_.hyperperiods;
        forget_covered(next, seen);
        if (!next.has_states()) break;
      }
      std::swap(now, next);
    }
    result_.end = Exploration::End::Complete;
    return std::move(result_);
  }

 private:
  // The next job of a task whose predecessors' jobs have all been dispatched.
  struct Candidate {
    std::uint32_t task = 0;
    std::uint32_t number = 0;
    Time nominal = 0;
    Interval ready;            // considering its release alone
    bool waits = false;        // also for predecessors or gates: `ready` depends on the state
    std::int64_t urgency = 0;  // tier, or absolute deadline (edf); equals take turns
    std::uint32_t rank = 0;
  };

  void start(StateSet &states) {
    counts_.assign(tasks_.size(), 0);
    row_.assign(model_.width, Interval{0, 0});
    for (const ExploredTask &task : tasks_) {
      if (task.finish != kNowhere) row_[task.finish] = kForgotten;
    }
    raise(earliest_release(), row_);
    states.add(states.find_or_add(counts_, 0), row_);
    ++result_.states;
  }

  [[nodiscard]] bool is_candidate(std::uint32_t t) const {
    for (const std::uint32_t p : tasks_[t].predecessors) {
      if (counts_[p] <= counts_[t]) return false;
    }
    return true;
  }

  // No job that can follow `counts_` is dispatched before this time.
  [[nodiscard]] Time earliest_release() const {
    Time earliest = kNever;
    for (std::uint32_t t = 0; t < tasks_.size(); ++t) {
      const Time nominal = tasks_[t].offset + counts_[t] * tasks_[t].period;
      if (nominal < earliest && is_candidate(t)) earliest = nominal;
    }
    return earliest;
  }

  // Moves what happens before `time` to `time`. No decision is taken in between.
  static void raise(Time time, std::vector<Interval> &row) {
    for (Interval &interval : row) {
      if (interval == kForgotten) continue;
      interval.earliest = std::max(interval.earliest, time);
      interval.latest = std::max(interval.latest, time);
    }
  }

  // Follows the schedules of a node in all ways in which they can continue. Returns false if the exploration ends.
  bool follow(const StateSet &states, std::uint32_t node, StateSet &next) {
    const auto counts = states.counts(node);
    counts_.assign(counts.begin(), counts.end());
    find_candidates();
    children_.assign(candidates_.size(), kNone);
    bool goes_on = true;
    states.for_each(
        node, [&](std::span<const Interval> state) { goes_on = goes_on && dispatch(states.hash(node), state, next); });
    return goes_on;
  }

  // Sorts most urgent first; among equals, timers are in the order of their turns.
  void find_candidates() {
    candidates_.clear();
    for (const std::uint32_t t : task_set_.by_rank) {
      if (!is_candidate(t)) continue;
      const ExploredTask &task = tasks_[t];
      Candidate candidate;
      candidate.task = t;
      candidate.number = counts_[t];
      candidate.nominal = task.offset + candidate.number * task.period;
      candidate.ready = {candidate.nominal, candidate.nominal + task.jitter};
      candidate.waits = workers_ > 1 && !(task.predecessors.empty() && task.gates.empty());
      const CompiledTask &compiled = task_set_.tasks[t];
      const bool is_edf = task_set_.policy == PolicyKind::Edf;
      candidate.urgency = is_edf ? candidate.nominal + task.deadline : compiled.tier;
      candidate.rank = compiled.rank;
      candidates_.push_back(candidate);
    }
    // A job's turn is the nominal release of its unit, the origin of its data.
    const bool take_turns = task_set_.ties == Ties::Share;
    std::sort(candidates_.begin(), candidates_.end(), [take_turns](const Candidate &a, const Candidate &b) {
      if (a.urgency != b.urgency) return a.urgency < b.urgency;
      if (take_turns && a.nominal != b.nominal) return a.nominal < b.nominal;
      return a.rank < b.rank;
    });
    ready_.resize(candidates_.size());
    starved_ = 0;
    for (std::size_t c = 0; c < candidates_.size(); ++c) {
      ready_[c] = candidates_[c].ready;
      if (latest_start(candidates_[c]) < latest_start(candidates_[starved_])) starved_ = c;
    }
  }

  // The latest start with which the job need not end after the next release.
  [[nodiscard]] Time latest_start(const Candidate &candidate) const {
    const ExploredTask &task = tasks_[candidate.task];
    return candidate.nominal + task.period - task.bcet;
  }

  bool overrun(std::uint32_t task) {
    result_.end = Exploration::End::Overrun;
    result_.late = TaskId(task);
    return false;
  }

  // When the candidate is eligible, regardless of the workers.
  [[nodiscard]] Interval eligible(const Candidate &candidate, std::span<const Interval> state) const {
    const ExploredTask &task = tasks_[candidate.task];
    Interval result = candidate.ready;
    const auto wait_for = [&](const Interval &end) {
      result.earliest = std::max(result.earliest, end.earliest);
      result.latest = std::max(result.latest, end.latest);
    };
    for (const std::uint32_t p : task.predecessors) wait_for(state[tasks_[p].finish]);
    for (const Gate &gate : task.gates) wait_for(state[gate.first]);
    return result;
  }

  // The time from which the candidate is certainly eligible, if a worker is free and `other` is eligible. Conditions
  // that have ended by then do not count. These are the ones that a started job, or `other`, also waited for.
  // Conditions that end before two workers can be free do not count either: they ended before the last start, or leave
  // the worker that is free first.
  [[nodiscard]] Time eligible_beside(const Candidate &candidate, const ExploredTask &other,
                                     std::span<const Interval> state) const {
    const ExploredTask &task = tasks_[candidate.task];
    Time result = candidate.ready.latest;
    const auto wait_for = [&](const Interval &end) {
      if (end.latest >= state[1].earliest) result = std::max(result, end.latest);
    };
    for (const std::uint32_t p : task.predecessors) {
      if (!has_ended(p) && !contains(other.predecessors, p)) wait_for(state[tasks_[p].finish]);
    }
    for (const Gate &gate : task.gates) {
      if (!contains(other.gates, gate)) wait_for(state[gate.first]);
    }
    return result;
  }

  // The latest start of the candidate at which every more urgent one can still lack something that it waits for.
  [[nodiscard]] Time before_more_urgent(std::size_t c, std::span<const Interval> state) const {
    const ExploredTask &task = tasks_[candidates_[c].task];
    Time until = kNever;
    for (std::size_t x = 0; x < c; ++x) {
      const Candidate &other = candidates_[x];
      until = std::min(until, other.waits ? eligible_beside(other, task, state) : other.ready.latest);
    }
    return until - 1;
  }

  [[nodiscard]] bool has_ended(std::uint32_t t) const {
    const auto &successors = tasks_[t].successors;
    return std::any_of(successors.begin(), successors.end(), [&](std::uint32_t s) { return counts_[s] == counts_[t]; });
  }

  // Determines which candidates can start next, and when. A worker must be free and the job eligible. The start is not
  // after an instant at which a worker is certainly free and some job certainly eligible (work conserving). It is
  // before any more urgent job is certainly eligible (priority).
  bool dispatch(std::uint64_t hash, std::span<const Interval> state, StateSet &next) {
    Time surely_eligible = kNever;
    for (std::size_t c = 0; c < candidates_.size(); ++c) {
      if (candidates_[c].waits) ready_[c] = eligible(candidates_[c], state);
      surely_eligible = std::min(surely_eligible, ready_[c].latest);
    }
    // A job that waits forever is never dispatched. It is late as soon as the others leave it no time.
    if (state[0].earliest > latest_start(candidates_[starved_])) return overrun(candidates_[starved_].task);
    const Time work_conserving = std::max(state[0].latest, surely_eligible);
    Time more_urgent = kNever;  // from then on one of them is certainly eligible
    for (std::size_t c = 0; c < candidates_.size() && more_urgent > state[0].earliest; ++c) {
      const Candidate &candidate = candidates_[c];
      const Time earliest = std::max(state[0].earliest, ready_[c].earliest);
      Time latest = std::min(work_conserving, more_urgent - 1);
      if (candidate.waits && earliest <= latest) latest = std::min(latest, before_more_urgent(c, state));
      if (earliest <= latest && !begin(c, {earliest, latest}, hash, state, next)) return false;
      more_urgent = std::min(more_urgent, surely_eligible_at(c, state));
    }
    return true;
  }

  [[nodiscard]] Time surely_eligible_at(std::size_t c, std::span<const Interval> state) const {
    const Candidate &candidate = candidates_[c];
    return candidate.waits ? eligible_beside(candidate, kAlone, state) : candidate.ready.latest;
  }

  bool begin(std::size_t c, Interval start, std::uint64_t hash, std::span<const Interval> state, StateSet &next) {
    const Candidate &candidate = candidates_[c];
    const ExploredTask &task = tasks_[candidate.task];
    const Interval finish{start.earliest + task.bcet, start.latest + task.wcet};
    ResponseRange &range = result_.responses[candidate.task][candidate.number % task.jobs];
    range.best = std::min(range.best, finish.earliest - candidate.nominal);
    range.worst = std::max(range.worst, finish.latest - candidate.nominal);
    if (finish.latest - candidate.nominal > task.period) return overrun(candidate.task);

    // No job starts before this one.
    row_.assign(state.begin(), state.end());
    raise(start.earliest, row_);
    take(Gate{0, workers_}, finish);
    for (const Gate &gate : task.gates) take(gate, finish);
    ++counts_[candidate.task];
    if (workers_ > 1) remember(candidate.task, start, finish);
    const std::uint32_t child = child_of(c, hash, next);
    raise(next_earliest_[child], row_);
    --counts_[candidate.task];

    if (!next.add(child, row_)) {
      ++result_.merged;
      return true;
    }
    if (result_.states == max_states_) return false;
    ++result_.states;
    return true;
  }

  // The job takes the first place that is free, and returns it when it ends.
  void take(const Gate &gate, Interval finish) {
    Interval *places = row_.data() + gate.first;
    std::uint32_t at = 0;
    for (; at + 1 < gate.places && places[at + 1].earliest < finish.earliest; ++at) {
      places[at].earliest = places[at + 1].earliest;
    }
    places[at].earliest = finish.earliest;
    for (at = 0; at + 1 < gate.places && places[at + 1].latest < finish.latest; ++at) {
      places[at].latest = places[at + 1].latest;
    }
    places[at].latest = finish.latest;
  }

  // The end of a job counts until its successors have started. When the first of them starts, the job has ended.
  void remember(std::uint32_t t, Interval start, Interval finish) {
    const ExploredTask &task = tasks_[t];
    if (task.finish != kNowhere) row_[task.finish] = finish;
    for (const std::uint32_t p : task.predecessors) {
      const auto &successors = tasks_[p].successors;
      const bool used =
          std::all_of(successors.begin(), successors.end(), [&](std::uint32_t s) { return counts_[s] == counts_[p]; });
      Interval &end = row_[tasks_[p].finish];
      end = used ? kForgotten : Interval{end.earliest, std::min(end.latest, start.latest)};
    }
  }

  // Returns the node that `counts_` leads to. Once all tasks are a hyperperiod further, time starts again.
  std::uint32_t child_of(std::size_t c, std::uint64_t hash, StateSet &next) {
    const std::uint32_t t = candidates_[c].task;
    const bool wraps = counts_[t] == tasks_[t].jobs && is_round_over();
    if (wraps) {
      for (Interval &interval : row_) {
        if (interval == kForgotten) continue;
        interval.earliest -= result_.hyperperiod;
        interval.latest -= result_.hyperperiod;
      }
    }
    if (children_[c] != kNone) return children_[c];
    std::uint64_t child_hash = hash + tasks_[t].hash;
    saved_counts_ = counts_;
    if (wraps) {
      child_hash -= model_.round_hash;
      for (std::size_t i = 0; i < tasks_.size(); ++i) counts_[i] -= tasks_[i].jobs;
    }
    const std::uint32_t child = next.find_or_add(counts_, child_hash);
    if (child == next_earliest_.size()) next_earliest_.push_back(earliest_release());
    counts_ = saved_counts_;
    return children_[c] = child;
  }

  [[nodiscard]] bool is_round_over() const {
    for (std::size_t t = 0; t < tasks_.size(); ++t) {
      if (counts_[t] < tasks_[t].jobs) return false;
    }
    return true;
  }

  // Drops states that start a hyperperiod as an earlier one did, because they continue in the same way.
  static void forget_covered(StateSet &states, StateSet &seen) {
    states.remove_if([&](std::uint32_t node, std::span<const Interval> state) {
      return seen.covers(states.counts(node), states.hash(node), state);
    });
    for (std::uint32_t node = 0; node < states.size(); ++node) {
      const std::uint32_t same = seen.find_or_add(states.counts(node), states.hash(node));
      states.for_each(node, [&](std::span<const Interval> state) { seen.keep(same, state); });
    }
  }

  const TaskSet &task_set_;
  std::uint64_t max_states_;
  const ExplorationModel model_;
  const std::uint32_t workers_;
  const std::vector<ExploredTask> &tasks_;
  Exploration result_;

  // Data of the node that is followed, and of those that it leads to.
  std::vector<std::uint32_t> counts_;
  std::vector<std::uint32_t> saved_counts_;
  std::vector<Candidate> candidates_;
  std::vector<Interval> ready_;          // by candidate
  std::size_t starved_ = 0;              // the candidate that must start first
  std::vector<std::uint32_t> children_;  // by candidate: its node in the next set
  std::vector<Time> next_earliest_;      // by node of the next set
  std::vector<Interval> row_;
};

}  // namespace

Exploration explore(const TaskSet &task_set, std::uint64_t max_states) {
  REDAG_CHECK(!why_not_explore(task_set), "nothing to explore");
  return Explorer(task_set, max_states).run();
}

}  // namespace redag::analysis
