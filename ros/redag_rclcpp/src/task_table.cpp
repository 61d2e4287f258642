// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "task_table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <set>

namespace redag_rclcpp {
namespace {

// More messages come than this process publishes: a program outside publishes to the topic, too, as to /tf.
bool has_unseen_publisher(redag::Duration interval, double rate_seen) {
  constexpr double kMore = 1.3;  // the first few messages tell a rate badly
  return interval > 0 && static_cast<double>(interval) * rate_seen * kMore < 1;
}

}  // namespace

using redag::Task;
using redag::TaskId;
using redag::Workload;
using Kind = redag::Callback::Kind;

namespace {

/// Breaks cycles of learned edges by making a task of each cycle a timer task without predecessors.
void break_cycles(redag::Dag &dag) {
  std::vector<std::uint8_t> done(dag.tasks.size(), 0);
  const auto is_ready = [&](const Task &task) {
    return std::all_of(task.predecessors.begin(), task.predecessors.end(), [&](auto p) { return done[p] != 0; });
  };
  for (std::size_t left = dag.tasks.size(); left > 0;) {
    const std::size_t before = left;
    for (std::size_t t = 0; t < dag.tasks.size(); ++t) {
      if (done[t] != 0 || !is_ready(dag.tasks[t])) continue;
      done[t] = 1;
      --left;
    }
    if (left != before) continue;
    const auto first = static_cast<std::size_t>(std::find(done.begin(), done.end(), 0) - done.begin());
    dag.tasks[first].predecessors.clear();
    dag.tasks[first].activation = redag::Activation::Timer;
  }
}

redag::Callback match_of(const redag::CallbackId &id) {
  redag::Callback callback;
  callback.kind = id.kind;
  callback.node = id.node;
  callback.name = id.name;
  if (id.kind == Kind::Timer) callback.period = id.period;
  if (id.kind == Kind::Timer || id.kind == Kind::Waitable) callback.index = id.index;
  return callback;
}

}  // namespace

TaskTable::TaskTable(redag::Platform platform, redag::PolicyKind policy, redag::Ties ties, const Workload *configured,
                     bool is_traced)
    : platform_(platform), policy_(policy), ties_(ties), configured_(configured), is_traced_(is_traced) {
  if (configured != nullptr) dags_ = configured->dags;
  for (redag::Dag &dag : dags_) dag.tasks.clear();
  // A DAG for all callbacks that the workload does not name. It has no max_active, and its tasks come last among
  // equals. In HI mode they run after everything else, and not more often than their periods.
  dags_.emplace_back().name = "ros";
  dags_.back().degrade = redag::Degrade{.kind = redag::Degrade::Kind::Stretch, .skip = 1, .stretch = 1};
  dags_.back().edges = redag::Edges::Seen;
}

void TaskTable::set(TaskId task, Entry entry) {
  const redag::LockGuard guard(lock_);
  if (entries_.size() <= task.value) entries_.resize(task.value + 1);
  entries_[task.value] = std::move(entry);
}

void TaskTable::set_predecessors(TaskId task, const std::vector<TaskId> &predecessors, redag::Time before,
                                 redag::Time at) {
  const redag::LockGuard guard(lock_);
  std::set<TaskId> added(predecessors.begin(), predecessors.end());
  for (redag::trace::Edge &edge : edges_) {
    if (edge.to != task || edge.until != redag::kNever) continue;
    if (added.erase(edge.from) == 0) edge.until = before;
  }
  if (!is_traced_) std::erase_if(edges_, [](const auto &edge) { return edge.until != redag::kNever; });
  for (const TaskId from : added) edges_.push_back({.from = from, .to = task, .since = at, .until = redag::kNever});
}

std::vector<redag::trace::Edge> TaskTable::edges() const {
  const redag::LockGuard guard(lock_);
  return edges_;
}

void TaskTable::drop(TaskId task) {
  std::shared_ptr<Callback> gone;  // declared before the guard: destroyed without the lock
  const redag::LockGuard guard(lock_);
  gone.swap(entries_[task.value].callback);
  entries_[task.value].execution.reset();
  if (!is_traced_) std::erase_if(edges_, [task](const auto &edge) { return edge.from == task || edge.to == task; });
}

std::string TaskTable::name_of(TaskId task) const {
  const redag::LockGuard guard(lock_);
  return name(entries_.at(task.value));
}

std::string TaskTable::name(const Entry &entry) const {
  if (entry.configured) return dags_[entry.dag].name + "." + entry.task.name;
  return to_string(entry.id);
}

CallbackPlace TaskTable::place_of(TaskId task) const {
  const redag::LockGuard guard(lock_);
  return place(entries_.at(task.value));
}

CallbackPlace TaskTable::place(const Entry &entry) const {
  CallbackPlace place;
  place.name = name(entry);
  place.node = entry.id.node;
  place.group = entry.task.group;
  place.group_text = entry.in_default_group ? "the default callback group of " + entry.id.node
                                            : fmt::format("callback group {} of {}", entry.task.group, entry.id.node);
  place.dag = entry.dag;
  place.dag_name = dags_[entry.dag].name;
  place.max_active = dags_[entry.dag].max_active;
  return place;
}

std::vector<Endpoint> TaskTable::endpoints() const {
  struct Row {
    std::size_t task;
    std::shared_ptr<Callback> callback;
    Exchange exchange;
    std::vector<KeptInput> kept;
  };
  std::vector<Row> rows;
  {
    const redag::LockGuard guard(lock_);
    for (std::size_t i = 0; i < entries_.size(); ++i) {
      const std::shared_ptr<Callback> &callback = entries_[i].callback;
      if (!callback) continue;
      Exchange exchange = callback->exchange();
      if (exchange.side != Exchange::Side::None) rows.push_back({i, callback, std::move(exchange), {}});
    }
  }
  for (Row &row : rows) row.kept = row.callback->kept();
  std::vector<Endpoint> result;
  // As in stats(): skips callbacks that have gone meanwhile.
  const redag::LockGuard guard(lock_);
  for (Row &row : rows) {
    const Entry &entry = entries_[row.task];
    if (entry.callback != row.callback) continue;
    if (row.exchange.side == Exchange::Side::Server && row.kept.empty()) continue;
    result.push_back({.place = place(entry), .exchange = std::move(row.exchange), .kept = std::move(row.kept)});
  }
  return result;
}

std::vector<CallbackStats> TaskTable::stats(const redag::runtime::Engine &engine, bool percentiles) const {
  struct Row {
    TaskId task;
    std::shared_ptr<Callback> callback;
    CallbackStats stats;
  };
  std::vector<Row> rows;
  {
    const redag::LockGuard guard(lock_);
    for (std::size_t i = 0; i < entries_.size(); ++i) {
      const Entry &entry = entries_[i];
      if (!entry.callback) continue;
      CallbackStats stats;
      stats.id = entry.id;
      stats.key = TaskId(i);
      if (entry.configured) stats.dag = dags_[entry.dag].name;
      stats.task = name(entry);
      stats.period = entry.task.period;
      stats.deadline = entry.task.deadline;
      stats.wcet = entry.configured ? entry.task.wcet : 0;
      rows.push_back(Row{TaskId(i), entry.callback, std::move(stats)});
    }
  }
  for (Row &row : rows) {
    CallbackStats &stats = row.stats;
    const Callback &callback = *row.callback;
    const redag::runtime::TaskFigures figures = engine.figures(row.task);
    stats.jobs = figures.jobs;
    stats.waits = figures.most_waits;
    stats.misses = stats.jobs.misses(figures.late + callback.lost());
    stats.publishers = callback.publishers();
    stats.response_max = figures.response->longest();
    stats.execution_max = figures.execution->longest();
    if (!percentiles) continue;
    stats.response_p50 = figures.response->quantile(0.5);
    stats.response_p99 = figures.response->quantile(0.99);
    stats.execution_p50 = figures.execution->quantile(0.5);
    stats.execution_p99 = figures.execution->quantile(0.99);
  }
  std::vector<CallbackStats> result;
  {
    // If the callback has gone meanwhile, the engine may have counted for another task of the same id.
    const redag::LockGuard guard(lock_);
    for (Row &row : rows) {
      if (entries_[row.task.value].callback == row.callback) result.push_back(std::move(row.stats));
    }
  }
  std::stable_sort(result.begin(), result.end(),
                   [](const CallbackStats &a, const CallbackStats &b) { return a.period < b.period; });
  return result;
}

// ---- learned rates and edges ----

// A period that is only a little better known is kept until the callback has learned: other tasks would change places.
std::vector<std::pair<TaskId, redag::Duration>> TaskTable::adopt_rates() {
  constexpr redag::Duration kBetter = 20;  // a change by one part of that many
  const redag::LockGuard guard(lock_);
  std::vector<std::pair<TaskId, redag::Duration>> changed;
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    const Entry &entry = entries_[i];
    if (!entry.callback || entry.configured) continue;
    const bool is_final = entry.callback->has_rate() || entry.callback->has_learned();
    const redag::Duration known = entry.task.period;
    const redag::Duration period = std::min(seen_period(entry, 0), redag::kMaxDuration);
    if (period <= 0 || period == known) continue;
    if (is_final || std::abs(period - known) > known / kBetter) changed.emplace_back(TaskId(i), period);
  }
  for (const auto &[task, period] : changed) {
    Entry &entry = entries_[task.value];
    entry.learned = !entry.callback->has_rate();
    entry.task.period = period;
    entry.task.deadline = period;
    entry.callback->set_deadline(period);
  }
  return changed;
}

