// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "registry.hpp"

#include <algorithm>
#include <set>
#include <string>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "compat.hpp"
#include "rclcpp/logging.hpp"

namespace redag_rclcpp {

using redag::Duration;
using redag::Task;

Registry::Registry(rclcpp::Context::SharedPtr context, const ReDAGOptions &options, std::uint32_t workers,
                   const Parts &parts)
    : context_(std::move(context)), options_(options), workers_(workers), parts_(parts) {
  for (const redag::Dag &dag : parts_.tasks.dags()) dag_ids_.push_back(parts_.engine.add_dag(dag, {}).dag);
  if (options_.workload) matcher_ = std::make_unique<redag::CallbackMatcher>(**options_.workload);
}

void Registry::open(const std::shared_ptr<ExecutorContext> &executor, Groups groups) {
  executor_ = executor;
  groups_ = std::move(groups);
}

void Registry::close() {
  const redag::LockGuard guard(collect_lock_);
  closed_ = true;
  while (!callbacks_.empty()) remove(callbacks_.begin()->first);
  for (const auto &weak : nodes_) {
    if (const auto node = weak.lock()) node->get_notify_guard_condition().set_on_trigger_callback(nullptr);
  }
  for (const auto &[weak, name] : group_names_) {
    if (const auto group = weak.lock()) stop_watching(*group);
  }
}

// ---- nodes and groups ----

// If nothing else has changed, the groups that are known need not be looked at: a robot adds hundreds of nodes.
void Registry::change(const std::function<void()> &change) {
  Look look = Look::InNewGroups;
  {
    const redag::LockGuard guard(collect_lock_);
    if (stale_) look = Look::Everywhere;
    change();
  }
  collect(look);
  parts_.bridge.destroy_dropped();
}

void Registry::add_node(const NodeBase::SharedPtr &node) {
  collect_lock_.assert_held();  // see change()
  forget_gone_nodes();
  nodes_.push_back(node);
  watch(node->get_notify_guard_condition());
}

void Registry::remove_node(const NodeBase::SharedPtr &node) {
  collect_lock_.assert_held();  // see change()
  std::erase_if(nodes_, [&](const NodeBase::WeakPtr &weak) { return weak.lock() == node; });
  forget_gone_nodes();
  node->get_notify_guard_condition().set_on_trigger_callback(nullptr);
  node->for_each_callback_group([&](const rclcpp::CallbackGroup::SharedPtr &group) {
    collect_lock_.assert_held();
    if (manual_groups_.count(group) == 0) forget_group(group);
  });
}

void Registry::keep_until_done(NodeBase &node, const std::shared_ptr<void> &instance) {
  const redag::LockGuard guard(collect_lock_);
  const auto keep = [&](const auto &entity) {
    collect_lock_.assert_held();
    const auto callback = callbacks_.find(entity.get());
    if (callback != callbacks_.end()) callback->second.callback->keep_until_done(instance);
  };
  const auto keep_waitable = [&](const rclcpp::Waitable::SharedPtr &waitable) {
    keep(waitable);
    for (const auto &timer : compat::timers_of(*waitable)) keep(timer);
  };
  node.for_each_callback_group([&](const rclcpp::CallbackGroup::SharedPtr &group) {
    // Other groups were added to an executor on their own, and stay there.
    if (group->automatically_add_to_executor_with_node())
      group->collect_all_ptrs(keep, keep, keep, keep, keep_waitable);
  });
}

void Registry::add_group(const rclcpp::CallbackGroup::SharedPtr &group, const NodeBase::SharedPtr &node) {
  collect_lock_.assert_held();  // see change()
  forget_gone_nodes();
  manual_groups_[group] = node;
}

void Registry::remove_group(const rclcpp::CallbackGroup::SharedPtr &group) {
  collect_lock_.assert_held();  // see change()
  manual_groups_.erase(group);
  forget_group(group);
}

// Forgets nodes that were destroyed without being removed. The counters of their names begin anew with a node of the
// same name.
void Registry::forget_gone_nodes() {
  std::erase_if(nodes_, [](const NodeBase::WeakPtr &weak) { return weak.expired(); });
  std::erase_if(manual_groups_, [](const auto &entry) { return entry.first.expired() || entry.second.expired(); });
  std::set<std::string> names;
  const auto insert_name = [&](const NodeBase::WeakPtr &weak) {
    if (const auto node = weak.lock()) names.insert(node->get_fully_qualified_name());
  };
  for (const auto &weak : nodes_) insert_name(weak);
  for (const auto &[group, weak] : manual_groups_) insert_name(weak);
  std::erase_if(next_index_, [&](const auto &entry) { return names.count(entry.first.first) == 0; });
}

// Changes from before are told at once, and need not be heard: whoever begins to watch looks at the entities next.
void Registry::watch(rclcpp::GuardCondition &condition) const {
  const auto is_watched = std::make_shared<std::atomic<bool>>(false);
  condition.set_on_trigger_callback([weak = executor_, is_watched](std::size_t) {
    if (!*is_watched) return;
    if (const auto executor = weak.lock()) executor->entities_changed();
  });
  *is_watched = true;
}

// ---- entities ----

void Registry::collect(Look look) {
  // Declared before the lock guard: if `found` is the last owner of a user's object, that object is destroyed without
  // the lock.
  std::vector<Entity> found;
  const redag::LockGuard guard(collect_lock_);
  if (closed_) return;
  if (look == Look::Everywhere) stale_ = false;
  found = find(look);
  std::map<const void *, const Entity *> present;
  for (const Entity &entity : found) present.emplace(entity.key, &entity);

  std::vector<const void *> gone;
  for (const auto &[key, known] : callbacks_) {
    const bool is_absent = look == Look::Everywhere && present.count(key) == 0;
    if (is_absent || left_groups_.count(known.group) > 0 || !known.callback->alive()) gone.push_back(key);
  }
  left_groups_.clear();
  for (const void *entity : gone) remove(entity);
  find_places(found);
  Added added;
  std::vector<Found> absent;
  for (const Entity &entity : found) {
    if (callbacks_.count(entity.key) != 0 || entity.owner != nullptr) continue;
    absent.push_back({&entity, id_of(entity, next_index_)});
  }
  add(std::exchange(absent, {}), added);
  // Only now is it known which waitables call their timers themselves.
  for (const Entity &entity : found) {
    if (callbacks_.count(entity.key) != 0 || entity.owner == nullptr || is_called_by_owner(entity)) continue;
    absent.push_back({&entity, id_of(entity, next_index_)});
  }
  add(std::exchange(absent, {}), added);
  const std::vector<Placed> plain = still_plain();
  if (look == Look::Everywhere) {
    for (const Placed &placed : plain) {
      remove(placed.entity);
      absent.push_back({present.at(placed.entity), placed.callback->id()});
    }
    add(std::move(absent), added);
    connect();
  } else if (plain.empty()) {
    connect();
  } else {
    collect();  // their entities are in other groups
  }
  if (!added.empty() && rclcpp::ok(context_)) find_leftovers(context_, added);
}

// True for the timer of a waitable that a wait set watches, or that is no callback of its own.
bool Registry::is_called_by_owner(const Entity &entity) const {
  if (entity.owner == nullptr) return false;
  const auto owner = callbacks_.find(entity.owner);
  return owner == callbacks_.end() || owner->second.callback->in_wait_set();
}

std::vector<Entity> Registry::find(Look look) {
  // Read before the nodes are. A group that is created meanwhile is left for the next time; otherwise it would lack its
  // node.
  struct Position {
    std::size_t order = SIZE_MAX;
    std::string node;
    bool is_default = false;
  };
  std::map<rclcpp::CallbackGroup::SharedPtr, Position> positions;
  for (const auto &weak : groups_()) {
    const auto group = weak.lock();
    if (group && (look == Look::Everywhere || group_names_.count(group) == 0)) positions.try_emplace(group);
  }
  if (positions.empty()) return {};
  std::erase_if(group_names_, [](const auto &known) { return known.first.expired(); });
  // rclcpp's order is that of addresses. Names that are counted, and ties of priorities, have to be the same in each
  // run.
  std::size_t order = 0;
  const auto set_node = [&](const rclcpp::CallbackGroup::SharedPtr &group, NodeBase &node) {
    const auto position = positions.find(group);
    if (position == positions.end() || position->second.order != SIZE_MAX) return;
    position->second = {order++, node.get_fully_qualified_name(), group == node.get_default_callback_group()};
  };
  for (const auto &weak : nodes_) {
    const auto node = weak.lock();
    if (node) node->for_each_callback_group([&](const auto &group) { set_node(group, *node); });
  }
  for (const auto &[weak, weak_node] : manual_groups_) {
    const auto group = weak.lock();
    const auto node = weak_node.lock();
    if (group && node) set_node(group, *node);
  }
  std::vector<std::pair<Position, rclcpp::CallbackGroup::SharedPtr>> ordered;
  for (auto &[group, position] : positions) ordered.emplace_back(std::move(position), group);
  std::stable_sort(ordered.begin(), ordered.end(), [](auto &a, auto &b) { return a.first.order < b.first.order; });

  std::vector<Entity> result;
  for (const auto &[position, group] : ordered) {
    (void)group_name(group);  // Watches empty groups, too, because an entity may be created in them.
    const std::size_t first = result.size();
    find_entities(group, result);
    for (std::size_t i = first; i < result.size(); ++i) {
      result[i].id.node = position.node;
      result[i].in_default_group = position.is_default;
    }
  }
  return result;
}

// The scheduler's name for a mutually exclusive group; "" for a reentrant one. The first call for a group also watches
// it for new entities.
std::string Registry::group_name(const rclcpp::CallbackGroup::SharedPtr &group) {
  const auto [entry, is_new] = group_names_.try_emplace(group);
  if (is_new) {
    entry->second = "g" + std::to_string(next_group_++);
    if (const auto condition = compat::notify_guard_condition(*group, context_)) watch(*condition);
  }
  return group->type() == rclcpp::CallbackGroupType::MutuallyExclusive ? entry->second : std::string();
}

// Another executor can have the group next.
void Registry::forget_group(const rclcpp::CallbackGroup::SharedPtr &group) {
  left_groups_.insert(group.get());
  if (group_names_.erase(group) > 0) stop_watching(*group);
}

void Registry::stop_watching(rclcpp::CallbackGroup &group) const {
  const auto condition = compat::notify_guard_condition(group, context_);
  if (condition) condition->set_on_trigger_callback(nullptr);
}

redag::CallbackId Registry::id_of(const Entity &found, Counters &counters) const {
  redag::CallbackId id = found.id;
  if (found.name_of) id.name = found.name_of(*context_);
  // The timers of waitables are numbered on their own. Otherwise the numbers that a workload states would depend on the
  // distribution.
  const int kind = found.owner == nullptr ? static_cast<int>(id.kind) : -1;
  if (id.name.empty() || found.owner != nullptr) id.index = counters[{id.node, kind}]++;
  return id;
}

// Together, since a change of the tasks costs the engine time for each that it has.
void Registry::add(std::vector<Found> found, Added &added) {
  if (found.empty()) return;
  std::vector<TaskTable::Entry> entries;
  std::vector<redag::runtime::NewTask> tasks;
  for (Found &one : found) {
    TaskTable::Entry &entry = entries.emplace_back();
    entry.id = std::move(one.id);
    entry.in_default_group = one.entity->in_default_group;
    place(entry, *one.entity);
    const Place its_place{entry.dag, entry.position};

    const std::shared_ptr<Callback> callback = one.entity->make(executor_.lock(), entry.id);
    entry.callback = callback;
    callback->set_deadline(entry.task.deadline);
    // A timer waits for predecessors that come later, too. Other callbacks are then added anew: see still_plain().
    const bool is_timer = entry.id.kind == redag::Callback::Kind::Timer;
    const bool waits = entry.configured && callback->can_join() && (is_timer || has_predecessor(its_place));
    if (waits) entry.task.activation = callback->join();
    if (entry.configured) placed_.emplace(its_place, Placed{callback, one.entity->key, waits});
    tasks.push_back({dag_ids_[entry.dag], entry.rank, entry.task,
                     [callback](const redag::runtime::Job &job) { return callback->execute(job); }, callback});
  }
  const std::vector<redag::TaskId> ids = parts_.engine.add_tasks(std::move(tasks));
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const std::shared_ptr<Callback> callback = entries[i].callback;
    entries[i].execution = parts_.engine.figures(ids[i]).execution;
    parts_.tasks.set(ids[i], std::move(entries[i]));
    callbacks_[found[i].entity->key] = {callback, found[i].entity->group.get()};
    added.push_back(callback);
    if (callback->attach(ids[i])) parts_.bridge.add(callback);
  }
}

