// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/many_workers/by_demand.hpp"

#include <algorithm>
#include <numeric>
#include <utility>

#include "redag/sched/policy.hpp"
#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/effort.hpp"
#include "redag_analysis/many_workers/fixed_point.hpp"

namespace redag::analysis {
namespace {

constexpr std::string_view kDemandExceeds = "the demand of all that can go first exceeds the workers";
constexpr std::string_view kWaitsForData =
    "jobs of a predecessor can be lost, and nothing bounds the time until the next";
constexpr std::string_view kLosesData = "a job of it can be lost, and its data with it";
constexpr int kMostQueued = 10'000;  // jobs of a task in one busy period

// At most (window + jitter) / period + more events in any closed window.
struct JobCount {
  Duration period = 1;
  Duration jitter = 0;
  Duration more = 0;

  [[nodiscard]] Duration in(Duration window) const { return add(add(window, jitter) / period, more); }
  // The earliest window that can contain this many.
  [[nodiscard]] Duration earliest(Duration number) const {
    return std::max<Duration>(0, saturate(Int128{number - more} * period - jitter));
  }
};

bool is_rarer(const JobCount &a, const JobCount &b) {
  if (a.period != b.period) return a.period > b.period;
  return a.in(a.period) < b.in(b.period);
}

class DemandBounds {
 public:
  explicit DemandBounds(const TaskSet &task_set)
      : task_set_(task_set),
        released_(task_set.tasks.size()),
        since_(task_set.tasks.size()),
        until_(task_set.tasks.size()),
        bounds_(task_set.tasks.size()) {
    std::vector<bool> known(task_set.tasks.size(), false);
    for (std::uint32_t t = 0; t < task_set.tasks.size(); ++t) count_releases(t, known);
    const std::uint32_t threads = task_set.platform.max_started;
    few_threads_ = task_set.mode == sched::Preemption::Full && threads > 0 && threads < most_started();
    has_order_ = is_static(task_set.policy);
    for (const CompiledTask &task : task_set.tasks) stop_ = std::max(stop_, multiply(task.period, 64));
    has_waits_ =
        std::any_of(task_set.tasks.begin(), task_set.tasks.end(), [](const auto &t) { return t.wake_ups > 0; });
  }

  Bound run() {
    // What is found of the more urgent tasks makes the others' bounds smaller.
    for (const int sweep : {0, 1}) {
      bool changed = false;
      for (const std::uint32_t t : task_set_.by_rank) {
        const std::optional<Duration> before = since_[t];
        bound(t);
        changed = changed || since_[t] != before;
      }
      for (std::uint32_t t = 0; t < until_.size(); ++t) {
        if (waits_for_data(t)) until_[t] = until_ready(t);
      }
      if (sweep == 0 && (!changed || task_set_.platform.workers == 1)) break;
    }
    return assemble();
  }

 private:
  // What can delay a job of the task.
  struct Rivals {
    std::vector<bool> first;     // by TaskId: its jobs can go first
    std::vector<bool> lifted;    // less urgent holders of groups of those
    std::vector<bool> held_for;  // those for which the task can wait while workers are idle: the rest of its group
    std::vector<bool> fills;     // the rest of its DAG, if a max_active can bind
    bool all = false;
    bool finds_one = false;    // of less urgent holders of its group, it waits for one
    Duration cap = 0;          // the max_active of its DAG
    bool fills_apart = false;  // while its DAG is full, workers can be idle
    Duration blocking = 0;     // the longest stretches of the others, one on each worker
    std::uint32_t divisor = 1;
  };

