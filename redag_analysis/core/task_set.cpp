// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/core/task_set.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>
#include <utility>

#include "redag/derived/modes.hpp"
#include "redag/loader/validate.hpp"
#include "redag/sched/policy.hpp"
#include "redag_analysis/core/arithmetic.hpp"
#include "redag_analysis/core/jobs_in_progress.hpp"
#include "redag_analysis/core/waiting.hpp"

namespace redag::analysis {
namespace {

constexpr Duration kLongestSum = kUnbounded / 8;

class Compiler {
 public:
  Compiler(const Workload &workload, const AnalysisPlatform &platform)
      : workload_(workload), waits_(waiting_times(workload)) {
    task_set_.platform = platform;
    task_set_.devices = workload.platform.devices;
    task_set_.several_executors = workload.platform.several_executors;
    task_set_.policy = workload.policy;
    task_set_.ties = workload.ties;
    task_set_.mode = platform.preemption;
    const auto has_region = [](const Dag &dag) {
      return std::any_of(dag.tasks.begin(), dag.tasks.end(), [](const Task &task) { return task.region > 0; });
    };
    if (platform.preemption == sched::Preemption::Cooperative &&
        std::none_of(workload.dags.begin(), workload.dags.end(), has_region)) {
      task_set_.mode = sched::Preemption::None;
    }
    std::set<std::string> groups;
    for (const TaskRef &ref : flatten(workload)) {
      if (!ref.task->group.empty() && !groups.insert(ref.task->group).second) shared_groups_.insert(ref.task->group);
      has_modes_ = has_modes_ || (ref.task->wcet_low > 0 && ref.task->wcet_low < ref.task->wcet);
    }
    inherit_often_ = task_set_.mode == sched::Preemption::Full && can_inherit_often();
    find_losses();
  }

  TaskSet run() {
    for (const Dag &dag : workload_.dags) add_dag(dag);
    assign_ranks();
    keep_shared_groups();
    for (const Dag &dag : workload_.dags) next_clock_ = std::max(next_clock_, dag.executor + 1);
    for (std::uint32_t d = 0; d < task_set_.dags.size(); ++d) {
      find_grids(d);
      form_units(d);
    }
    for (const CompiledTask &task : task_set_.tasks) {
      task_set_.utilization += static_cast<double>(task.wcet - task.waits) / static_cast<double>(task.period);
    }
    refuse_tasks(task_set_);
    check_sums();
    check_threads();
    separate_modes();
    if (!modes_.empty()) {
      for (CompiledTask &task : task_set_.tasks) {
        if (task_set_.dags[task.dag.value].high) continue;
        task.can_sink = task.can_lose = true;
        // At most so many releases in HI mode are refused one after the other.
        const Degrade &degrade = workload_.dags[task.dag.value].degrade;
        const auto refused = std::max<Duration>(degrade.skip, static_cast<Duration>(std::ceil(degrade.stretch))) + 1;
        task.replaced = add(task.replaced, multiply(task.period, refused));
      }
    }
    if (lost_.per_second >= kSecond) {
      refuse("stalls, releases and preemptions leave no processor time");
      task_set_.is_beyond_numbers = true;
    }
    task_set_.has_modes = task_set_.not_analysable.empty() && !modes_.empty() && waits_.empty();
    if (!modes_.empty()) refuse(std::move(modes_));
    refuse_waits(task_set_);
    return std::move(task_set_);
  }

 private:
  void refuse(std::string reason) {
    task_set_.is_refused_whole = true;
    if (task_set_.not_analysable.empty()) task_set_.not_analysable = std::move(reason);
  }

  static void refuse(CompiledTask &task, std::string reason) {
    if (task.refusal.empty()) task.refusal = std::move(reason);
  }

  // True if preemptions count as time in which nothing runs, as stalls and the release timer do. On several workers the
  // resumed job pays in its own time, which no interference divided by m covers. Where jobs wait, it can pay after the
  // response of the job that preempted it. Where they inherit often, less urgent ones cause preemptions.
  [[nodiscard]] bool preemptions_freeze() const {
    return (task_set_.platform.workers > 1 || !waits_.empty() || inherit_often_) &&
           task_set_.mode != sched::Preemption::None && task_set_.platform.preempt_overhead > 0;
  }