// Decides which task of which DAG the callback is, and with which parameters.
void Registry::place(TaskTable::Entry &entry, const Entity &found) {
  Task &task = entry.task;
  entry.dag = static_cast<std::uint32_t>(dag_ids_.size() - 1);
  if (const auto ref = matcher_ ? matcher_->find(entry.id) : std::nullopt) {
    task = *ref->task;
    entry.dag = ref->dag.value;
    entry.position = ref->index;
    entry.rank = redag::topological_ranks((*options_.workload)->dags[entry.dag])[ref->index];
    entry.configured = true;
  }
  if (task.period == 0) task.period = entry.id.period > 0 ? entry.id.period : options_.default_period.count();
  if (task.deadline == 0) task.deadline = task.period;
  task.period = std::min(task.period, redag::kMaxDuration);  // some timers mean "never"
  task.deadline = std::min(task.deadline, redag::kMaxDuration);
  // ROS decides what releases the jobs, and which jobs must not overlap. connect() states the predecessors.
  task.activation = redag::Activation::Timer;
  task.predecessors.clear();
  task.waits.clear();  // what its body waits for counts
  task.offset = 0;
  task.jitter = 0;
  task.overrun = redag::Overrun::Skip;
  task.group = group_name(found.group);
  task.concurrency = task.group.empty() ? workers_ : 1;
}

