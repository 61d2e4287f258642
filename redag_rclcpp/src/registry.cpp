// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Collects the entities of the executor's callback groups as tasks of the engine.
#include <algorithm>
#include <set>
#include <stdexcept>
#include <utility>

#include "compat.hpp"
#include "core.hpp"
#include "redag/model/validate.hpp"

namespace redag_rclcpp {

using redag::Task;
using Kind = redag::Callback::Kind;

/// An entity found in a callback group.
struct ReDAGExecutor::Core::Entity {
  const void *key = nullptr;
  Kind kind = Kind::Timer;
  std::string node;
  rclcpp::CallbackGroup::SharedPtr group;
  rclcpp::TimerBase::SharedPtr timer;
  rclcpp::SubscriptionBase::SharedPtr subscription;
  rclcpp::Waitable::SharedPtr intra_process;
  rclcpp::ServiceBase::SharedPtr service;
  rclcpp::ClientBase::SharedPtr client;
  rclcpp::Waitable::SharedPtr waitable;
};

void ReDAGExecutor::Core::change(const std::function<void()> &change) {
  {
    const redag::LockGuard guard(collect_lock_);
    change();
  }
  collect();
}

void ReDAGExecutor::Core::add_node(const NodeBase::SharedPtr &node) {
  collect_lock_.assert_held();  // see change()
  forget_gone_nodes();
  nodes_.push_back(node);
  node->get_notify_guard_condition().set_on_trigger_callback([weak = weak_from_this()](std::size_t) {
    if (const auto core = weak.lock()) core->mark_dirty();
  });
}

void ReDAGExecutor::Core::remove_node(const NodeBase::SharedPtr &node) {
  collect_lock_.assert_held();  // see change()
  std::erase_if(nodes_, [&](const NodeBase::WeakPtr &weak) { return weak.lock() == node; });
  forget_gone_nodes();
  node->get_notify_guard_condition().set_on_trigger_callback(nullptr);
}

void ReDAGExecutor::Core::keep_until_done(NodeBase &node, const std::shared_ptr<void> &instance) {
  const redag::LockGuard guard(collect_lock_);
  const auto keep = [&](const auto &entity) {
    collect_lock_.assert_held();
    const auto callback = callbacks_.find(entity.get());
    if (callback != callbacks_.end()) callback->second->keep_until_done(instance);
  };
  node.for_each_callback_group([&](const rclcpp::CallbackGroup::SharedPtr &group) {
    // Other groups were added to an executor on their own, and stay there.
    if (group->automatically_add_to_executor_with_node()) group->collect_all_ptrs(keep, keep, keep, keep, keep);
  });
}

void ReDAGExecutor::Core::add_group(const rclcpp::CallbackGroup::SharedPtr &group, const NodeBase::SharedPtr &node) {
  collect_lock_.assert_held();  // see change()
  forget_gone_nodes();
  manual_groups_[group] = node;
}

void ReDAGExecutor::Core::remove_group(const rclcpp::CallbackGroup::SharedPtr &group) {
  collect_lock_.assert_held();  // see change()
  manual_groups_.erase(group);
}

// Forgets nodes that were destroyed without being removed. The counters of their names begin anew with a node of the
// same name.
void ReDAGExecutor::Core::forget_gone_nodes() {
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

void ReDAGExecutor::Core::mark_dirty() {
  if (dirty_.exchange(true)) return;
  keeper_parker_.unpark();
  if (waiting_) bridge_.wake();
}

void ReDAGExecutor::Core::collect() {
  // Declared before the lock guard: if `found` is the last owner of a user's object, that object is destroyed without
  // the lock.
  std::vector<Entity> found;
  const redag::LockGuard guard(collect_lock_);
  if (closed_) return;
  dirty_ = false;
  found = find_entities();
  std::map<const void *, const Entity *> present;
  for (const Entity &entity : found) present.emplace(entity.key, &entity);

  std::vector<std::shared_ptr<Callback>> gone;
  for (const auto &[key, callback] : callbacks_) {
    if (present.count(key) == 0 || !callback->alive()) gone.push_back(callback);
  }
  for (const auto &callback : gone) remove(callback);
  std::vector<std::shared_ptr<Callback>> added;
  for (const Entity &entity : found) {
    if (callbacks_.count(entity.key) != 0) continue;
    add(entity);
    added.push_back(callbacks_.at(entity.key));
  }
  if (!added.empty() && rclcpp::ok(context_)) find_leftovers(context_, added);
}

std::vector<ReDAGExecutor::Core::Entity> ReDAGExecutor::Core::find_entities() {
  // Read before the nodes are. A group that is created meanwhile is left for the next time; otherwise it would lack its
  // node.
  const auto groups = hooks_.groups();
  std::map<const rclcpp::CallbackGroup *, std::string> nodes;
  for (const auto &weak : nodes_) {
    if (const auto node = weak.lock()) {
      node->for_each_callback_group([&](const rclcpp::CallbackGroup::SharedPtr &group) {
        nodes.emplace(group.get(), node->get_fully_qualified_name());
      });
    }
  }
  for (const auto &[group, weak] : manual_groups_) {
    const auto node = weak.lock();
    if (const auto strong = group.lock(); strong && node) {
      nodes.emplace(strong.get(), node->get_fully_qualified_name());
    }
  }

  std::vector<Entity> result;
  for (const auto &weak : groups) {
    const auto group = weak.lock();
    if (!group) continue;
    (void)group_name(group);  // Watches empty groups, too, because an entity may be created in them.
    Entity base;
    base.group = group;
    base.node = nodes[group.get()];
    std::set<const void *> intra_process;
    const auto push = [&](const void *key, Kind kind) -> Entity & {
      result.push_back(base);
      result.back().key = key;
      result.back().kind = kind;
      return result.back();
    };
    group->collect_all_ptrs(
        [&](const rclcpp::SubscriptionBase::SharedPtr &subscription) {
          Entity &found = push(subscription.get(), Kind::Subscription);
          found.subscription = subscription;
          try {
            found.intra_process = subscription->get_intra_process_waitable();
          } catch (const std::runtime_error &) {
            // The subscription's intra-process manager is already gone.
          }
          if (found.intra_process) intra_process.insert(found.intra_process.get());
        },
        [&](const rclcpp::ServiceBase::SharedPtr &service) { push(service.get(), Kind::Service).service = service; },
        [&](const rclcpp::ClientBase::SharedPtr &client) { push(client.get(), Kind::Client).client = client; },
        [&](const rclcpp::TimerBase::SharedPtr &timer) { push(timer.get(), Kind::Timer).timer = timer; },
        [&](const rclcpp::Waitable::SharedPtr &waitable) {
          if (intra_process.count(waitable.get()) == 0) push(waitable.get(), Kind::Waitable).waitable = waitable;
        });
  }
  return result;
}

// The scheduler's name for a mutually exclusive group; "" for a reentrant one. The first call for a group also watches
// it for new entities.
std::string ReDAGExecutor::Core::group_name(const rclcpp::CallbackGroup::SharedPtr &group) {
  const auto [entry, is_new] = group_names_.try_emplace(group);
  if (is_new) {
    entry->second = "g" + std::to_string(next_group_++);
    watch_group(*group, [weak = weak_from_this()](std::size_t) {
      if (const auto core = weak.lock()) core->mark_dirty();
    });
    std::erase_if(group_names_, [](const auto &known) { return known.first.expired(); });
  }
  return group->type() == rclcpp::CallbackGroupType::MutuallyExclusive ? entry->second : std::string();
}

void ReDAGExecutor::Core::watch_group(rclcpp::CallbackGroup &group, const std::function<void(std::size_t)> &callback) {
  const auto condition = compat::notify_guard_condition(group, context_);
  if (condition) condition->set_on_trigger_callback(callback);
}

void ReDAGExecutor::Core::add(const Entity &found) {
  TaskTable::Entry entry;
  entry.id.kind = found.kind;
  entry.id.node = found.node;
  if (found.subscription) entry.id.name = found.subscription->get_topic_name();
  if (found.service) entry.id.name = found.service->get_service_name();
  if (found.client) entry.id.name = found.client->get_service_name();
  if (found.timer) {
    std::int64_t period = 0;
    if (rcl_timer_get_period(found.timer->get_timer_handle().get(), &period) == RCL_RET_OK) entry.id.period = period;
  }
  if (found.timer || found.waitable) {
    entry.id.index = next_index_[{found.node, static_cast<int>(found.kind)}]++;
  }
  place(entry, found);

  std::shared_ptr<Callback> callback;
  const auto self = shared_from_this();
  if (found.timer) callback = std::make_shared<Callback>(self, entry.id, found.timer);
  if (found.subscription) {
    callback = std::make_shared<Callback>(self, entry.id, found.subscription, found.intra_process);
  }
  if (found.service) callback = std::make_shared<Callback>(self, entry.id, found.service);
  if (found.client) callback = std::make_shared<Callback>(self, entry.id, found.client);
  if (found.waitable) {
    callback = std::make_shared<Callback>(self, entry.id, found.waitable, compat::needs_wait_set(*found.waitable));
  }
  entry.callback = callback;
  callback->set_deadline(entry.task.deadline);

  const redag::TaskId task = engine_->add_task(
      dag_ids_[entry.dag], entry.rank, entry.task,
      [callback](const redag::runtime::Job &job) { return callback->execute(job); }, callback);
  tasks_.set(task, std::move(entry));
  callbacks_[found.key] = callback;
  if (callback->attach(task)) bridge_.add(callback);
}

// Decides which task of which DAG the callback is, and with which parameters.
void ReDAGExecutor::Core::place(TaskTable::Entry &entry, const Entity &found) {
  Task &task = entry.task;
  entry.dag = static_cast<std::uint32_t>(dag_ids_.size() - 1);
  if (const auto ref = matcher_ ? matcher_->find(entry.id) : std::nullopt) {
    task = *ref->task;
    entry.dag = ref->dag.value;
    entry.rank = redag::topological_ranks(options_.workload->dags[entry.dag])[ref->index];
    entry.configured = true;
  }
  if (task.period == 0) task.period = entry.id.period > 0 ? entry.id.period : options_.default_period.count();
  if (task.deadline == 0) task.deadline = task.period;
  // ROS decides what releases the jobs, and which jobs must not overlap.
  task.activation = redag::Activation::Timer;
  task.predecessors.clear();
  task.offset = 0;
  task.jitter = 0;
  task.overrun = redag::Overrun::Skip;
  task.group = group_name(found.group);
  task.concurrency = task.group.empty() ? setup_.config.workers : 1;
}

void ReDAGExecutor::Core::remove(const std::shared_ptr<Callback> &gone) {
  const std::shared_ptr<Callback> callback = gone;
  const auto entry = std::find_if(callbacks_.begin(), callbacks_.end(), [&](auto &e) { return e.second == callback; });
  if (entry != callbacks_.end()) callbacks_.erase(entry);
  callback->detach();
  {
    // Waits until releases that left the timer queue earlier have been passed on. Afterwards the id may be another
    // task's.
    const redag::LockGuard guard(expire_lock_);
  }
  bridge_.remove(*callback);
  const redag::TaskId task = callback->task();
  tasks_.drop(task);
  engine_->remove_task(task);
}

}  // namespace redag_rclcpp