std::size_t TaskTable::count_learned() const {
  const redag::LockGuard guard(lock_);
  return static_cast<std::size_t>(std::count_if(entries_.begin(), entries_.end(),
                                                [](const Entry &entry) { return entry.callback && entry.learned; }));
}

// The largest period of the tasks whose jobs publish to this task, as data tasks inherit it. Without such a task, or if
// others publish to it as well, the mean time between arrivals; 0: unknown. `depth` ends cycles.
redag::Duration TaskTable::seen_period(const Entry &entry, int depth) const {
  constexpr int kDeepest = 32;
  if (entry.configured) return entry.task.period;
  if (entry.callback->has_rate()) {
    const redag::Duration stated = entry.callback->stated_period();
    return stated > 0 ? stated : entry.task.period;
  }
  if (is_ros_internal(entry.id)) return 0;  // nodes are loaded in bursts, which tell no rate
  // Requests and goals come in bursts as well. Only their number within the whole learning time is a rate.
  const bool is_stream = entry.id.kind == redag::Callback::Kind::Subscription;
  if (!is_stream && !entry.callback->has_learned()) return 0;
  redag::Duration period = 0;
  double rate = 0;  // per nanosecond, of the publishers together
  for (const TaskId publisher : entry.callback->publishers()) {
    if (depth >= kDeepest || publisher.value >= entries_.size() || !entries_[publisher.value].callback) continue;
    const redag::Duration its_period = seen_period(entries_[publisher.value], depth + 1);
    if (its_period > 0) rate += 1 / static_cast<double>(its_period);
    period = std::max(period, its_period);
  }
  const redag::Duration interval = entry.callback->mean_interval();
  return period > 0 && !has_unseen_publisher(interval, rate) ? period : interval;
}