void Registry::remove(const void *entity) {
  const auto known = callbacks_.extract(entity);
  if (known.empty()) return;  // the destructor of a user's object has removed it meanwhile
  const std::shared_ptr<Callback> callback = known.mapped().callback;
  std::erase_if(placed_, [&](const auto &placed) { return placed.second.callback == callback; });
  callback->detach();
  parts_.timer.settle();  // afterwards the id may be another task's
  parts_.bridge.remove(*callback);
  const redag::TaskId task = callback->task();
  connect_to(task, {});
  for (const auto &[successor, its] : std::map(predecessors_)) {
    if (std::find(its.begin(), its.end(), task) == its.end()) continue;
    std::vector<redag::TaskId> left = its;
    std::erase(left, task);
    connect_to(successor, std::move(left));
  }
  parts_.tasks.drop(task);
  parts_.engine.remove_task(task);
}

// ---- precedence ----

// Finds the tasks of the workload that have a callback, or will have one after this collect().
void Registry::find_places(const std::vector<Entity> &found) {
  places_.clear();
  if (!matcher_) return;
  for (const auto &[place, placed] : placed_) ++places_[place];
  Counters counters = next_index_;
  for (const Entity &entity : found) {
    if (callbacks_.count(entity.key) != 0 || entity.owner != nullptr) continue;
    if (const auto ref = matcher_->find(id_of(entity, counters))) ++places_[{ref->dag.value, ref->index}];
  }
}