  [[nodiscard]] const CompiledTask &task(std::uint32_t t) const { return task_set_.tasks[t]; }
  [[nodiscard]] Duration executes(std::uint32_t t) const { return task(t).wcet - task(t).waits; }
  // Its waits, without the time in queues.
  [[nodiscard]] Duration away(std::uint32_t t) const {
    Duration sum = task(t).elsewhere;
    for (const DeviceUse &use : task(t).devices) sum = add(sum, use.service);
    return sum;
  }
  [[nodiscard]] bool uses(std::uint32_t t, std::size_t device) const {
    return device < task(t).devices.size() && task(t).devices[device].requests > 0;
  }
  [[nodiscard]] bool waits_for_data(std::uint32_t t) const { return !task(t).data && !task(t).predecessors.empty(); }
  // The longest time from a timer's release to its readiness, if something bounds it. Timers keep their periods where
  // edges join rates: the next release that is not refused then ends the wait. Otherwise the predecessors have the same
  // releases, and only jobs of these serve.
  [[nodiscard]] std::optional<Duration> until_ready(std::uint32_t t) const {
    const std::vector<std::uint32_t> &units = task_set_.dags[task(t).dag.value].units;
    if (std::any_of(units.begin(), units.end(), [this](auto u) { return !task_set_.units[u].awaits.empty(); })) {
      return add(task(t).replaced, task(t).jitter);
    }
    Duration latest = task(t).jitter;
    for (const std::uint32_t p : task(t).predecessors) {
      const std::optional<Duration> before = task(p).data ? std::nullopt : from_release(p);
      if (!before) return std::nullopt;
      latest = std::max(latest, *before);
    }
    return latest;
  }
  // The bound from the task's nominal release.
  [[nodiscard]] std::optional<Duration> from_release(std::uint32_t t) const {
    if (!since_[t]) return std::nullopt;
    if (task(t).data) return add(*since_[t], task_set_.frozen);
    const std::optional<Duration> ready = until_ready(t);
    return ready ? std::optional(add(*since_[t], *ready)) : std::nullopt;
  }
  [[nodiscard]] std::uint32_t place(std::uint32_t t) const {
    return task_set_.mode == sched::Preemption::None ? task(t).tier : task(t).level;
  }
  [[nodiscard]] bool is_capped(std::uint32_t t) const { return task_set_.dags[task(t).dag.value].max_active > 0; }

  // ---- how many jobs there are ----

  // The most jobs that are started and unfinished at once.
  [[nodiscard]] std::uint64_t most_started() const {
    std::uint64_t sum = 0;
    for (const CompiledDag &dag : task_set_.dags) {
      std::uint64_t most = 0;
      std::vector<std::uint32_t> groups;
      for (const std::uint32_t t : dag.tasks) {
        const std::uint32_t group = task(t).group;
        const bool is_counted = group != kNoGroup && std::find(groups.begin(), groups.end(), group) != groups.end();
        if (group != kNoGroup) groups.push_back(group);
        most += is_counted ? 0 : task(t).at_once;
      }
      sum += dag.max_active > 0 ? std::min<std::uint64_t>(most, dag.max_active) : most;
    }
    return sum;
  }

  // Jobs that have started, that are ready, and one that waits for data.
  [[nodiscard]] Duration unfinished(std::uint32_t t) const {
    const Duration queued = std::max<Duration>(1, task(t).limit / task(t).period);
    return task(t).at_once + queued + (waits_for_data(t) ? 1 : 0);
  }

  // A data task has no more releases than a predecessor has ends, and one for an end that came before.
  void count_releases(std::uint32_t t, std::vector<bool> &known) {
    if (known[t]) return;
    known[t] = true;
    released_[t] = JobCount{task(t).period, task(t).jitter, 1};
    if (!task(t).data) return;
    std::optional<JobCount> least;
    for (const std::uint32_t p : task(t).predecessors) {
      count_releases(p, known);
      JobCount ends = released_[p];
      ends.more = add(ends.more, unfinished(p) + (task(t).predecessors.size() > 1 ? 1 : 0));
      if (!least || is_rarer(ends, *least)) least = ends;
    }
    if (least) released_[t] = *least;
  }

  // The most jobs of the task that execute or wait in the window. The last one is released before it ends, and the
  // first one ends after it begins.
  [[nodiscard]] Duration active(std::uint32_t t, Duration window) const {
    const Duration all = add(released_[t].in(window - 1), unfinished(t));
    if (!since_[t] || (waits_for_data(t) && !until_[t])) return all;
    const Duration since = add(*since_[t], until_[t].value_or(0));
    return std::min(all, released_[t].in(std::max<Duration>(0, add(window, since) - 2)));
  }

  // ---- who can go first ----

