// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/many_workers/group_windows.hpp"

#include <algorithm>
#include <functional>

#include "redag/sched/policy.hpp"
#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/effort.hpp"
#include "redag_analysis/many_workers/fixed_point.hpp"

namespace redag::analysis::groups {
namespace {

using global::GlobalUnit;

constexpr std::size_t kMostPrecise = 64;  // tasks of a unit; with more, all own work off the chain counts

// The work in any window of length x of something that does `volume` every `period`, at most `width` at a time, and
// ends within `response`. The first instance executes as late as it can, the others as early.
Duration most_work(Duration volume, Duration period, Duration response, Duration width, Duration x) {
  if (volume == 0) return 0;
  const Duration ends = std::max(response, ceil_div(volume, width));
  const Duration until = width * (x + ends) - volume;
  const Duration turn = width * period;
  return add(multiply(until / turn, volume), std::min(volume, until % turn));
}

Chain::Group &group_of(Chain &chain, std::uint32_t group) {
  const auto known = std::find_if(chain.groups.begin(), chain.groups.end(),
                                  [&](const Chain::Group &other) { return other.group == group; });
  if (known != chain.groups.end()) return *known;
  chain.groups.push_back(Chain::Group{.group = group});
  return chain.groups.back();
}

std::uint32_t last_level(const TaskSet &task_set, const Unit &unit) {
  return task_set.tasks[task_set.by_rank[unit.last_rank]].level;
}

}  // namespace

std::vector<Block> blocks_of(const TaskSet &task_set, const std::vector<GlobalUnit> &units) {
  if (!is_static(task_set.policy)) return {Block{0, units.size()}};
  std::vector<Block> blocks;
  std::uint32_t last_rank = 0;
  std::uint32_t last = 0;
  for (std::size_t k = 0; k < units.size(); ++k) {
    const Unit &unit = task_set.units[units[k].unit];
    const std::uint32_t first = task_set.tasks[task_set.by_rank[unit.first_rank]].level;
    if (blocks.empty() || (unit.first_rank > last_rank && first > last)) blocks.push_back(Block{k, k});
    blocks.back().end = k + 1;
    last_rank = std::max(last_rank, unit.last_rank);
    last = std::max(last, last_level(task_set, unit));
  }
  return blocks;
}

Windows::Windows(const TaskSet &task_set, std::vector<GlobalUnit> &units)
    : task_set_(task_set),
      units_(units),
      blocks_(blocks_of(task_set, units)),
      preempts_(task_set.mode != sched::Preemption::None),
      bounds_(task_set.tasks.size()),
      reachable_(units.size()),
      place_(task_set.tasks.size(), 0),
      parts_(task_set.groups.size()) {
  for (std::size_t k = 0; k < units.size(); ++k) {
    const std::vector<std::uint32_t> &tasks = task_set.units[units[k].unit].tasks;
    std::vector<std::vector<bool>> &reachable = reachable_[k];
    reachable.assign(tasks.size() > 1 ? tasks.size() : 0, std::vector<bool>(tasks.size(), false));
    for (std::uint32_t i = 0; i < tasks.size(); ++i) {
      const CompiledTask &task = task_set.tasks[tasks[i]];
      place_[tasks[i]] = i;
      for (const std::uint32_t p : task.predecessors) {
        for (std::size_t a = 0; a < i; ++a) {
          if (a == place_[p] || reachable[a][place_[p]]) reachable[a][i] = true;
        }
      }
      if (task.group == kNoGroup) continue;
      std::vector<Part> &parts = parts_[task.group];
      if (parts.empty() || parts.back().unit != k) parts.push_back(Part{k, 0, {}});
      parts.back().volume = add(parts.back().volume, task.wcet);
      parts.back().tasks.push_back(tasks[i]);
    }
  }
  longest_below_.resize(blocks_.size());
  std::vector<std::optional<std::uint32_t>> longest(task_set.groups.size());
  for (std::size_t b = blocks_.size(); b-- > 0;) {
    longest_below_[b] = longest;
    for (std::size_t k = blocks_[b].begin; k < blocks_[b].end; ++k) {
      for (const std::uint32_t t : task_set.units[units[k].unit].tasks) {
        if (task_set.tasks[t].group != kNoGroup) take_longer(t, longest[task_set.tasks[t].group]);
      }
    }
  }
  if (preempts_) return;
  const std::uint32_t m = task_set.platform.workers;
  for (const Block &block : blocks_) {
    first_blocking_.push_back(global::largest_remaining(task_set, units, block.end, m));
    later_blocking_.push_back(m > 1 ? global::largest_remaining(task_set, units, block.end, m - 1) : 0);
  }
}

// True if an own task that is less urgent than all of the chain does not keep the chain waiting, unless it holds a
// group. Without preemption, or with a place of the unit's max_active, it can.
bool Windows::obeys_levels(std::size_t unit) const {
  return preempts_ && is_static(task_set_.policy) && units_[unit].bound == 0;
}

bool Windows::follows(std::size_t unit, std::uint32_t before, std::uint32_t after) const {
  return before != after && !reachable_[unit].empty() && reachable_[unit][place_[before]][place_[after]];
}

void Windows::start(std::size_t unit) {
  for (const std::uint32_t t : task_set_.units[units_[unit].unit].tasks) {
    Duration before = 0;
    for (const std::uint32_t p : task_set_.tasks[t].predecessors) {
      before = std::max(before, bounds_[p].response - units_[unit].jitter);
    }
    bounds_[t] = TaskBound{before + task_set_.tasks[t].wcet + units_[unit].jitter, 1};
  }
}

// ---- what can delay a chain, for any window ----

// The least urgent level on the chain: own tasks below it go first only as holders that inherit.
std::uint32_t Windows::threshold(std::size_t unit, const Question &question) const {
  std::uint32_t level = task_set_.tasks[question.task].level;
  if (question.from_ready) return level;
  for (const std::uint32_t t : task_set_.units[units_[unit].unit].tasks) {
    if (follows(unit, t, question.task)) level = std::max(level, task_set_.tasks[t].level);
  }
  return level;
}

// What instances released i >= 1 periods earlier (later) can do in a window that they overlap by response - i period.
Duration Windows::overlaps(Duration response, Duration period, Duration wcet) const {
  Duration sum = 0;
  for (Duration left = response - period; left > 0; left -= period) sum = add(sum, std::min(left, wcet));
  return sum;
}

void Windows::add_own(std::size_t unit, std::uint32_t threshold, Chain &chain) const {
  const Question &question = chain.question;
  const Duration period = units_[unit].period;
  const Duration until = question.until > 0 ? question.until : bounds_[question.task].response;
  const auto overlapping = [&](Duration response) { return response > period ? (response - 1) / period : 0; };
  for (const std::uint32_t t : task_set_.units[units_[unit].unit].tasks) {
    const CompiledTask &task = task_set_.tasks[t];
    const bool goes_first = !obeys_levels(unit) || task.level <= threshold;
    if (!goes_first && task.group == kNoGroup) continue;
    const bool is_self = t == question.task;
    const bool is_before = follows(unit, t, question.task);
    const bool is_after = follows(unit, question.task, t);
    const Duration same = question.from_ready && is_before ? 0 : question.instances - (is_after ? 1U : 0U);
    Duration jobs = same;
    Duration overlapped = 0;
    if (!is_earlier_done(unit, question, t)) {
      overlapped = overlaps(bounds_[t].response, period, task.wcet);
      jobs += overlapping(bounds_[t].response);
    }
    if (!is_self && !is_after) {
      overlapped = add(overlapped, overlaps(until, period, task.wcet));
      jobs += overlapping(until);
    }
    const Duration work = add(multiply(same, task.wcet), overlapped);
    if (goes_first) chain.beside = add(chain.beside, overlapped);
    if (goes_first && same > 0 && is_beside(unit, question, t)) chain.beside = add(chain.beside, task.wcet);
    if (goes_first) chain.own = add(chain.own, work);
    chain.own_jobs += jobs;
    if (task.group == kNoGroup || jobs == 0) continue;
    Chain::Group &group = group_of(chain, task.group);
    if (!goes_first) {
      group.own_holding = add(group.own_holding, work);
      take_longer(t, group.holder);
      continue;
    }
    group.own_waiting += jobs;
    group.own_work = add(group.own_work, work);
    ++group.own_tasks;
    if (is_self || (is_before && !question.from_ready)) group.waiters.push_back(t);
  }
  if (question.first_tick) chain.own -= task_set_.tasks[question.task].wcet - 1;
}

// True if the earlier jobs of the task have ended where a job of the chain could start; they then delay only others.
bool Windows::is_earlier_done(std::size_t unit, const Question &question, std::uint32_t task) const {
  const bool is_self = task == question.task;
  if (question.from_ready) return is_self || follows(unit, task, question.task);
  if (!is_self) return false;
  const std::vector<std::uint32_t> &tasks = task_set_.units[units_[unit].unit].tasks;
  return std::none_of(tasks.begin(), tasks.end(), [&](std::uint32_t other) {
    return follows(unit, other, task) &&
           (!obeys_levels(unit) || task_set_.tasks[other].level >= task_set_.tasks[task].level);
  });
}

// True if the task's job can execute while a job of the same instance waits that is on a chain to the question's.
bool Windows::is_beside(std::size_t unit, const Question &question, std::uint32_t task) const {
  const auto keeps = [&](std::uint32_t other) {
    if (other == task || follows(unit, other, task) || follows(unit, task, other)) return false;
    const CompiledTask &own = task_set_.tasks[task];
    return !obeys_levels(unit) || own.group != kNoGroup || own.level <= task_set_.tasks[other].level;
  };
  if (keeps(question.task)) return true;
  const std::vector<std::uint32_t> &tasks = task_set_.units[units_[unit].unit].tasks;
  return !question.from_ready && std::any_of(tasks.begin(), tasks.end(), [&](std::uint32_t other) {
    return follows(unit, other, question.task) && keeps(other);
  });
}

void Windows::take_longer(std::uint32_t task, std::optional<std::uint32_t> &longest) const {
  if (!longest || task_set_.tasks[task].wcet > task_set_.tasks[*longest].wcet) longest = task;
}

// Computes the path to the task that makes the window longest; work that could execute beside other paths counts less
// on the path. Also computes the longest path with its longest job repeated for each further instance.
void Windows::add_length(std::size_t unit, Chain &chain) const {
  const Question &question = chain.question;
  const CompiledTask &last = task_set_.tasks[question.task];
  const std::vector<std::uint32_t> &tasks = task_set_.units[units_[unit].unit].tasks;
  chain.path = last.wcet;
  chain.overhead = last.overhead;
  chain.length = chain.longest = multiply(question.instances, last.wcet);
  const bool is_alone = question.from_ready || reachable_[unit].empty();
  // With several instances, or a max_active, anything off the chain can execute beside it.
  const bool is_precise = question.instances == 1 && units_[unit].bound == 0 && tasks.size() <= kMostPrecise;
  if (!is_alone) {
    struct Path {
      Duration length = 0;
      Duration overhead = 0;
      Duration longest = 0;   // regardless of what is beside it
      Duration repeated = 0;  // the same, with its longest job repeated for each further instance
      Duration beside = 0;    // work of its tasks that would count, by its share, if they were off the path
    };
    const auto m = static_cast<Duration>(task_set_.platform.workers);
    std::vector<Path> paths(tasks.size());
    for (std::size_t i = 0; i <= place_[question.task]; ++i) {
      const CompiledTask &task = task_set_.tasks[tasks[i]];
      Path &path = paths[i];
      Duration repeated = 0;
      Duration longest = 0;
      for (const std::uint32_t p : task.predecessors) {
        const Path &before = paths[place_[p]];
        if (m * before.length - before.beside > m * path.length - path.beside) path = before;
        repeated = std::max(repeated, before.repeated);
        longest = std::max(longest, before.longest);
      }
      path.longest = add(longest, task.wcet);
      path.length = add(path.length, task.wcet);
      path.overhead = add(path.overhead, task.overhead);
      if (is_precise && is_beside(unit, question, tasks[i])) path.beside = add(path.beside, task.wcet);
      path.repeated =
          std::max(add(repeated, task.wcet), add(path.longest, multiply(question.instances - 1, task.wcet)));
    }
    const Path &path = paths[place_[question.task]];
    chain.path = path.length;
    chain.overhead = path.overhead;
    chain.longest = path.repeated;
    chain.length = question.instances == 1 ? path.length : path.repeated;
    chain.beside -= path.beside;
  }
  if (question.first_tick) {
    chain.path -= last.wcet - 1;
    chain.length -= last.wcet - 1;
    chain.longest -= last.wcet - 1;
  }
  if (!is_precise) chain.beside = chain.own - chain.length;
}

Chain Windows::chain_of(std::size_t block, std::size_t unit, const Question &question) const {
  Chain chain;
  chain.question = question;
  chain.unit = unit;
  const std::size_t tasks = task_set_.units[units_[unit].unit].tasks.size();
  Effort::spend(tasks * tasks + task_set_.groups.size());
  const std::uint32_t level = threshold(unit, question);
  add_own(unit, level, chain);
  add_length(unit, chain);
  for (std::uint32_t g = 0; g < task_set_.groups.size(); ++g) {
    if (longest_below_[block][g]) group_of(chain, g).below = task_set_.tasks[*longest_below_[block][g]].wcet - 1;
  }
  for (Chain::Group &group : chain.groups) {
    if (longest_below_[block][group.group]) take_longer(*longest_below_[block][group.group], group.holder);
    if (group.holder) group.held = task_set_.tasks[*group.holder].wcet - 1;
    if (group.waiters.empty()) continue;
    group.found = static_cast<Duration>(group.waiters.size());
    group.own_waiting -= std::min(group.own_waiting, group.found);
    // Each end of an own job can admit one that waited for the max_active, while another took the group.
    if (units_[unit].bound > 0) group.found += chain.own_jobs;
    chain.holders = add(chain.holders, multiply(group.found, group.held));
    if (group.own_tasks == 1) continue;
    Duration least = kUnbounded;
    for (const std::uint32_t t : group.waiters) least = std::min(least, task_set_.tasks[t].wcet);
    chain.own_serial = add(chain.own_serial, group.own_work - least);
  }
  std::erase_if(chain.groups, [](const Chain::Group &group) { return group.waiters.empty() && group.held == 0; });
  return chain;
}

// ---- what delays the chain in a window ----

Duration Windows::work(std::size_t unit, Duration x) const {
  const GlobalUnit &other = units_[unit];
  Duration response = 0;
  Duration each = 0;
  for (const std::uint32_t t : task_set_.units[other.unit].tasks) {
    response = std::max(response, bounds_[t].response);
    each = add(each, most_work(task_set_.tasks[t].wcet, other.period, bounds_[t].response, 1, x));
  }
  return std::min(each, most_work(other.volume, other.period, response, other.width, x));
}

Duration Windows::serial_work(const Part &part, Duration x) const {
  Duration response = 0;
  for (const std::uint32_t t : part.tasks) response = std::max(response, bounds_[t].response);
  return most_work(part.volume, units_[part.unit].period, response, 1, x);
}

Duration Windows::jobs_in_progress(const Part &part, Duration x) const {
  Duration jobs = 0;
  const GlobalUnit &unit = units_[part.unit];
  const auto in_window = [&](std::uint32_t t) { return ceil_div(x + bounds_[t].response, unit.period); };
  for (const std::uint32_t t : part.tasks) jobs += in_window(t);
  if (unit.bound == 0) return jobs;
  // Adds the jobs that find a holder: once when they arrive, and once for each end that gives a place of the
  // max_active.
  for (const std::uint32_t t : task_set_.units[unit.unit].tasks) jobs += in_window(t);
  return jobs;
}

// Bounds own work in two ways, by what can execute beside the chain and by all there is; the smaller counts.
void Windows::share_own(const Chain &chain, Duration together) {
  const Duration all = std::min(add(chain.longest, chain.own_serial), chain.own);
  const Duration rest = chain.own - all;
  const Duration precise = add(chain.length, chain.own_serial);
  const bool is_smaller = Int128{precise} * together + chain.beside < Int128{all} * together + rest;
  shares_.executes = is_smaller ? precise : all;
  shares_.own_shared = is_smaller ? chain.beside : rest;
}

Duration Windows::evaluate(std::size_t block, const Chain &chain, Duration x) {
  const std::size_t end = blocks_[block].end;
  const Duration m = task_set_.platform.workers;
  Effort::spend(end + 1);
  const std::uint32_t bound = units_[chain.unit].bound;
  const Duration together = bound > 0 ? bound : m;  // own jobs that execute while one waits
  share_own(chain, together);
  std::fill(shares_.serial.begin(), shares_.serial.begin() + static_cast<std::ptrdiff_t>(end), 0);
  Duration ends = units_[chain.unit].path_tasks - 1;  // after which less urgent jobs can be found started
  Duration inherited = 0;
  for (const Chain::Group &group : chain.groups) {
    Effort::spend(parts_[group.group].size());
    const bool is_waited_for = !group.waiters.empty();
    Duration waiting = group.own_waiting + (units_[chain.unit].bound > 0 ? chain.own_jobs : 0);
    for (const Part &part : parts_[group.group]) {
      if (part.unit >= end) break;
      if (part.unit == chain.unit) continue;
      if (group.held > 0 || !preempts_) waiting += jobs_in_progress(part, x);
      if (!is_waited_for) continue;
      Duration serial = serial_work(part, x);
      // At most what fits while its jobs wait for the group, except where that wait is itself the question.
      if (preempts_ && !(chain.question.from_ready && chain.question.first_tick)) {
        Duration sum = 0;
        Duration most = 0;
        for (const std::uint32_t t : group.waiters) {
          const Duration each = serial_work(part, bounds_[t].wait);
          sum = add(sum, each);
          most = std::max(most, each);
        }
        serial = std::min(serial, add(sum, multiply(chain.question.instances - 1, most)));
      }
      shares_.serial[part.unit] = add(shares_.serial[part.unit], serial);
    }
    inherited =
        add(inherited, std::min(multiply(group.held, waiting), add(multiply(group.below, waiting), group.own_holding)));
    const auto waiters = static_cast<Duration>(group.waiters.size());
    if (is_waited_for) ends += waiting + waiters - 1 + (group.held > 0 ? waiters : 0);
  }
  Duration serial = add(shares_.executes, chain.holders);
  Duration shared = 0;
  for (std::size_t j = 0; j < end; ++j) {
    if (j == chain.unit) continue;
    const Duration all = work(j, x);
    shares_.serial[j] = std::min(shares_.serial[j], all);
    shares_.shared[j] = all - shares_.serial[j];
    serial = add(serial, shares_.serial[j]);
    shared = add(shared, shares_.shared[j]);
  }
  shares_.less_urgent = preempts_ ? inherited : add(first_blocking_[block], multiply(later_blocking_[block], ends));
  const Int128 others = Int128{add(shared, shares_.less_urgent)} * together + Int128{shares_.own_shared} * m;
  return add(serial, saturate(others / (Int128{m} * together)));
}

// Returns a start at or below the least window that holds, which avoids steps of a nanosecond. Each of the others does
// at least min(volume, x), and at least one job in each group that the chain waits for.
Duration Windows::least_window(std::size_t block, const Chain &chain) {
  const std::size_t end = blocks_[block].end;
  const Duration m = task_set_.platform.workers;
  Duration serial = 0;
  for (const Chain::Group &group : chain.groups) {
    if (group.waiters.empty()) continue;
    for (const Part &part : parts_[group.group]) {
      if (part.unit >= end) break;
      if (part.unit != chain.unit) serial = add(serial, part.volume);
    }
  }
  volumes_.clear();
  Duration rest = 0;
  for (std::size_t j = 0; j < end; ++j) {
    if (j == chain.unit) continue;
    volumes_.push_back(units_[j].volume);
    rest = add(rest, units_[j].volume);
  }
  const auto cut = std::min<std::size_t>(volumes_.size(), static_cast<std::size_t>(m) - 1);
  std::partial_sort(volumes_.begin(), volumes_.begin() + static_cast<std::ptrdiff_t>(cut), volumes_.end(),
                    std::greater<>());
  const Duration alone = add(chain.length, serial - serial / m - (serial % m != 0 ? 1 : 0));
  Duration least = kUnbounded;
  for (std::size_t c = 0; c <= cut; ++c) {  // the c largest are cut at x
    least = std::min(least, add(multiply(m, alone), rest) / (m - static_cast<Duration>(c)));
    if (c < cut) rest -= volumes_[c];
  }
  return std::max(chain.length, least - m);  // sums are rounded down
}

std::optional<Duration> Windows::window_of(std::size_t block, const Chain &chain, Duration stop) {
  shares_.serial.resize(units_.size());
  shares_.shared.resize(units_.size());
  Duration window = least_window(block, chain);
  if (window > stop) return std::nullopt;
  if (!global::least_fixed_point(stop, window, [&](Duration x) { return evaluate(block, chain, x); })) {
    return std::nullopt;
  }
  return window;
}

}  // namespace redag::analysis::groups