const Task &Registry::task_at(Place place) const { return (*options_.workload)->dags[place.first].tasks[place.second]; }

const std::vector<std::uint32_t> &Registry::predecessors_of(Place place) const {
  static const std::vector<std::uint32_t> none;
  const bool executed = (*options_.workload)->dags[place.first].edges == redag::Edges::Executed;
  return executed ? task_at(place).predecessors : none;
}

// A task of several callbacks, perhaps of different rates, has no one end to wait for.
bool Registry::has_predecessor(Place place) const {
  const std::vector<std::uint32_t> &predecessors = predecessors_of(place);
  return std::any_of(predecessors.begin(), predecessors.end(), [&](std::uint32_t p) REDAG_REQUIRES(collect_lock_) {
    const auto callbacks = places_.find({place.first, p});
    return callbacks != places_.end() && callbacks->second == 1;
  });
}

// Returns the callbacks that were added before any of their predecessors, and that could wait for one now.
std::vector<Registry::Placed> Registry::still_plain() const {
  std::vector<Placed> plain;
  for (const auto &[place, placed] : placed_) {
    if (!placed.waits && has_predecessor(place) && placed.callback->can_join()) plain.push_back(placed);
  }
  return plain;
}

// Tells the engine which callbacks each callback waits for: those of its predecessors in the workload that are present.
void Registry::connect() {
  for (const auto &[place, placed] : placed_) {
    std::vector<redag::TaskId> predecessors;
    for (const std::uint32_t p : predecessors_of(place)) {
      const auto [first, last] = placed_.equal_range({place.first, p});
      if (const auto callbacks = std::distance(first, last); callbacks == 1) {
        predecessors.push_back(first->second.callback->task());
      } else if (callbacks > 1) {
        warn(fmt::format("{} does not wait for {}, which is {} callbacks: let the workload file name one of them",
                         name_at(place), name_at({place.first, p}), callbacks));
      }
    }
    if (placed.waits) connect_to(placed.callback->task(), std::move(predecessors));
  }
}