  [[nodiscard]] static bool is_demoted_at_limit(const Task &task) {
    return task.budget > 0 && task.budget < task.wcet && task.on_budget == OnBudget::Demote;
  }

  // A job lends its urgency to a second holder if the group can go to a less urgent job first, or if holders lose what
  // they inherited.
  [[nodiscard]] bool can_inherit_often() const {
    const std::uint32_t threads = task_set_.platform.max_started;
    const std::vector<TaskRef> tasks = flatten(workload_);
    std::uint64_t most_started = 0;
    for (const TaskRef &ref : tasks) most_started += ref.task->concurrency;
    const bool is_limited = has_modes_ || (threads > 0 && threads < most_started);
    return std::any_of(tasks.begin(), tasks.end(), [&](const TaskRef &ref) {
      const bool is_capped = workload_.dags[ref.dag.value].max_active > 0;
      return shared_groups_.contains(ref.task->group) && (is_limited || is_capped || is_demoted_at_limit(*ref.task));
    });
  }

  // The most jobs that a job takes a worker from, waits aside: one when it starts, one when a holder of its group
  // inherits from it. If it is demoted, a job that was preempted before takes its own.
  [[nodiscard]] Duration preemptions_by(const Dag &dag, const Task &task) const {
    const bool can_sink = is_demoted_at_limit(task) || (has_modes_ && dag.criticality != Criticality::High);
    if (inherit_often_) return preemptions_at_events_of(task);
    return 1 + (shared_groups_.contains(task.group) ? 1 : 0) + (can_sink ? 1 : 0);
  }

  // All workers can change their jobs when the job is released or ends, at its limits, and when it wakes up; at its end
  // and when it begins to wait, all but its own. The caller adds one for each wait.
  [[nodiscard]] Duration preemptions_at_events_of(const Task &task) const {
    const auto waits = static_cast<Duration>(task.waits.size());
    const bool begins_high = task.wcet_low > 0 && task.wcet_low < task.wcet;
    const Duration events = 2 + 2 * waits + (is_demoted_at_limit(task) ? 1 : 0) + (begins_high ? 1 : 0);
    return task_set_.platform.workers * events - 1 - 2 * waits;
  }

  [[nodiscard]] Duration late_releases(const Task &task) const {
    return ceil_div(add(task.jitter, task_set_.platform.lateness), std::max<Duration>(task.period, 1));
  }

  // The jobs of a window beyond those that its length explains, if the response of the task's DAG is at most its
  // period.
  [[nodiscard]] Duration late_or_unfinished(const Task &task) const {
    const Duration queued = task.overrun == Overrun::Queue ? task.queue_depth : 1;
    return late_releases(task) + queued + task.concurrency + 1;
  }

  // The same without that bound: a timer can also wait for data, and data tasks have a job for all that was unfinished
  // before them.
  [[nodiscard]] Duration late_or_behind(const Dag &dag, const Task &task) const {
    if (task.activation == Activation::Timer) return late_or_unfinished(task) + (task.predecessors.empty() ? 0 : 1);
    Duration jobs = 0;
    for (const Task &one : dag.tasks) jobs = add(jobs, late_or_unfinished(one) + 2);
    return jobs;
  }