  // `all`: as if every task could go first. `closed`: nothing less urgent fills a DAG of these, or lies under others.
  [[nodiscard]] Rivals rivals_of(std::uint32_t t, bool all, bool closed) const {
    Rivals rivals;
    for (std::vector<bool> *marks : {&rivals.held_for, &rivals.fills, &rivals.lifted}) {
      marks->assign(task_set_.tasks.size(), false);
    }
    rivals.cap = task_set_.dags[task(t).dag.value].max_active;
    rivals.divisor = task_set_.platform.workers;
    const bool is_ordered = has_order_ && !few_threads_ && !task(t).can_sink;
    rivals.all = all || !is_ordered;
    // Whoever is less urgent takes a group only if the task does not wait for it.
    rivals.finds_one = is_ordered && rivals.cap == 0;
    std::uint32_t last = place(t);
    const auto include = [&](const std::vector<std::uint32_t> &tasks) {
      const bool is_asked = std::any_of(tasks.begin(), tasks.end(),
                                        [&](std::uint32_t o) { return o == t || (closed && place(o) <= last); });
      const std::uint32_t before = last;
      for (const std::uint32_t o : tasks) last = std::max(last, is_asked ? place(o) : 0);
      return last != before;
    };
    for (bool changed = true; changed;) {
      changed = false;
      for (const CompiledDag &dag : task_set_.dags) changed = (dag.max_active > 0 && include(dag.tasks)) || changed;
      // The holder has the urgency of those that wait, but one that lies under others stays there.
      if (task_set_.mode != sched::Preemption::Cooperative) continue;
      for (const std::vector<std::uint32_t> &group : task_set_.groups) changed = include(group) || changed;
    }
    for (std::uint32_t o = 0; o < task_set_.tasks.size(); ++o) {
      rivals.held_for[o] = o != t && task(o).group != kNoGroup && task(o).group == task(t).group;
      rivals.fills[o] = o != t && rivals.cap > 0 && task(o).dag == task(t).dag;
      // What fills a DAG can be demoted below everything else.
      const bool fills_some = rivals.fills[o] || (closed && is_capped(o) && place(o) <= last);
      rivals.all = rivals.all || (fills_some && task(o).can_sink);
    }
    close(last, rivals);
    return rivals;
  }

  // All tasks down to this place. Groups lift their holders above it.
  void close(std::uint32_t last, Rivals &rivals) const {
    const std::size_t count = task_set_.tasks.size();
    rivals.first.assign(count, rivals.all);
    Effort::spend(count);
    for (std::uint32_t other = 0; other < count && !rivals.all; ++other) rivals.first[other] = place(other) <= last;
    for (const std::vector<std::uint32_t> &group : task_set_.groups) {
      const bool lifts = std::any_of(group.begin(), group.end(), [&](std::uint32_t o) { return rivals.first[o]; });
      for (const std::uint32_t o : group) rivals.lifted[o] = lifts && !rivals.first[o];
    }
    if (task_set_.mode == sched::Preemption::Full) return;
    // On top of a demoted job that lies on another one, everything can run.
    const auto sinks = [&](std::uint32_t o) { return task(o).can_sink && (rivals.first[o] || rivals.lifted[o]); };
    for (std::uint32_t o = 0; o < count && task_set_.mode == sched::Preemption::Cooperative && !rivals.all; ++o) {
      if (!sinks(o)) continue;
      rivals.all = true;
      return close(last, rivals);
    }
    std::vector<Duration> stretches;
    for (std::uint32_t other = 0; other < count; ++other) {
      // A demoted job keeps its worker, too.
      if (rivals.first[other] && !(task(other).can_sink && !rivals.all)) continue;
      const Duration one = std::min(task(other).region, executes(other)) - 1;
      for (std::uint32_t i = 0; i < task(other).at_once && one > 0; ++i) stretches.push_back(one);
    }
    std::sort(stretches.begin(), stretches.end(), std::greater<>());
    stretches.resize(std::min<std::size_t>(stretches.size(), task_set_.platform.workers));
    for (const Duration one : stretches) rivals.blocking = add(rivals.blocking, one);
  }

  void bound(std::uint32_t t) {
    for (const bool all : {false, true}) {
      if (all && since_[t]) return;
      if (auto window = window_of(t, all)) take(t, *window);
      if (task_set_.platform.workers > 1) continue;
      if (auto window = busy_period_of(t, all)) take(t, *window);
    }
  }

  void take(std::uint32_t t, Duration window) {
    if (!since_[t] || window < since_[t]) since_[t] = window;
  }

  // ---- any number of workers ----

  // The time of a window in which the job waits for others.
  struct Window {
    Duration apart = 0;    // while a worker can be idle
    Duration workers = 0;  // while all workers are busy
  };