redag::Time Registry::look_at_edges(redag::Time now) {
  constexpr Duration kBetweenLooks = redag::kSecond;
  constexpr Duration kLongWait = 10;  // periods
  const redag::LockGuard guard(collect_lock_);
  if (predecessors_.empty()) return redag::kNever;
  for (const auto &[place, placed] : placed_) {
    if (!placed.callback->alive()) stale_ = true;
    if (!placed.waits) continue;
    const std::optional<redag::Time> since = placed.callback->waits_since();
    if (!since || now - *since < std::max(kBetweenLooks, kLongWait * task_at(place).period)) continue;
    std::vector<std::string> names;
    for (const std::uint32_t p : predecessors_of(place)) names.push_back(name_at({place.first, p}));
    warn(fmt::format("{} has a message, and waits for the end of {}, which does not come", name_at(place),
                     fmt::join(names, " or ")));
  }
  return now + kBetweenLooks;
}

std::string Registry::name_at(Place place) const {
  return (*options_.workload)->dags[place.first].name + "." + task_at(place).name;
}

void Registry::warn(std::string text) {
  if (parts_.notes.warn(text)) RCLCPP_WARN(rclcpp::get_logger("redag_rclcpp"), "%s", text.c_str());
}

void Registry::connect_to(redag::TaskId task, std::vector<redag::TaskId> predecessors) {
  std::vector<redag::TaskId> &known = predecessors_[task];
  if (known != predecessors) {
    const Time before = parts_.engine.now();
    parts_.engine.set_predecessors(task, predecessors);
    parts_.tasks.set_predecessors(task, predecessors, before, parts_.engine.now());
    known = std::move(predecessors);
  }
  if (known.empty()) predecessors_.erase(task);
}

// ---- rates and names ----

std::size_t Registry::adopt_rates() {
  const redag::LockGuard guard(collect_lock_);
  for (const auto &[task, period] : parts_.tasks.adopt_rates()) parts_.engine.set_timing(task, period, period);
  return parts_.tasks.count_learned();
}

std::vector<std::string> Registry::unmatched() const {
  const redag::LockGuard guard(collect_lock_);
  return matcher_ ? matcher_->unmatched() : std::vector<std::string>{};
}

}  // namespace redag_rclcpp