  // Finds the time in which the bounds assume that nothing runs. It is sound to count each loss on one processor as one
  // on all.
  void find_losses() {
    const AnalysisPlatform &platform = task_set_.platform;
    lost_.longest = multiply(platform.stall.longest, platform.workers);
    lost_.per_second = multiply(platform.stall.per_second, platform.workers);
    // `each` is the loss for every release of a task. `more` counts the releases in a window beyond those that its
    // length explains.
    const auto add_releases = [this](Duration each, const Task &task, Duration more) {
      lost_.longest = add(lost_.longest, multiply(each, more));
      const Int128 rate = (Int128{each} * kSecond + task.period - 1) / std::max<Duration>(task.period, 1);
      lost_.per_second = add(lost_.per_second, static_cast<Duration>(std::min(rate, Int128{kSecond})));
    };
    Duration behind = 0;
    for (const Dag &dag : workload_.dags) {
      for (const Task &task : dag.tasks) {
        const Duration late = late_releases(task);
        if (task.activation == Activation::Timer) add_releases(platform.timer_overhead, task, late + 1);
        if (!preemptions_freeze()) continue;
        // A job also preempts at each wake-up. This includes jobs released before the window.
        const Duration times = preemptions_by(dag, task) + static_cast<Duration>(task.waits.size());
        const Duration each = multiply(platform.preempt_overhead, times);
        add_releases(each, task, late_or_unfinished(task));
        // The methods for groups that inherit often state no bound of the responses.
        Duration &lost = inherit_often_ ? lost_.longest : behind;
        lost = add(lost, multiply(each, late_or_behind(dag, task) - late_or_unfinished(task)));
      }
    }
    const bool is_lost_for_ever = lost_.per_second >= kSecond;
    task_set_.frozen = is_lost_for_ever ? 0 : lengthened(lost_.longest);
    task_set_.frozen_behind = is_lost_for_ever ? 0 : lengthened(behind);
  }

  // Lengthens an execution by the share of the processor that is permanently lost.
  [[nodiscard]] Duration lengthened(Duration execution) const {
    if (lost_.per_second == 0 || lost_.per_second >= kSecond) return execution;
    const Duration left = kSecond - lost_.per_second;
    const Int128 all = (Int128{execution} * kSecond + left - 1) / left;
    return static_cast<Duration>(std::min(all, Int128{kUnbounded}));
  }

  // Limits the sums. The bounds can then add up what tasks execute without checking each sum.
  void check_sums() {
    Int128 sum = 0;
    for (const CompiledTask &task : task_set_.tasks) sum += Int128{task.wcet} + task.jitter;
    if (sum <= kLongestSum) return;
    refuse("execution times and jitter add up to more than 18 years");
    task_set_.is_beyond_numbers = true;
  }

  // A started job keeps its thread while it is preempted.
  void check_threads() {
    const std::uint32_t threads = task_set_.platform.max_started;
    if (task_set_.mode != sched::Preemption::Full || threads == 0 || threads >= task_set_.tasks.size()) return;
    std::size_t most = 0;
    for (std::uint32_t d = 0; d < task_set_.dags.size(); ++d) most += most_jobs_in_progress(task_set_, DagId(d));
    if (threads < most) {
      refuse(std::to_string(threads) + " threads serve up to " + std::to_string(most) +
             " jobs in progress: a job can wait for a thread that less urgent jobs hold");
    }
    task_set_.threads_suffice_if_bounded = true;
  }

  void add_dag(const Dag &dag) {
    CompiledDag compiled;
    compiled.name = dag.name;
    compiled.deadline = dag.deadline;
    compiled.high = dag.criticality == Criticality::High;
    std::uint64_t at_once = 0;
    for (const Task &task : dag.tasks) at_once += task.concurrency;
    if (dag.max_active < at_once) compiled.max_active = dag.max_active;
    const auto first = static_cast<std::uint32_t>(task_set_.tasks.size());
    std::uint64_t waiting = 0;
    for (const Task &task : dag.tasks) {
      compiled.tasks.push_back(static_cast<std::uint32_t>(task_set_.tasks.size()));
      task_set_.tasks.push_back(compile_task(dag, task, first));
      waiting += task.overrun == Overrun::Queue ? task.queue_depth : 1;
    }
    for (std::uint32_t t = first; t < task_set_.tasks.size(); ++t) {
      for (const std::uint32_t p : task_set_.tasks[t].predecessors) task_set_.tasks[p].successors.push_back(t);
    }
    if (dag.max_pending > 0 && dag.max_pending < waiting) {
      for (std::uint32_t t = first; t < task_set_.tasks.size(); ++t) {
        refuse(task_set_.tasks[t],
               "DAG '" + dag.name + "': max_pending can cause jobs to be skipped although every deadline is met");
        task_set_.tasks[t].can_lose = true;
      }
    }
    task_set_.dags.push_back(std::move(compiled));
  }