  // The longest time from the release of a job as seen, or from its readiness, to its end.
  std::optional<Duration> window_of(std::uint32_t t, bool all) {
    Rivals rivals = rivals_of(t, all, false);
    bool waits = false;
    for (std::uint32_t o = 0; o < task_set_.tasks.size(); ++o) {
      waits = waits || (rivals.fills[o] && task(o).wake_ups > 0);
      // A job can lie under others on its worker while further workers are idle.
      const bool can_lie = task(o).region < executes(o) || task(o).wake_ups > 0;
      const bool is_asked = o == t || rivals.held_for[o] || rivals.fills[o];
      if (task_set_.mode == sched::Preemption::Cooperative && is_asked && can_lie) rivals.divisor = 1;
    }
    rivals.fills_apart = rivals.cap > 0 && (rivals.cap < rivals.divisor || waits);
    const bool is_plain = !task(t).data && task(t).predecessors.empty();
    const Duration queued = std::max<Duration>(1, task(t).limit / task(t).period);
    for (const Duration earlier : {Duration{0}, task(t).at_once + queued - 1}) {
      if (earlier == 0 && (!is_plain || task(t).at_once > 1)) continue;
      const Duration whole = add(executes(t), away(t));
      const std::optional<Duration> one = fixed_point([&](Duration x) {
        const Window parts = evaluate(t, rivals, earlier, x);
        return add(multiply(whole, earlier + 1), add(parts.apart, parts.workers));
      });
      const std::optional<Duration> parts = earlier == 0 ? stretch_by_stretch(t, rivals) : std::nullopt;
      const Duration least = std::min(one.value_or(kUnbounded), parts.value_or(kUnbounded));
      // Without earlier jobs, the response has to end before the next release.
      if (least < kUnbounded && (earlier > 0 || add(least, task(t).jitter) <= task(t).period)) return least;
    }
    return std::nullopt;
  }

  template <class Next>
  [[nodiscard]] std::optional<Duration> fixed_point(Next next) const {
    Duration x = 1;
    return global::least_fixed_point(stop_, x, next) ? std::optional(x) : std::nullopt;
  }

  // A window for each stretch of execution and each request to a device. Others delay it only in these.
  [[nodiscard]] std::optional<Duration> stretch_by_stretch(std::uint32_t t, const Rivals &rivals) const {
    if (task(t).wake_ups == 0 || task(t).group != kNoGroup || is_capped(t) || few_threads_) return std::nullopt;
    Duration sum = task(t).elsewhere;
    for (const Duration stretch : task(t).stretches) {
      const auto found = fixed_point([&](Duration x) { return add(stretch, evaluate(t, rivals, 0, x).workers); });
      if (!found) return std::nullopt;
      sum = add(sum, *found);
    }
    for (std::size_t d = 0; d < task_set_.devices.size(); ++d) {
      if (!uses(t, d)) continue;
      const DeviceUse &use = task(t).devices[d];
      const auto found = fixed_point([&](Duration x) { return add(use.longest, queue_at(t, d, rivals, x)); });
      if (!found) return std::nullopt;
      sum = add(sum, multiply(*found, use.requests));
    }
    return sum;
  }