// With `live`, the present tasks, for a workload file. Otherwise all tasks that ever existed, each with a wcet, for a
// trace.
Workload TaskTable::as_workload(Ids &ids, bool live) const {
  Workload workload;
  workload.name = configured_ != nullptr ? configured_->name : "ros";
  workload.platform = platform_;
  workload.policy = policy_;
  workload.ties = ties_;
  std::set<std::string> names;
  for (std::uint32_t d = 0; d < dags_.size(); ++d) {
    redag::Dag dag = dags_[d];
    std::vector<std::uint32_t> members;
    for (std::uint32_t i = 0; i < entries_.size(); ++i) {
      const Entry &entry = entries_[i];
      if (entry.dag != d || entry.task.period == 0) continue;
      if (live && (!entry.callback || is_ros_internal(entry.id))) continue;
      members.push_back(i);
    }
    std::stable_sort(members.begin(), members.end(),
                     [&](auto a, auto b) REDAG_REQUIRES(lock_) { return entries_[a].rank < entries_[b].rank; });
    for (const std::uint32_t i : members) {
      const Entry &entry = entries_[i];
      Task task = entry.task;
      const std::string wanted = entry.configured ? task.name : to_string(entry.id);
      task.name = wanted;
      for (int n = 2; !names.insert(dag.name + "." + task.name).second; ++n)
        task.name = fmt::format("{}_{}", wanted, n);
      if (entry.execution) task.wcet = std::max(task.wcet, entry.execution->longest());
      if (!live) task.wcet = std::clamp<redag::Duration>(task.wcet, 1, task.deadline);
      task.bcet = std::min(task.bcet, task.wcet);
      task.execution = {};
      if (task.budget > 0) task.budget = std::max(task.budget, task.wcet);
      task.callback = match_of(entry.id);
      task.activation = redag::Activation::Timer;  // edges follow, or are beside the workload
      dag.tasks.push_back(std::move(task));
    }
    if (dag.tasks.empty()) continue;
    ids.push_back(std::move(members));
    workload.dags.push_back(std::move(dag));
  }
  return workload;
}