  // HI mode is that of one executor. Others go on as before, and so does all their work.
  void separate_modes() {
    task_set_.has_separate_modes = has_separate_modes(workload_);
    if (!task_set_.has_separate_modes) return;
    const std::set<std::uint32_t> with_modes = executors_with_modes(workload_);
    for (std::uint32_t d = 0; d < task_set_.dags.size(); ++d) {
      if (!with_modes.contains(workload_.dags[d].executor)) task_set_.dags[d].high = true;
    }
  }

  CompiledTask compile_task(const Dag &dag, const Task &task, std::uint32_t first) {
    const AnalysisPlatform &platform = task_set_.platform;
    CompiledTask compiled;
    compiled.name = dag.name + "." + task.name;
    compiled.dag = DagId(task_set_.dags.size());
    // The job that preempts pays for the resumption.
    const Duration lead = add(platform.release_overhead, platform.dispatch_overhead);
    const bool pays = task_set_.mode != sched::Preemption::None && !preemptions_freeze();
    const Duration resumptions = (pays ? preemptions_by(dag, task) : 0) + static_cast<Duration>(task.waits.size());
    const Duration overhead = add(lead, multiply(platform.preempt_overhead, resumptions));
    compiled.wcet = lengthened(add(task.wcet, overhead));
    compiled.overhead = compiled.wcet - task.wcet;
    if (!waits_.empty()) {
      const WaitingTime &waiting = waits_[task_set_.tasks.size()];
      // In time that counts only while no processor is stalled, and is then stretched, waits take as much longer as
      // executions do.
      compiled.devices = waiting.devices;
      compiled.elsewhere = compiled.waits = lengthened(waiting.elsewhere);
      for (DeviceUse &use : compiled.devices) {
        for (Duration *time : {&use.service, &use.longest, &use.blocked}) *time = lengthened(*time);
        compiled.waits = add(compiled.waits, add(use.service, use.blocked));
      }
      compiled.wake_ups = static_cast<std::uint32_t>(task.waits.size());
      for (std::size_t w = 0; w <= task.waits.size() && compiled.wake_ups > 0; ++w) {
        const Duration end = w < task.waits.size() ? task.waits[w].after : task.wcet;
        const Duration begin = w > 0 ? task.waits[w - 1].after : 0;
        compiled.stretches.push_back(lengthened(add(end - begin, add(lead, platform.preempt_overhead))));
      }
      compiled.wcet = add(compiled.wcet, compiled.waits);
    }
    compiled.wcet_low = task.wcet_low > 0 ? lengthened(add(task.wcet_low, overhead)) : compiled.wcet;
    compiled.bcet = add(std::max<Duration>(1, task.bcet), overhead);
    compiled.period = task.period;
    compiled.deadline = task.deadline;
    compiled.jitter = task.jitter;
    if (task.activation == Activation::Timer) {
      compiled.jitter = add(add(task.jitter, platform.lateness), task_set_.frozen);
    }
    compiled.limit = task.overrun == Overrun::Queue ? multiply(task.period, task.queue_depth) : task.period;
    compiled.data = task.activation == Activation::Data;
    for (const std::uint32_t p : task.predecessors) compiled.predecessors.push_back(first + p);
    if (!task.group.empty()) {
      const auto next = static_cast<std::uint32_t>(group_ids_.size());
      compiled.group = group_ids_.try_emplace(task.group, next).first->second;
    }
    if (task_set_.mode == sched::Preemption::None) {
      compiled.region = compiled.last_region = compiled.wcet;
    } else if (task_set_.mode == sched::Preemption::Cooperative) {
      const bool whole = task.region == 0 || task.region >= task.wcet;
      compiled.region = whole ? compiled.wcet : lengthened(add(task.region, overhead));
      // Preemption points are at multiples of the region, strictly inside the job.
      compiled.last_region = whole ? add(task.wcet, lead) : (task.wcet - 1) % task.region + 1;
    }
    compiled.at_once = task.concurrency;
    // Each job that exceeds its budget can refuse one release.
    const bool refuses = task.budget > 0 && task.budget < task.wcet && task.on_budget == OnBudget::SkipNext;
    compiled.replaced = multiply(task.period, refuses ? Duration{1} + task.concurrency : 1);
    if (task.concurrency > 1) {
      refuse(compiled, "task '" + compiled.name + "': jobs of a task with concurrency above 1 can overlap");
    }
    if (task.budget > 0 && task.budget < task.wcet && task.on_budget != OnBudget::Log) {
      compiled.can_sink = task.on_budget == OnBudget::Demote;
      compiled.can_lose = !compiled.can_sink;
      refuse(compiled, "task '" + compiled.name + "': its budget is below its wcet, so jobs can be " +
                           (task.on_budget == OnBudget::Abort    ? "cut off"
                            : task.on_budget == OnBudget::Demote ? "demoted"
                                                                 : "skipped"));
    }
    if (task.wcet_low > 0 && task.wcet_low < task.wcet) {
      modes_ = "task '" + compiled.name +
               "': its wcet_low is below its wcet, so jobs of less critical DAGs can be skipped in HI mode";
    }
    return compiled;
  }