  // Each tick that others execute counts once: where it can delay the job the most.
  [[nodiscard]] Window evaluate(std::uint32_t t, const Rivals &rivals, Duration earlier, Duration x) const {
    const std::size_t count = task_set_.tasks.size();
    Effort::spend(count);
    Window window;
    const Duration together = std::min<Duration>(rivals.cap, rivals.divisor);
    Duration in_dag = 0;
    Duration epochs = multiply(1 + task(t).wake_ups, earlier + 1);
    Duration holder = 0;
    std::vector<std::pair<Duration, Duration>> rest;  // work, width
    for (std::uint32_t o = 0; o < count; ++o) {
      if (o == t) continue;
      const bool is_beside = rivals.held_for[o] || rivals.fills[o];
      if (!rivals.first[o] && !is_beside) continue;
      if (rivals.held_for[o] && rivals.finds_one && place(o) > place(t)) {
        holder = std::max(holder, multiply(add(executes(o), away(o)), earlier + 1));
        epochs = add(epochs, multiply(1 + task(o).wake_ups, earlier + 1));
        continue;
      }
      const Duration jobs = active(o, x);
      if (is_beside) epochs = add(epochs, multiply(jobs, 1 + task(o).wake_ups));
      const Duration waits = multiply(jobs, away(o));
      const Duration work = multiply(jobs, executes(o));
      if (rivals.held_for[o]) {
        window.apart = add(window.apart, add(work, waits));
      } else if (rivals.fills[o]) {
        in_dag = add(in_dag, add(waits, rivals.fills_apart ? work : 0));
      } else if (few_threads_) {
        window.apart = add(window.apart, waits);
      }
      if (rivals.held_for[o] || (rivals.fills[o] && rivals.fills_apart)) continue;
      rest.emplace_back(work, task(o).at_once);
    }
    window.apart = add(window.apart, holder);
    if (in_dag > 0) window.apart = add(window.apart, in_dag / together);
    for (const std::vector<std::uint32_t> &group : task_set_.groups) {
      const Duration work = lifted_work(
          group, rivals, [&](std::uint32_t o) { return active(o, x); },
          [&](std::uint32_t o) { return o == t ? 0 : executes(o); });
      if (work > 0) rest.emplace_back(work, 1);
    }
    for (std::size_t d = 0; d < task_set_.devices.size(); ++d) {
      window.apart = add(window.apart, queue_at(t, d, rivals, x));
    }
    if (rivals.blocking > 0) rest.emplace_back(multiply(rivals.blocking, epochs), rivals.divisor);
    // Where jobs of the DAG count for less than an instant each, other workers can execute the rest in that instant.
    window.workers = share(rest, rivals.divisor, rivals.fills_apart && together > 1);
    return window;
  }

  // What less urgent holders of the group do with the urgency of others: all that they can, or one job for each job
  // that waits for the group.
  template <class Jobs, class Cost>
  [[nodiscard]] Duration lifted_work(const std::vector<std::uint32_t> &group, const Rivals &rivals, Jobs jobs,
                                     Cost cost) const {
    Duration all = 0;
    Duration longest = 0;
    Duration waiters = 0;
    bool is_capped_member = false;
    for (const std::uint32_t o : group) {
      if (rivals.first[o]) {
        waiters = add(waiters, jobs(o));
        is_capped_member = is_capped_member || is_capped(o);
      } else if (rivals.lifted[o]) {
        all = add(all, multiply(jobs(o), cost(o)));
        longest = std::max(longest, cost(o));
      }
    }
    return is_capped_member ? all : std::min(all, multiply(waiters, longest));
  }

  // While a job is in the queue of a device, all its slots serve others.
  [[nodiscard]] Duration queue_at(std::uint32_t t, std::size_t device, const Rivals &rivals, Duration x) const {
    const std::uint32_t slots = task_set_.devices[device].slots;
    bool is_asked = uses(t, device);
    Duration served = 0;
    for (std::uint32_t o = 0; o < task_set_.tasks.size(); ++o) {
      if (o == t || !uses(o, device)) continue;
      is_asked = is_asked || rivals.held_for[o] || rivals.fills[o] || few_threads_;
      // What counts in full already does not count again.
      if (rivals.held_for[o] || (rivals.fills[o] && rivals.cap <= slots) || (few_threads_ && !rivals.fills[o]))
        continue;
      served = add(served, multiply(active(o, x), task(o).devices[device].service));
    }
    return is_asked ? served / slots : 0;
  }

  // The most instants y in which all workers execute this work: m y <= sum min(work, width y).
  // `is_mixed`: the others can execute something else.
  [[nodiscard]] static Duration share(const std::vector<std::pair<Duration, Duration>> &works, Duration workers,
                                      bool is_mixed) {
    Duration most = kUnbounded;
    for (int i = 0; i < (is_mixed ? 1 : 100); ++i) {
      Int128 sum = 0;
      for (const auto &[work, width] : works) sum += std::min(Int128{work}, Int128{width} * most);
      const Duration next = saturate(sum / workers);
      if (next >= most) break;
      most = next;
    }
    return most;
  }

  // ---- one worker: the busy period of a level ----

