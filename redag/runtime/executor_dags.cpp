// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The executor's DAGs: adds and removes them, and says what is known of them.
#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <stdexcept>
#include <utility>

#include "redag/engine/coroutine_body.hpp"
#include "redag/loader/validate.hpp"
#include "redag/runtime/dag_mistakes.hpp"
#include "redag/runtime/distribution_content.hpp"
#include "redag/runtime/executor_impl.hpp"
#include "redag/runtime/live_sample.hpp"

namespace redag::runtime {
namespace {

// By task of a DAG: whether it was made by event().
std::vector<bool> events_among(const std::vector<std::shared_ptr<EventSource>> &sources) {
  std::vector<bool> is_event;
  is_event.reserve(sources.size());
  for (const auto &source : sources) is_event.push_back(source != nullptr);
  return is_event;
}

// A trace needs every wcet. Where the program states none, the longest execution so far stands for it.
void state_wcet(Task &task, Duration longest) {
  if (task.wcet > 0) return;
  task.wcet =
      std::clamp<Duration>(std::max({longest, task.bcet, task.wcet_low}), 1, std::max<Duration>(1, task.deadline));
  task.bcet = std::min(task.bcet, task.wcet);
  task.wcet_low = std::min(task.wcet_low, task.wcet);
  task.execution = {};
}

// A trace needs the waits of a task. The most and the longest so far stand for them, without their devices: the time in
// the queues is part of the waits.
void state_waits(Task &task, std::uint32_t most, Duration longest) {
  const auto count = std::min<Duration>({most, Duration{kMaxWaits}, task.wcet - 1});
  for (Duration wait = 0; wait < count; ++wait) {
    Wait &one = task.waits.emplace_back();
    one.after = (wait + 1) * task.wcet / (count + 1);
    one.longest = std::max<Duration>(1, (longest + count - 1) / count);
  }
}

std::size_t count_rates(const Workload &workload) {
  std::set<std::pair<Duration, Duration>> rates;
  for (const Dag &dag : workload.dags) {
    for (const Task &task : dag.tasks) rates.emplace(task.period, task.deadline);
  }
  return rates.size();
}

}  // namespace

DagId Executor::Impl::add(Dag dag, std::vector<TaskBody> task_bodies, Sources sources) {
  inherit_periods(dag);
  const std::vector<bool> is_event = events_among(sources);
  if (const std::string mistakes = mistakes_of(dag, options_.policy); !mistakes.empty()) {
    refuse("Executor::add(): " + mistakes);
  }

  bool has_coroutines = false;
  std::vector<Body> bodies;
  for (TaskBody &body : task_bodies) {
    if (body.coroutine_) {
      has_coroutines = true;
      bodies.push_back(coroutine_body([make = std::move(body.coroutine_)](const Job &) { return make(); }));
    } else {
      bodies.emplace_back([function = std::move(body.function_)](const Job &) {
        function();
        return sched::Outcome::Finished;
      });
    }
  }
  const LockGuard adding(adding_);
  if (has_dag(dag.name)) {
    refuse("Executor::add(): " + place_of(dag.name) +
           ": another DAG in the executor has this name (remove() that one first, or choose another name)");
  }
  for (const auto &source : sources) {
    if (source == nullptr || !source->is_connected()) continue;
    refuse("Executor::add(): " + source->place() +
           ": this event is in an executor already (remove() its DAG there first, or build another one)");
  }
  if (options_.admission) admit(dag);
  if (has_coroutines) {
    if (const Result<void> ready = engine_->let_wait(); !ready) throw std::runtime_error(to_string(ready.error()));
  }
  const LockGuard guard(lock_);
  const DagId id(next_dag_);
  const Time now = running_ ? std::max<Time>(0, engine_->now()) : 0;
  Added added{.dag = dag,
              .sources = std::move(sources),
              .ids = engine_->add_dag(dag, std::move(bodies)),
              .base = now,
              .left = dag.tasks.size()};
  own(id, added.ids.tasks, now);
  timer_->add(dag, added.ids.tasks, now, is_event);
  for (std::size_t i = 0; i < added.sources.size(); ++i) {
    if (added.sources[i] == nullptr) continue;
    added.sources[i]->connect(*engine_, added.ids.tasks[i]);
    if (running_) added.sources[i]->open();
  }
  dags_.emplace(id.value, std::move(added));
  ++next_dag_;
  return id;
}

bool Executor::Impl::has_dag(const std::string &name) const {
  const LockGuard guard(lock_);
  return std::any_of(dags_.begin(), dags_.end(),
                     [&](const auto &added) { return !added.second.removed && added.second.dag.name == name; });
}

// Records which task owns each id. A DAG's record is erased once later tasks own all of its ids.
void Executor::Impl::own(DagId dag, const std::vector<TaskId> &tasks, Time since) {
  for (std::uint32_t position = 0; position < tasks.size(); ++position) {
    const std::uint32_t task = tasks[position].value;
    if (task >= owners_.size()) {
      owners_.resize(task + 1);
    } else if (const auto former = dags_.find(owners_[task].dag.value); former != dags_.end()) {
      if (--former->second.left == 0) dags_.erase(former);
    }
    owners_[task] = Owner{dag, position, since};
  }
}

// The platform and the policy, without DAGs.
Workload Executor::Impl::workload() const {
  Workload workload;
  workload.name = options_.name;
  workload.platform =
      Platform{.workers = options_.workers, .preemption = setup_.mode.mode, .devices = options_.devices};
  workload.policy = options_.policy;
  workload.ties = options_.ties;
  return workload;
}

void Executor::Impl::admit(const Dag &dag) const {
  Workload with = workload();
  {
    const LockGuard guard(lock_);
    for (const auto &[id, other] : dags_) {
      if (!other.removed) with.dags.push_back(other.dag);
    }
  }
  with.dags.push_back(dag);
  begin_unbounded_work();
  if (const Result<void> admitted = options_.admission(with, engine_->options().config); !admitted) {
    throw AdmissionRefused(fmt::format("DAG '{}' is not admitted: {}", dag.name, to_string(admitted.error())));
  }
}

void Executor::Impl::remove(DagId dag) {
  DagId removed;
  {
    const LockGuard guard(lock_);
    if (dag.value >= next_dag_)
      throw std::out_of_range(fmt::format("Executor::remove(): there is no DAG {}", dag.value));
    const auto found = dags_.find(dag.value);
    if (found == dags_.end() || found->second.removed) return;
    Added &gone = found->second;
    gone.removed = true;
    gone.removed_at = engine_->now();
    timer_->remove(gone.ids.tasks);
    for (const auto &source : gone.sources) {
      if (source != nullptr) source->disconnect();
    }
    removed = gone.ids.dag;
  }
  engine_->remove_dag(removed);  // destroys bodies, which may own anything: not under lock_
}

void Executor::Impl::disconnect_sources() {
  const LockGuard guard(lock_);
  for (const auto &[id, added] : dags_) {
    for (const auto &source : added.sources) {
      if (source != nullptr && !added.removed) source->disconnect();
    }
  }
}

// ---- what can be asked ----

DagStats Executor::Impl::stats(DagId dag) const {
  const LockGuard guard(lock_);
  const auto found = dags_.find(dag.value);
  if (found == dags_.end()) throw std::out_of_range(fmt::format("Executor::stats(): there is no DAG {}", dag.value));
  const Added &of = found->second;
  if (of.left < of.dag.tasks.size()) {
    throw std::out_of_range(fmt::format("Executor::stats(): DAG {} was removed, and its slot is reused", dag.value));
  }
  std::vector<bool> has_successor(of.dag.tasks.size());
  for (const Task &task : of.dag.tasks) {
    for (const std::uint32_t predecessor : task.predecessors) has_successor[predecessor] = true;
  }
  DagStats stats{.dag = of.dag.name, .deadline = of.dag.deadline, .tasks = {}, .sinks = {}};
  for (std::size_t i = 0; i < of.dag.tasks.size(); ++i) {
    const TaskFigures figures = engine_->figures(of.ids.tasks[i]);
    const std::string name = of.dag.name + "." + of.dag.tasks[i].name;
    stats.tasks.push_back(TaskStats{.task = name,
                                    .jobs = figures.jobs,
                                    .usage = figures.usage,
                                    .deadline = of.dag.tasks[i].deadline,
                                    .late = figures.late,
                                    .kept_worker = figures.kept_worker,
                                    .early = of.sources[i] == nullptr ? 0 : of.sources[i]->early(),
                                    .response = distribution_of(figures.response.get())});
    if (has_successor[i]) continue;
    stats.sinks.push_back(SinkStats{
        .task = name, .late = figures.late_end_to_end, .end_to_end = distribution_of(figures.end_to_end.get())});
  }
  return stats;
}

std::vector<std::string> Executor::Impl::warnings() const {
  std::vector<std::string> warnings;
  {
    const LockGuard guard(lock_);
    warnings = setup_.warnings;
  }
  for (Problem &problem : engine_->problems()) warnings.push_back(std::move(problem.text));
  return warnings;
}

DeviceHandle Executor::Impl::device(std::string_view name) const {
  for (std::size_t d = 0; d < options_.devices.size(); ++d) {
    if (options_.devices[d].name == name) return {*engine_, DeviceId(d)};
  }
  throw std::out_of_range(
      fmt::format("Executor::device(): there is no device '{}' (add it to ExecutorOptions::devices)", name));
}

std::string Executor::Impl::task_name(TaskId task) const {
  const LockGuard guard(lock_);
  if (task.value >= owners_.size()) return fmt::format("task {}", task.value);
  return name_of(owners_[task.value]);
}

std::string Executor::Impl::name_of(const Owner &owner) const {
  const Dag &dag = dags_.at(owner.dag.value).dag;  // exists as long as it owns a task
  return dag.name + "." + dag.tasks[owner.position].name;
}

// The run with all tasks that there have been. Their positions are their ids, which a recorded engine never reuses.
trace::RunInfo Executor::Impl::run_info() const {
  trace::RunInfo info;
  info.executor = "redag";
  info.config = engine_->options().config;
  info.preemption = to_string(setup_.mode.mode);
  info.preemption_why = setup_.mode.reason;
  info.driver = trace::Driver::Threads;
  info.origin = engine_->origin();
  info.workload = workload();
  const LockGuard guard(lock_);
  std::set<std::string> names;
  std::size_t position = 0;
  for (const auto &[id, added] : dags_) {
    Dag dag = added.dag;
    // A DAG can have the name of one that was removed before it was added.
    for (int n = 2; !names.insert(dag.name).second; ++n) dag.name = fmt::format("{} #{}", added.dag.name, n);
    for (std::size_t i = 0; i < dag.tasks.size(); ++i, ++position) {
      Task &task = dag.tasks[i];
      const TaskFigures figures = engine_->figures(added.ids.tasks[i]);
      state_wcet(task, figures.usage.longest);
      state_waits(task, figures.most_waits, figures.longest_waits);
      if (added.sources[i] != nullptr) info.event_tasks.emplace_back(position);
      if (added.removed) info.removals.push_back({TaskId(position), added.removed_at});
      if (task.activation == Activation::Timer && task.phase == Phase::Common) task.offset += added.base;
    }
    info.workload.dags.push_back(std::move(dag));
  }
  // Where rates share levels, another task can move them all.
  if (info.config.levels > 0 && count_rates(info.workload) > info.config.levels) {
    for (const auto &[id, added] : dags_) info.settled = std::max(info.settled.value_or(0), added.base);
  }
  return info;
}

void Executor::Impl::sample(live::Sample &sample) const {
  const LockGuard guard(lock_);
  for (const auto &[number, added] : dags_) {
    if (added.removed) continue;
    sample.dags.push_back({added.dag.name, added.dag.max_active, added.dag.deadline});
    for (std::size_t i = 0; i < added.dag.tasks.size(); ++i) {
      const TaskId id = added.ids.tasks[i];
      live::TaskSample task;
      fill(task, engine_->figures(id));
      task.key = id.value;
      task.name = added.dag.tasks[i].name;
      task.dag = static_cast<std::uint32_t>(sample.dags.size() - 1);
      task.period = added.dag.tasks[i].period;
      task.deadline = added.dag.tasks[i].deadline;
      sample.tasks.push_back(std::move(task));
    }
  }
  add_threads(sample, *engine_);
  add_devices(sample, *engine_);
  sample.alert = alert_of(*engine_);
}

}  // namespace redag::runtime