  void assign_ranks() {
    const auto priorities =
        sched::assign_priorities(workload_.dags, workload_.policy, workload_.ties, task_set_.platform.levels);
    task_set_.by_rank.resize(priorities.size());
    for (std::uint32_t t = 0; t < priorities.size(); ++t) {
      task_set_.tasks[t].rank = priorities[t].rank;
      task_set_.tasks[t].tier = priorities[t].tier;
      task_set_.tasks[t].level = priorities[t].level;
      task_set_.by_rank[priorities[t].rank] = t;
    }
  }

  void keep_shared_groups() {
    std::vector<std::vector<std::uint32_t>> members(group_ids_.size());
    for (std::uint32_t t = 0; t < task_set_.tasks.size(); ++t) {
      if (task_set_.tasks[t].group != kNoGroup) members[task_set_.tasks[t].group].push_back(t);
    }
    for (const std::vector<std::uint32_t> &group : members) {
      const bool is_shared = group.size() > 1;
      const auto id = static_cast<std::uint32_t>(task_set_.groups.size());
      for (const std::uint32_t t : group) task_set_.tasks[t].group = is_shared ? id : kNoGroup;
      if (is_shared) task_set_.groups.push_back(group);
    }
  }

  // Splits a DAG into units: one list of tasks per unit, in topological order.
  std::vector<std::vector<std::uint32_t>> split(std::uint32_t dag) const {
    std::vector<std::uint32_t> order = task_set_.dags[dag].tasks;
    if (order.empty()) return {};
    const std::uint32_t first = order.front();
    const std::vector<std::uint32_t> ranks = topological_ranks(workload_.dags[dag]);
    std::sort(order.begin(), order.end(),
              [&](std::uint32_t a, std::uint32_t b) { return ranks[a - first] < ranks[b - first]; });
    const bool edges = std::any_of(order.begin(), order.end(),
                                   [&](std::uint32_t t) { return !task_set_.tasks[t].predecessors.empty(); });
    if (edges && is_released_together(order)) return {order};

    const std::vector<std::vector<std::uint32_t>> parts = connected_parts(order);
    std::vector<std::vector<std::uint32_t>> lists;
    for (const std::vector<std::uint32_t> &part : parts) {
      if (is_unit(part)) {
        lists.push_back(part);
      } else {
        for (const std::uint32_t t : part) lists.push_back({t});
      }
    }
    std::sort(lists.begin(), lists.end());
    return lists;
  }