  // What becomes ready in a busy period of the level, in a closed window that begins with it.
  void count_begun(std::uint32_t t, const Rivals &level, std::vector<JobCount> &counts,
                   std::vector<bool> &known) const {
    if (known[t]) return;
    known[t] = true;
    counts[t] = released_[t];
    const bool stays = level.first[t] && (level.all || !task(t).can_sink);
    if (!stays) {
      // Its jobs can have been unfinished before the period began.
      counts[t].more = add(counts[t].more, unfinished(t));
    } else if (waits_for_data(t)) {
      // One can have been released before the period.
      counts[t].more = add(counts[t].more, 1);
    } else if (task(t).data) {
      std::optional<JobCount> least;
      for (const std::uint32_t p : task(t).predecessors) {
        count_begun(p, level, counts, known);
        JobCount ends = counts[p];
        if (task(t).predecessors.size() > 1) ends.more = add(ends.more, 1);
        if (!least || is_rarer(ends, *least)) least = ends;
      }
      if (least) counts[t] = *least;
    }
  }

  std::optional<Duration> busy_period_of(std::uint32_t t, bool all) {
    const Rivals level = rivals_of(t, all, true);
    const std::size_t count = task_set_.tasks.size();
    std::vector<JobCount> counts(count);
    std::vector<bool> known(count, false);
    std::vector<Duration> costs(count, 0);
    double load = 0;
    for (std::uint32_t o = 0; o < count; ++o) {
      count_begun(o, level, counts, known);
      costs[o] = add(add(executes(o), away(o)), multiply(level.blocking, task(o).wake_ups));
      if (level.first[o]) load += static_cast<double>(costs[o]) / static_cast<double>(counts[o].period);
    }
    if (load >= 1.0) return std::nullopt;
    const auto demand = [&](Duration window, Duration own_jobs) {
      Effort::spend(count);
      Duration sum = level.blocking;
      for (std::uint32_t o = 0; o < count; ++o) {
        if (!level.first[o]) continue;
        const Duration jobs = o == t && own_jobs > 0 ? own_jobs : counts[o].in(window - 1);
        sum = add(sum, multiply(jobs, costs[o]));
      }
      for (const std::vector<std::uint32_t> &group : task_set_.groups) {
        // While no job waits, none that is less urgent starts in the period: it contains one holder.
        const Duration most = has_waits_ ? kUnbounded : longest_lifted(group, level, costs);
        const Duration work = lifted_work(
            group, level, [&](std::uint32_t o) { return counts[o].in(window - 1); },
            [&](std::uint32_t o) { return costs[o]; });
        sum = add(sum, std::min(most, work));
      }
      for (std::size_t d = 0; d < task_set_.devices.size(); ++d) sum = add(sum, served_before(level, d, window));
      return sum;
    };
    Duration length = 1;
    if (!global::least_fixed_point(stop_, length, [&](Duration window) { return demand(window, 0); })) {
      return std::nullopt;
    }
    if (task(t).at_once > 1) return length;
    const Duration jobs = counts[t].in(length - 1);
    if (jobs > kMostQueued) return length;
    Duration longest = 0;
    Duration window = 1;
    for (Duration q = 0; q < jobs; ++q) {
      if (!global::least_fixed_point(stop_, window, [&](Duration w) { return demand(w, q + 1); })) return length;
      longest = std::max(longest, window - std::min(window, counts[t].earliest(q + 1)));
    }
    return longest;
  }

  [[nodiscard]] static Duration longest_lifted(const std::vector<std::uint32_t> &group, const Rivals &level,
                                               const std::vector<Duration> &costs) {
    Duration longest = 0;
    for (const std::uint32_t o : group) longest = std::max(longest, level.lifted[o] ? costs[o] - 1 : 0);
    return longest;
  }

  // Service of others than the level's tasks for which its jobs can wait in the queue of a device.
  [[nodiscard]] Duration served_before(const Rivals &level, std::size_t device, Duration window) const {
    Duration served = 0;
    bool is_asked = false;
    for (std::uint32_t o = 0; o < task_set_.tasks.size(); ++o) {
      if (!uses(o, device)) continue;
      if (level.first[o] || level.lifted[o]) {
        is_asked = true;
      } else {
        served = add(served, multiply(active(o, window), task(o).devices[device].service));
      }
    }
    return is_asked ? served : 0;
  }

  // ---- the answer ----

