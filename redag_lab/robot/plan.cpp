// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/robot/plan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "redag/runtime/threads.hpp"

namespace redag::robot {
namespace {

Scheduling fifo(int priority) { return Scheduling{Scheduling::Class::Fifo, priority, 0, true}; }

// What the policy orders by.
std::int64_t key_of(PolicyKind policy, const Task &task) {
  switch (policy) {
    case PolicyKind::DeadlineMonotonic: return task.deadline;
    case PolicyKind::Fixed: return task.priority.value_or(0);
    default: return task.period;
  }
}

class Planner {
 public:
  Planner(const Robot &robot, runtime::PriorityBand band) : robot_(robot), band_(std::move(band)) {}

  Result<Plan> run() {
    if (robot_.by_bounds && !robot_.assigned) {
      return make_error(fmt::format("no order of robot '{}' by its bounds is known", robot_.name));
    }
    const auto has = [&](Level::Kind kind) {
      return std::any_of(robot_.threads.begin(), robot_.threads.end(),
                         [kind](const Threads &each) { return each.level && each.level->kind == kind; });
    };
    // Small bands leave no room between tasks and timers.
    if (has(Level::Kind::Above) && band_.top_job + 1 >= band_.timer) --band_.top_job;
    if (band_.top_job < 2) {
      return make_error("the order needs SCHED_FIFO, and there are too few priorities for it",
                        runtime::realtime_hint());
    }
    plan_.band = band_;
    plan_.order = order_of(robot_, band_.levels());
    plan_.levels.resize(plan_.order.levels);
    for (std::uint32_t level = 0; level < plan_.order.levels; ++level) {
      plan_.levels[level].priority = band_.of_level(level);
    }
    for (std::size_t p = 0; p < robot_.processes.size(); ++p) add_process(p);
    for (std::size_t t = 0; t < robot_.threads.size(); ++t) add_threads(t);
    if (!mistakes_.empty()) return tl::unexpected<Diagnostics>(std::move(mistakes_));
    return std::move(plan_);
  }

 private:
  void add_member(std::uint32_t level, std::int64_t key, std::string name) {
    PlannedLevel &row = plan_.levels[level];
    const bool grows = robot_.policy != PolicyKind::Fixed;  // with the level
    if (row.members.empty()) row.first = row.last = key;
    row.first = grows ? std::min(row.first, key) : std::max(row.first, key);
    row.last = grows ? std::max(row.last, key) : std::min(row.last, key);
    row.members.push_back(std::move(name));
  }

  void add_process(std::size_t p) {
    const Process &process = robot_.processes[p];
    std::vector<int> &priorities = plan_.of_executor.emplace_back();
    if (!process.workload) return;
    const std::vector<std::optional<std::uint32_t>> own = own_levels(robot_, p);
    for (const TaskRef &ref : flatten(*process.workload)) {
      const std::uint32_t level = plan_.order.of_task[p][ref.id.value];
      add_member(level, key_of(robot_.policy, *ref.task),
                 fmt::format("{}.{}.{}", process.name, process.workload->dags[ref.dag.value].name, ref.task->name));
      const std::optional<std::uint32_t> &own_level = own[ref.id.value];
      if (!own_level) continue;
      if (priorities.size() <= *own_level) priorities.resize(*own_level + 1);
      priorities[*own_level] = band_.of_level(level);
    }
  }

  void add_threads(std::size_t t) {
    const Threads &threads = robot_.threads[t];
    std::optional<Scheduling> &wanted = plan_.of_threads.emplace_back();
    if (!threads.level) return;
    const Level &level = *threads.level;
    switch (level.kind) {
      case Level::Kind::Rate:
        add_member(*plan_.order.of_threads[t], level.rate, "threads " + threads.name);
        [[fallthrough]];
      case Level::Kind::Task: wanted = fifo(band_.of_level(*plan_.order.of_threads[t])); return;
      case Level::Kind::Above: wanted = fifo(band_.top_job + 1); return;
      case Level::Kind::Below: wanted = fifo(1); return;
      case Level::Kind::Nice: wanted = Scheduling{Scheduling::Class::Other, 0, level.value, false}; return;
      case Level::Kind::Reservation: {
        const Reservation &each = level.reservation;
        wanted = Scheduling{.kind = Scheduling::Class::Deadline,
                            .resets_on_fork = true,
                            .budget = each.budget,
                            .deadline = each.period,
                            .period = each.period};
        return;
      }
      case Level::Kind::Fifo: break;
    }
    wanted = fifo(level.value);
    const int lowest = plan_.levels.empty() ? band_.top_job + 1 : plan_.levels.back().priority;
    if (level.value < lowest || level.value > band_.top_job) return;
    mistakes_.push_back(Diagnostic{Severity::Error, threads.place.file, threads.place.line, threads.place.column,
                                   fmt::format("priority {} of threads '{}' is among those of tasks, {} to {}",
                                               level.value, threads.name, lowest, band_.top_job),
                                   "use 'above', 'below', {rate: PERIOD}, {task: TASK} or another priority"});
  }

  const Robot &robot_;
  runtime::PriorityBand band_;
  Plan plan_;
  Diagnostics mistakes_;
};

}  // namespace

Result<Plan> plan_of(const Robot &robot, runtime::PriorityBand band) { return Planner(robot, std::move(band)).run(); }

std::string levels_text(const std::vector<int> &priorities) { return fmt::format("{}", fmt::join(priorities, ",")); }

}  // namespace redag::robot