  // Finds the parts that edges other than rate edges connect.
  [[nodiscard]] std::vector<std::vector<std::uint32_t>> connected_parts(const std::vector<std::uint32_t> &order) const {
    const std::uint32_t first = *std::min_element(order.begin(), order.end());
    std::vector<std::uint32_t> part(order.size());  // each task points at a representative
    std::iota(part.begin(), part.end(), 0);
    const auto find = [&](std::uint32_t i) {
      while (part[i] != i) i = part[i] = part[part[i]];
      return i;
    };
    for (const std::uint32_t t : order) {
      if (joins_rates(t)) continue;
      for (const std::uint32_t p : task_set_.tasks[t].predecessors) part[find(t - first)] = find(p - first);
    }
    std::map<std::uint32_t, std::vector<std::uint32_t>> parts;
    for (const std::uint32_t t : order) parts[find(t - first)].push_back(t);
    std::vector<std::vector<std::uint32_t>> lists;
    lists.reserve(parts.size());
    for (auto &[representative, tasks] : parts) lists.push_back(std::move(tasks));
    return lists;
  }

  [[nodiscard]] bool joins_rates(std::uint32_t t) const {
    const CompiledTask &task = task_set_.tasks[t];
    return std::any_of(task.predecessors.begin(), task.predecessors.end(),
                       [&](std::uint32_t p) { return !is_released_with(task_set_.tasks[p], task); });
  }

  // True if the part is released as a whole: it has no rate edges, or all of it follows the one task that waits.
  [[nodiscard]] bool is_unit(const std::vector<std::uint32_t> &part) const {
    if (std::none_of(part.begin(), part.end(), [&](std::uint32_t t) { return joins_rates(t); })) return true;
    return std::all_of(part.begin() + 1, part.end(),
                       [&](std::uint32_t t) { return !joins_rates(t) && !task_set_.tasks[t].predecessors.empty(); });
  }

  // Sets the grids of a DAG's tasks, in topological order. A timer has its own grid. A data task has that of its
  // predecessor with the largest period; of several, the one with the latest offset. If its predecessors are of several
  // clocks, it has one of its own.
  void find_grids(std::uint32_t dag) {
    const Dag &stated = workload_.dags[dag];
    const std::uint32_t first = task_set_.dags[dag].tasks.empty() ? 0 : task_set_.dags[dag].tasks.front();
    const std::vector<std::uint32_t> ranks = topological_ranks(stated);
    std::vector<std::uint32_t> order = task_set_.dags[dag].tasks;
    std::sort(order.begin(), order.end(),
              [&](std::uint32_t a, std::uint32_t b) { return ranks[a - first] < ranks[b - first]; });
    for (const std::uint32_t t : order) {
      CompiledTask &task = task_set_.tasks[t];
      task.offset = stated.tasks[t - first].offset;
      if (task.data) {
        take_grid(task);
      } else {
        const Phase phase = phase_of(stated.tasks[t - first]);
        task.clock = phase == Phase::Common ? stated.executor : next_clock_++;
        task.has_gaps = phase == Phase::Event;
      }
    }
  }

  // Gives a data task the grid of its predecessors.
  void take_grid(CompiledTask &task) {
    std::optional<Duration> latest;
    for (const std::uint32_t p : task.predecessors) {
      const CompiledTask &before = task_set_.tasks[p];
      if (before.period == task.period) latest = std::max(latest.value_or(before.offset), before.offset);
    }
    const CompiledTask &one = task_set_.tasks[task.predecessors.front()];
    const bool is_one_clock = std::all_of(task.predecessors.begin(), task.predecessors.end(),
                                          [&](std::uint32_t p) { return task_set_.tasks[p].clock == one.clock; });
    task.clock = is_one_clock ? one.clock : next_clock_++;
    task.offset = is_one_clock ? latest.value_or(0) : 0;
    task.has_gaps = is_one_clock && one.has_gaps;
  }