  Bound assemble() {
    // From the grid point of the unit: a task ends no later, if every instance before has ended.
    std::vector<std::optional<Duration>> from_grid(task_set_.tasks.size());
    std::vector<bool> is_lossless(task_set_.units.size(), true);
    for (std::uint32_t u = 0; u < task_set_.units.size(); ++u) {
      const Unit &unit = task_set_.units[u];
      is_lossless[u] = unit.awaits.empty();
      for (const std::uint32_t t : unit.tasks) {
        is_lossless[u] = is_lossless[u] && since_[t] && !task(t).can_lose;
        if (!is_lossless[u]) break;
        Duration ready = task(t).jitter;
        for (const std::uint32_t p : task(t).predecessors) ready = std::max(ready, *from_grid[p]);
        from_grid[t] = add(ready, *since_[t]);
        is_lossless[u] = *from_grid[t] <= unit.limit;
      }
    }
    for (std::uint32_t t = 0; t < task_set_.tasks.size(); ++t) {
      ResponseBound &bound = bounds_[t];
      if (!since_[t]) {
        bound.absent = kDemandExceeds;
        continue;
      }
      bound.of_ended = !is_lossless[task(t).unit];
      bound.response = task(t).data || bound.of_ended ? from_release(t) : from_grid[t];
      if (!bound.response) bound.absent = kWaitsForData;
      if (bound.response && Effort::itemises(task(t).unit)) bound.terms = terms_of(t, *bound.response - *since_[t]);
    }
    Bound bound;
    for (ResponseBound &one : bounds_) bound.tasks.push_back(if_bounded(std::move(one)));
    for (const CompiledDag &dag : task_set_.dags) {
      ResponseBound whole;
      whole.response = 0;
      for (const std::uint32_t t : dag.tasks) {
        if (!whole.response || !is_lossless[task(t).unit]) {
          whole = ResponseBound{};
          whole.absent = since_[t] ? kLosesData : kDemandExceeds;
        } else if (*from_grid[t] >= *whole.response) {
          whole.response = *from_grid[t];
          whole.terms = bound.tasks[t].terms;
          const Duration before = *from_grid[t] - *bound.tasks[t].response;
          if (before != 0 && !whole.terms.empty()) {
            whole.terms.push_back(Term{Term::Kind::Wait, {}, task(t).dag, before, 0});
          }
        }
      }
      bound.dags.push_back(if_bounded(std::move(whole)));
    }
    return bound;
  }

  [[nodiscard]] std::vector<Term> terms_of(std::uint32_t t, Duration late) const {
    const Duration own = std::min(*since_[t], executes(t) - task(t).overhead);
    const DagId dag = task(t).dag;
    std::vector<Term> terms = {Term{Term::Kind::Own, TaskId(t), dag, own, 1},
                               Term{Term::Kind::Interference, {}, {}, *since_[t] - own, 0}};
    if (late > 0) terms.push_back(Term{waits_for_data(t) ? Term::Kind::Wait : Term::Kind::Jitter, {}, dag, late, 0});
    return terms;
  }

  const TaskSet &task_set_;
  bool has_order_ = false;
  bool few_threads_ = false;
  bool has_waits_ = false;
  Duration stop_ = 0;                           // longer windows count as none
  std::vector<JobCount> released_;              // by TaskId
  std::vector<std::optional<Duration>> since_;  // by TaskId: from the release as seen, or from readiness, to the end
  std::vector<std::optional<Duration>> until_;  // by TaskId: of timers that wait for data, until_ready()
  std::vector<ResponseBound> bounds_;
};

Outcome apply_by_demand(const TaskSet &task_set) {
  if (!task_set.groups.empty() && task_set.platform.preempt_overhead > 0) {
    return NotApplicable{"groups cannot be combined with an overhead of preemption"};
  }
  if (!task_set.groups.empty() && task_set.several_executors) {
    return NotApplicable{"groups of several executors on one processor: a holder need not run for those that wait"};
  }
  return DemandBounds(task_set).run();
}

}  // namespace

Method by_demand() {
  return Method{
      .name = "by_demand",
      .subject = Subject::Task,
      .cite = "docs/analysis.md, \"Any features\"",
      .assumptions = "any workers, policy, preemption and features; groups without an overhead of preemption",
      .complexity = "pseudo-polynomial; O(tasks) per step, for each task",
      .knows_modes = true,
      .knows_waits = true,
      .knows_all = true,
      .apply = apply_by_demand,
  };
}

}  // namespace redag::analysis