Workload TaskTable::learned() const {
  const redag::LockGuard guard(lock_);
  Ids ids;
  Workload workload = as_workload(ids, true);
  add_seen_edges(workload, ids);
  return workload;
}

// Makes the task of a message follow the task that publishes it. With several publishers the task runs for each of
// them, which an AND-join cannot express. Such a task keeps a rate of its own.
void TaskTable::add_seen_edges(Workload &workload, const Ids &ids) const {
  for (std::size_t d = 0; d < workload.dags.size(); ++d) {
    redag::Dag &dag = workload.dags[d];
    for (std::size_t t = 0; t < dag.tasks.size(); ++t) {
      const Entry &entry = entries_[ids[d][t]];
      if (entry.configured) {
        add_configured_edges(dag, t, entry);
        continue;
      }
      const auto publishers = entry.callback->publishers();
      if (entry.callback->has_rate() || publishers.size() != 1) continue;
      const Entry &publisher = entries_[publishers.front().value];
      const redag::Duration its_period = publisher.callback ? seen_period(publisher, 0) : 0;
      if (its_period > 0 &&
          has_unseen_publisher(entry.callback->mean_interval(), 1 / static_cast<double>(its_period))) {
        continue;
      }
      const auto position = std::find(ids[d].begin(), ids[d].end(), publishers.front().value);
      if (position == ids[d].end() || *position == ids[d][t]) continue;
      dag.tasks[t].predecessors = {static_cast<std::uint32_t>(position - ids[d].begin())};
      dag.tasks[t].activation = redag::Activation::Data;
    }
    break_cycles(dag);
    for (Task &task : dag.tasks) {
      if (task.activation == redag::Activation::Data) task.period = 0;  // inherited from the predecessor
    }
    redag::inherit_periods(dag);
  }
}

// Adds the edges that the file states, between tasks that exist, and the waits.
void TaskTable::add_configured_edges(redag::Dag &dag, std::size_t task, const Entry &entry) const {
  const std::vector<Task> &configured = configured_->dags[entry.dag].tasks;
  const auto named = [](const std::vector<Task> &tasks, const std::string &name) {
    return std::find_if(tasks.begin(), tasks.end(), [&](const Task &candidate) { return candidate.name == name; });
  };
  const auto same = named(configured, entry.task.name);
  for (const std::uint32_t predecessor : same->predecessors) {
    const auto found = named(dag.tasks, configured[predecessor].name);
    if (found == dag.tasks.end()) continue;
    dag.tasks[task].predecessors.push_back(static_cast<std::uint32_t>(found - dag.tasks.begin()));
  }
  if (!dag.tasks[task].predecessors.empty()) dag.tasks[task].activation = same->activation;
  dag.tasks[task].waits = same->waits;
}

Workload TaskTable::describe(std::vector<std::uint32_t> &positions) const {
  Ids ids;
  Workload workload;
  {
    const redag::LockGuard guard(lock_);
    workload = as_workload(ids, false);
    positions.assign(entries_.size(), 0);
  }
  std::uint32_t next = 0;
  for (const auto &members : ids) {
    for (const std::uint32_t id : members) positions[id] = next++;
  }
  return workload;
}

}  // namespace redag_rclcpp