  // A ROS timer counts from when its node created it, and messages from another process come when that one sends them.
  // Who calls a service or an action does so at any time.
  static Phase phase_of(const Task &task) {
    if (task.phase != Phase::Common || !task.callback) return task.phase;
    const Callback::Kind kind = task.callback->kind;
    const bool is_periodic = kind == Callback::Kind::Timer || kind == Callback::Kind::Subscription;
    return is_periodic ? Phase::Unknown : Phase::Event;
  }

  [[nodiscard]] bool is_released_together(const std::vector<std::uint32_t> &tasks) const {
    const CompiledTask *timer = nullptr;
    for (const std::uint32_t t : tasks) {
      const CompiledTask &task = task_set_.tasks[t];
      if (task.period != task_set_.tasks[tasks.front()].period) return false;
      if (task.data) continue;
      if (timer != nullptr && !is_released_with(*timer, task)) return false;
      timer = &task;
    }
    return timer != nullptr;
  }

  void form_units(std::uint32_t dag) {
    for (std::vector<std::uint32_t> &tasks : split(dag)) {
      const auto id = static_cast<std::uint32_t>(task_set_.units.size());
      for (const std::uint32_t t : tasks) task_set_.tasks[t].unit = id;
      task_set_.dags[dag].units.push_back(id);
      task_set_.units.push_back(make_unit(task_set_, DagId(dag), std::move(tasks)));
    }
  }

