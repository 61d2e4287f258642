// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/one_worker/levels.hpp"

#include <algorithm>
#include <limits>
#include <map>
#include <numeric>
#include <utility>

#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/effort.hpp"

namespace redag::analysis::one_worker {

Levels::Levels(const TaskSet &task_set)
    : task_set_(task_set), counted_(task_set.tasks.size()), level_(task_set.tasks.size()) {
  for (const CompiledTask &task : task_set.tasks) tier_.push_back(task.tier);
  keep_units_whole();
  std::map<std::pair<Duration, Duration>, std::uint32_t> known;
  for (const Unit &unit : task_set.units) {
    find_counted(unit);
    find_level(unit);
    const auto next = static_cast<std::uint32_t>(classes_.size());
    const auto [found, is_new] = known.emplace(std::pair(unit.period, unit.ahead()), next);
    if (is_new) classes_.push_back(Interferer{0, unit.period, unit.ahead()});
    class_of_.push_back(found->second);
  }
  by_counted_ = task_set.by_rank;
  std::stable_sort(by_counted_.begin(), by_counted_.end(),
                   [this](std::uint32_t a, std::uint32_t b) { return counted_[a] < counted_[b]; });
  find_longest();
}

// A unit is not divided if its less urgent tasks can run, or hold back the others, while these are pending: where jobs
// wait without a worker, and where a max_active can be reached by jobs that others preempt.
bool Levels::is_whole(const Unit &unit) const {
  if (task_set_.mode != sched::Preemption::None && task_set_.dags[unit.dag.value].max_active > 0) return true;
  return task_set_.has_waits;
}

void Levels::keep_units_whole() {
  std::uint32_t tiers = 0;
  for (const std::uint32_t tier : tier_) tiers = std::max(tiers, tier + 1);
  std::vector<std::uint32_t> reach(tiers);
  std::iota(reach.begin(), reach.end(), 0);
  for (const Unit &unit : task_set_.units) {
    if (!is_whole(unit)) continue;
    std::uint32_t first = tiers;
    std::uint32_t last = 0;
    for (const std::uint32_t t : unit.tasks) {
      first = std::min(first, tier_[t]);
      last = std::max(last, tier_[t]);
    }
    for (const std::uint32_t t : unit.tasks) tier_[t] = last;
    reach[first] = std::max(reach[first], last);
  }
  for (std::uint32_t tier = 1; tier < tiers; ++tier) reach[tier] = std::max(reach[tier], reach[tier - 1]);
  closed_.resize(tiers);
  for (std::uint32_t tier = tiers; tier-- > 0;) closed_[tier] = reach[tier] == tier ? tier : closed_[tier + 1];
}

// A data task is released in a busy period only after some predecessor has ended in it. Less urgent ones do not run in
// it, so the task counts for each instance from the level on at which it and some path to it count.
void Levels::find_counted(const Unit &unit) {
  for (const std::uint32_t t : unit.tasks) {
    const CompiledTask &task = task_set_.tasks[t];
    std::uint32_t least = task.data && !task.predecessors.empty() ? std::numeric_limits<std::uint32_t>::max() : 0;
    for (const std::uint32_t p : task.predecessors) least = std::min(least, counted_[p]);
    counted_[t] = std::max(tier_[t], task.data ? least : 0);
  }
}

void Levels::find_level(const Unit &unit) {
  std::map<std::uint32_t, std::uint32_t> least;
  for (const std::uint32_t t : unit.tasks) {
    std::uint32_t tier = tier_[t];
    for (const std::uint32_t p : task_set_.tasks[t].predecessors) tier = std::max(tier, least[p]);
    least[t] = tier;
    level_[t] = closed_[tier];
  }
}

// True if some timers of an instance can be seen before others. Its first stages can then end before it is pending for
// good.
bool Levels::is_seen_apart(const Unit &unit) const {
  if (unit.jitter == 0) return false;
  return std::count_if(unit.tasks.begin(), unit.tasks.end(), [this](std::uint32_t t) {
           return !task_set_.tasks[t].data || task_set_.tasks[t].predecessors.empty();
         }) > 1;
}

// By position in the unit: the tasks that cannot begin before `task` ends. If instances can overlap, a task may begin
// with an earlier instance's data of one predecessor and new data of another: then only those count that nothing but
// `task` releases.
std::vector<bool> Levels::after(std::uint32_t task, bool in_order) const {
  const std::vector<std::uint32_t> &tasks = task_set_.units[task_set_.tasks[task].unit].tasks;
  std::map<std::uint32_t, bool> follows;
  std::vector<bool> result;
  for (const std::uint32_t t : tasks) {
    const CompiledTask &own = task_set_.tasks[t];
    const auto is_after = [&](std::uint32_t p) { return p == task || follows[p]; };
    const bool any = std::any_of(own.predecessors.begin(), own.predecessors.end(), is_after);
    const bool all = own.data && std::all_of(own.predecessors.begin(), own.predecessors.end(), is_after);
    follows[t] = any && (in_order || all);
    result.push_back(follows[t]);
  }
  return result;
}

std::vector<Stage> Levels::stages_of(std::uint32_t task, bool in_order) const {
  const Unit &unit = task_set_.units[task_set_.tasks[task].unit];
  const std::size_t count = unit.tasks.size();
  if (count == 1) return {Stage{level_[task], {task}}};
  Effort::spend(count);
  std::map<std::uint32_t, std::size_t> place;
  for (std::size_t i = 0; i < count; ++i) place[unit.tasks[i]] = i;
  std::vector<bool> before(count, false);  // the task and what it follows
  const auto mark_before = [&](std::vector<bool> &marks) {
    for (std::size_t i = count; i-- > 0;) {
      if (!marks[i]) continue;
      for (const std::uint32_t p : task_set_.tasks[unit.tasks[i]].predecessors) marks[place[p]] = true;
    }
  };
  before[place[task]] = true;
  mark_before(before);

  std::vector<Stage> stages;
  std::vector<bool> done(count, false);
  while (!done[place[task]]) {
    // The stage ends with the least urgent of the tasks that are left.
    std::uint32_t tier = 0;
    for (std::size_t i = 0; i < count; ++i) {
      if (before[i] && !done[i]) tier = std::max(tier, tier_[unit.tasks[i]]);
    }
    const std::uint32_t level = closed_[tier];
    for (std::size_t i = 0; i < count; ++i) {
      if (before[i] && !done[i] && (tier_[unit.tasks[i]] == tier || is_seen_apart(unit))) done[i] = true;
    }
    mark_before(done);
    std::vector<bool> later(count, true);  // what follows all the tasks with which the stage ends
    for (std::size_t i = 0; i < count; ++i) {
      const std::vector<std::uint32_t> &successors = task_set_.tasks[unit.tasks[i]].successors;
      const bool is_end = done[i] && std::none_of(successors.begin(), successors.end(), [&](std::uint32_t s) {
                            const auto found = place.find(s);
                            return found != place.end() && done[found->second];
                          });
      if (!is_end) continue;
      const std::vector<bool> follows = after(unit.tasks[i], in_order);
      for (std::size_t j = 0; j < count; ++j) later[j] = later[j] && follows[j];
    }
    if (stages.empty() || stages.back().level != level) stages.push_back(Stage{level, {}});
    stages.back().own.clear();
    for (std::size_t i = 0; i < count; ++i) {
      if (!later[i] && counted_[unit.tasks[i]] <= stages.front().level) stages.back().own.push_back(unit.tasks[i]);
    }
  }
  return stages;
}

Duration Levels::volume(std::uint32_t unit, std::uint32_t level) const {
  Duration sum = 0;
  for (const std::uint32_t t : task_set_.units[unit].tasks) {
    if (counted_[t] <= level) sum = add(sum, task_set_.tasks[t].wcet);
  }
  return sum;
}

void Levels::find_longest() {
  last_rank_.resize(closed_.size());
  longest_.resize(closed_.size());
  for (std::uint32_t rank = 0; rank < task_set_.by_rank.size(); ++rank) {
    last_rank_[task_set_.tasks[task_set_.by_rank[rank]].tier] = rank;
  }
  std::vector<Once> of_tier(closed_.size());
  for (std::uint32_t t = 0; t < task_set_.tasks.size(); ++t) {
    const Duration stretch = task_set_.tasks[t].region - 1;
    if (stretch > of_tier[tier_[t]].stretch) of_tier[tier_[t]] = Once{t, stretch, 0};
  }
  for (std::size_t tier = longest_.size(); tier-- > 1;) {
    longest_[tier - 1] = longest_[tier].stretch > of_tier[tier].stretch ? longest_[tier] : of_tier[tier];
  }
  for (std::uint32_t u = 0; u < task_set_.units.size(); ++u) {
    const std::vector<std::uint32_t> &tasks = task_set_.units[u].tasks;
    const auto differs = [&](std::uint32_t t) { return tier_[t] != tier_[tasks.front()]; };
    if (std::any_of(tasks.begin(), tasks.end(), differs)) divided_.push_back(u);
  }
}

// However many less urgent jobs end, each task that does not count follows once. Returns the smaller sum: that of
// `all`, or of the longest stretches and all these tasks.
std::vector<Once> Levels::all_follow_once(std::vector<Once> all, std::vector<Once> stretches, const Once &follow) {
  const auto sum = [](const std::vector<Once> &of) {
    return std::accumulate(of.begin(), of.end(), Duration{0}, [](Duration before, const Once &once) {
      return add(add(before, once.stretch), once.follows);
    });
  };
  if (follow.follows > 0) stretches.push_back(follow);
  return sum(stretches) < sum(all) ? std::move(stretches) : std::move(all);
}

// The tasks of the level in units that it divides that `is_new` accepts, as what follows one of them.
template <class IsNew>
Once Levels::new_at(std::uint32_t level, IsNew is_new) const {
  Once all;
  for (const std::uint32_t u : divided_) {
    for (const std::uint32_t t : task_set_.units[u].tasks) {
      if (tier_[t] <= level && is_new(t)) all = Once{t, 0, add(all.follows, task_set_.tasks[t].wcet)};
    }
  }
  return all;
}

// A less urgent job can run in the busy period only if it started strictly before, or ends as the period begins: one
// job that keeps the worker, and for each group the job that holds it. Its end releases tasks of the level.
std::vector<Once> Levels::once(std::uint32_t task, std::uint32_t level, const std::vector<std::uint32_t> &own) const {
  const std::uint32_t unit = task_set_.tasks[task].unit;
  const auto is_new = [&](std::uint32_t t) {
    if (task_set_.tasks[t].unit == unit) return std::find(own.begin(), own.end(), t) == own.end();
    return counted_[t] > level;
  };
  const auto follows = [&](std::uint32_t from) {
    std::vector<std::uint32_t> reached = {from};
    Duration sum = 0;
    for (std::size_t i = 0; i < reached.size(); ++i) {
      for (const std::uint32_t s : task_set_.tasks[reached[i]].successors) {
        const bool is_of_unit = task_set_.tasks[s].unit == task_set_.tasks[from].unit;
        if (!is_of_unit || tier_[s] > level || std::find(reached.begin(), reached.end(), s) != reached.end()) continue;
        reached.push_back(s);
        if (is_new(s)) sum = add(sum, task_set_.tasks[s].wcet);
      }
    }
    Effort::spend(reached.size());
    return sum;
  };
  const auto is_longer = [](const Once &a, const Once &b) { return a.stretch + a.follows > b.stretch + b.follows; };
  Once longest = longest_[level];
  Once longest_stretch = longest;
  Once released;
  const auto consider = [&](std::uint32_t t, Duration stretch) {
    if (tier_[t] <= level) return;
    const Once found{t, std::max<Duration>(stretch, 0), follows(t)};
    if (is_longer(found, longest)) longest = found;
    if (found.stretch > longest_stretch.stretch) longest_stretch = Once{t, found.stretch, 0};
    if (found.follows > released.follows) released = Once{t, 0, found.follows};
  };
  for (const std::uint32_t u : divided_) {
    for (const std::uint32_t t : task_set_.units[u].tasks) consider(t, task_set_.tasks[t].region - 1);
  }
  const std::uint32_t last = last_rank_[level];
  const std::uint32_t platform_level = task_set_.tasks[task_set_.by_rank[last]].level;
  for (std::uint32_t rank = last + 1; rank < task_set_.by_rank.size(); ++rank) {
    // Tasks of one platform level are neighbours in the order, and do not preempt each other.
    const std::uint32_t t = task_set_.by_rank[rank];
    if (task_set_.mode == sched::Preemption::None || task_set_.tasks[t].level != platform_level) break;
    consider(t, task_set_.tasks[t].wcet - 1);
  }
  std::vector<Once> all;
  std::vector<Once> longest_stretches;
  if (longest_stretch.stretch > 0) longest_stretches.push_back(longest_stretch);
  if (task_set_.mode == sched::Preemption::Full) {
    for (const std::vector<std::uint32_t> &group : task_set_.groups) {
      // While a job holds the group for a task of this platform level or above, no task of the level preempts it.
      bool is_needed = false;
      Once holder;
      Once longest_holder;
      for (const std::uint32_t t : group) {
        is_needed = is_needed || task_set_.tasks[t].level <= platform_level;
        if (tier_[t] <= level || task_set_.tasks[t].wcet == 1) continue;
        const Once found{t, task_set_.tasks[t].wcet - 1, follows(t)};
        if (is_longer(found, holder)) holder = found;
        if (found.stretch > longest_holder.stretch) longest_holder = Once{t, found.stretch, 0};
      }
      if (!is_needed || holder.stretch == 0) continue;
      all.push_back(holder);
      longest_stretches.push_back(longest_holder);
    }
    // With inheritance, the job that ends as the period begins need not be the one that keeps the worker.
    if (!task_set_.groups.empty() && longest.stretch > 0 && released.follows > 0) all.push_back(released);
  }
  if (longest.stretch + longest.follows > 0) all.push_back(longest);
  return all.size() > 1 ? all_follow_once(std::move(all), longest_stretches, new_at(level, is_new)) : all;
}

std::vector<Interferer> Levels::others(std::uint32_t unit, std::uint32_t level) {
  const auto change = [&](std::uint32_t t, Duration by) { classes_[class_of_[task_set_.tasks[t].unit]].wcet += by; };
  for (; summed_ < by_counted_.size() && counted_[by_counted_[summed_]] <= level; ++summed_) {
    change(by_counted_[summed_], task_set_.tasks[by_counted_[summed_]].wcet);
  }
  for (; summed_ > 0 && counted_[by_counted_[summed_ - 1]] > level; --summed_) {
    change(by_counted_[summed_ - 1], -task_set_.tasks[by_counted_[summed_ - 1]].wcet);
  }
  std::vector<Interferer> found;
  for (std::uint32_t c = 0; c < classes_.size(); ++c) {
    found.push_back(classes_[c]);
    if (c == class_of_[unit]) found.back().wcet -= volume(unit, level);
    if (found.back().wcet == 0) found.pop_back();
  }
  return found;
}

}  // namespace redag::analysis::one_worker