  std::string modes_;  // why there is a HI mode
  bool has_modes_ = false;
  bool inherit_often_ = false;  // a job that waits for its group can lend its urgency to several holders
  std::set<std::string> shared_groups_;
  const Workload &workload_;
  const std::vector<WaitingTime> waits_;  // by TaskId; empty: no task waits
  TaskSet task_set_;
  Loss lost_;
  std::map<std::string, std::uint32_t> group_ids_;
  std::uint32_t next_clock_ = 0;
};

}  // namespace

void refuse_tasks(TaskSet &task_set) {
  for (const CompiledTask &task : task_set.tasks) {
    if (task_set.not_analysable.empty()) task_set.not_analysable = task.refusal;
  }
}

void refuse_waits(TaskSet &task_set) {
  const auto waits = [](const CompiledTask &task) { return task.wake_ups > 0; };
  if (std::none_of(task_set.tasks.begin(), task_set.tasks.end(), waits) || !task_set.not_analysable.empty()) return;
  task_set.not_analysable = why_waits_are_not_covered(task_set);
  task_set.has_waits = task_set.not_analysable.empty();
  if (task_set.has_waits) task_set.not_analysable = "jobs wait without a worker";
}

Unit make_unit(const TaskSet &task_set, DagId dag, std::vector<std::uint32_t> tasks) {
  const CompiledTask &first = task_set.tasks[tasks.front()];
  Unit unit;
  unit.dag = dag;
  unit.period = first.period;
  unit.deadline = first.deadline;
  unit.offset = first.offset;
  for (const std::uint32_t p : first.predecessors) {
    if (std::find(tasks.begin(), tasks.end(), p) == tasks.end()) unit.awaits.push_back(p);
  }
  unit.keeps_grid = tasks.size() == 1 && first.predecessors.empty() && !first.data && !first.has_gaps;
  unit.limit = tasks.size() > 1 || !unit.awaits.empty() ? first.period : first.limit;
  unit.has_edges = tasks.size() > 1;  // also of a part of a unit, which can have none between its tasks
  unit.first_rank = unit.last_rank = first.rank;
  std::map<std::uint32_t, Duration> path;  // longest path that ends with the task
  for (const std::uint32_t t : tasks) {
    const CompiledTask &task = task_set.tasks[t];
    unit.deadline = std::min(unit.deadline, task.deadline);
    unit.jitter = std::max(unit.jitter, task.data ? 0 : task.jitter);
    unit.volume = add(unit.volume, task.wcet);
    unit.first_rank = std::min(unit.first_rank, task.rank);
    unit.last_rank = std::max(unit.last_rank, task.rank);
    unit.has_edges = unit.has_edges || !task.predecessors.empty();
    Duration before = 0;
    for (const std::uint32_t p : task.predecessors) before = std::max(before, path[p]);
    path[t] = add(before, task.wcet);
    unit.length = std::max(unit.length, path[t]);
  }
  const Duration end_to_end = task_set.dags[dag.value].deadline;
  if (end_to_end > 0) unit.deadline = std::min(unit.deadline, end_to_end);
  unit.tasks = std::move(tasks);
  return unit;
}

AnalysisPlatform charge(AnalysisPlatform platform, const Overheads &overheads) {
  platform.dispatch_overhead = overheads.dispatch;
  platform.preempt_overhead = overheads.preempt;
  platform.timer_overhead = overheads.timer;
  platform.lateness = overheads.lateness;
  platform.stall = overheads.stall;
  return platform;
}

Result<ExecutedRun> as_executed(Workload workload, const sched::Config &config, std::string_view overheads) {
  ExecutedRun run{std::move(workload), platform_of(config)};
  run.workload.policy = config.policy;
  run.workload.ties = config.ties;
  if (const std::optional<Overheads> machine = parse_overheads(overheads)) {
    run.platform = charge(run.platform, *machine);
    return run;
  }
  for (std::string_view rest = overheads; !rest.empty();) {
    const std::size_t comma = std::min(rest.find(", "), rest.size());
    const std::string_view part = rest.substr(0, comma);
    rest.remove_prefix(std::min(rest.size(), comma + 2));
    const std::size_t blank = std::min(part.find(' '), part.size());
    const std::string_view what = part.substr(0, blank);
    const Result<Duration> value = parse_duration(part.substr(std::min(part.size(), blank + 1)));
    Duration *target = what == "release"    ? &run.platform.release_overhead
                       : what == "dispatch" ? &run.platform.dispatch_overhead
                       : what == "preempt"  ? &run.platform.preempt_overhead
                                            : nullptr;
    if (!value || target == nullptr) {
      return make_error("the overheads in the run's record cannot be parsed: " + std::string(overheads));
    }
    *target = *value;
  }
  return run;
}

AnalysisPlatform platform_of(const sched::Config &config) {
  AnalysisPlatform platform;
  platform.workers = config.workers;
  platform.preemption = config.preemption;
  platform.levels = config.levels;
  platform.max_started = config.max_started;
  return platform;
}

AnalysisPlatform platform_of(const Workload &workload) { return platform_of(sched::config_of(workload)); }

AnalysisPlatform platform_of(AnalysisPlatform whole, const ClusterPart &part) {
  if (part.is_cluster()) whole.workers = part.workload.platform.workers;
  return whole;
}

sched::Config config_of(const AnalysisPlatform &platform, const Workload &workload) {
  sched::Config config = sched::config_of(workload);
  config.workers = platform.workers;
  config.preemption = platform.preemption;
  config.levels = platform.levels;
  config.max_started = platform.max_started;
  return config;
}

bool TaskSet::has_edges() const {
  return std::any_of(units.begin(), units.end(), [](const Unit &unit) { return unit.has_edges; });
}

bool TaskSet::has_rate_edges() const {
  return std::any_of(units.begin(), units.end(), [](const Unit &unit) { return !unit.awaits.empty(); });
}

Result<TaskSet> compile(const Workload &workload, const AnalysisPlatform &platform) {
  if (platform.workers == 0) return make_error("a platform needs at least one worker");
  if (std::min({platform.release_overhead, platform.dispatch_overhead, platform.preempt_overhead, platform.lateness,
                platform.timer_overhead, platform.stall.longest, platform.stall.per_second}) < 0) {
    return make_error("an overhead must not be negative");
  }
  Diagnostics mistakes = validate(workload, {.waits = true});
  if (has_errors(mistakes)) return tl::unexpected<Diagnostics>(std::move(mistakes));
  if (Result<void> one = refuse_clusters(workload, "a bound"); !one) return tl::unexpected(std::move(one.error()));
  return Compiler(workload, platform).run();
}

}  // namespace redag::analysis
