// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Registry keeps the engine's tasks in step with the entities of the executor's nodes and callback groups. It owns the
// callbacks, and decides which task of which DAG each of them is.
//
// Threads: any thread may call it; collect_lock_ serialises collect() and changes. Lock order: collect_lock_, rclcpp's,
// the callbacks', the timer queue's, the engine's.
#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "entities/bridge.hpp"
#include "entities/callback.hpp"
#include "entities/entities.hpp"
#include "rclcpp/callback_group.hpp"
#include "rclcpp/context.hpp"
#include "rclcpp/node_interfaces/node_base_interface.hpp"
#include "recursive_mutex.hpp"
#include "redag/base/lock_guard.hpp"
#include "redag/loader/callback_match.hpp"
#include "redag_rclcpp/executor.hpp"
#include "release_timer.hpp"
#include "task_table.hpp"
#include "watch/notes.hpp"

namespace redag_rclcpp {

using NodeBase = rclcpp::node_interfaces::NodeBaseInterface;

class Registry {
 public:
  /// The other parts of the executor, which outlive the registry.
  struct Parts {
    redag::runtime::Engine &engine;
    ReleaseTimer &timer;
    Bridge &bridge;
    TaskTable &tasks;
    Notes &notes;
  };
  using Groups = std::function<std::vector<rclcpp::CallbackGroup::WeakPtr>()>;

  /// `options` outlive the registry. `workers` of the executor. Adds the DAGs of `parts.tasks` to the engine.
  Registry(rclcpp::Context::SharedPtr context, const ReDAGOptions &options, std::uint32_t workers, const Parts &parts);

  /// Must be called before everything else. `groups` returns all groups that are to be executed.
  void open(const std::shared_ptr<ExecutorContext> &executor, Groups groups);
  /// Removes all callbacks. Later collects do nothing.
  void close();

  /// Runs `change` as one step: a thread that collects sees all of it or nothing. It tells rclcpp and the registry what
  /// is to be executed, by the functions below. Then collects.
  void change(const std::function<void()> &change);
  void add_node(const NodeBase::SharedPtr &node);
  void remove_node(const NodeBase::SharedPtr &node);
  /// Holds `instance` until the callbacks of the node are gone and have ended. Call it before remove_node().
  void keep_until_done(NodeBase &node, const std::shared_ptr<void> &instance);
  void add_group(const rclcpp::CallbackGroup::SharedPtr &group, const NodeBase::SharedPtr &node);
  void remove_group(const rclcpp::CallbackGroup::SharedPtr &group);

  /// Adds and removes tasks until they match the entities in the groups.
  void collect() { collect(Look::Everywhere); }
  /// True if entities may have come or gone since the last collect().
  [[nodiscard]] bool is_stale() const { return stale_; }
  /// Returns true if it was stale before.
  bool set_stale() { return stale_.exchange(true); }

  /// Finds callbacks that were destroyed, of which rclcpp does not tell, if others wait for them. Warns of callbacks
  /// that wait for long. Returns when to look again; kNever: no callback waits for others.
  redag::Time look_at_edges(redag::Time now);

  /// Gives callbacks the rates that were learned. Returns their number.
  std::size_t adopt_rates();
  /// The tasks of the workload that no callback matches, as text.
  [[nodiscard]] std::vector<std::string> unmatched() const;

 private:
  enum class Look : std::uint8_t { Everywhere, InNewGroups };

  void collect(Look look);
  void forget_gone_nodes() REDAG_REQUIRES(collect_lock_);
  /// Next index of a nameless entity, by node and kind; -1: timers of waitables.
  using Counters = std::map<std::pair<std::string, int>, std::uint32_t>;
  /// A task of the workload: its DAG, and its position there.
  using Place = std::pair<std::uint32_t, std::uint32_t>;
  struct Known {
    std::shared_ptr<Callback> callback;
    const rclcpp::CallbackGroup *group = nullptr;
  };
  struct Placed {
    std::shared_ptr<Callback> callback;
    const void *entity = nullptr;
    bool waits = false;  // for the predecessors that are present
  };

  [[nodiscard]] redag::CallbackId id_of(const Entity &found, Counters &counters) const;
  /// An entity that gets a callback.
  struct Found {
    const Entity *entity;
    redag::CallbackId id;
  };
  using Added = std::vector<std::shared_ptr<WaitSetMember>>;
  void add(std::vector<Found> found, Added &added) REDAG_REQUIRES(collect_lock_);
  void find_places(const std::vector<Entity> &found) REDAG_REQUIRES(collect_lock_);
  [[nodiscard]] const redag::Task &task_at(Place place) const;
  [[nodiscard]] std::string name_at(Place place) const;
  void warn(std::string text);
  [[nodiscard]] const std::vector<std::uint32_t> &predecessors_of(Place place) const;
  [[nodiscard]] bool has_predecessor(Place place) const REDAG_REQUIRES(collect_lock_);
  [[nodiscard]] std::vector<Placed> still_plain() const REDAG_REQUIRES(collect_lock_);
  void connect() REDAG_REQUIRES(collect_lock_);
  void connect_to(redag::TaskId task, std::vector<redag::TaskId> predecessors) REDAG_REQUIRES(collect_lock_);
  void remove(const void *entity) REDAG_REQUIRES(collect_lock_);
  void place(TaskTable::Entry &entry, const Entity &found) REDAG_REQUIRES(collect_lock_);
  void watch(rclcpp::GuardCondition &condition) const;
  void stop_watching(rclcpp::CallbackGroup &group) const;
  [[nodiscard]] std::vector<Entity> find(Look look) REDAG_REQUIRES(collect_lock_);
  [[nodiscard]] bool is_called_by_owner(const Entity &entity) const REDAG_REQUIRES(collect_lock_);
  [[nodiscard]] std::string group_name(const rclcpp::CallbackGroup::SharedPtr &group) REDAG_REQUIRES(collect_lock_);
  void forget_group(const rclcpp::CallbackGroup::SharedPtr &group) REDAG_REQUIRES(collect_lock_);

  const rclcpp::Context::SharedPtr context_;
  const ReDAGOptions &options_;
  const std::uint32_t workers_;
  const Parts parts_;
  std::vector<redag::DagId> dag_ids_;  // ids of parts_.tasks.dags()
  std::weak_ptr<ExecutorContext> executor_;
  Groups groups_;
  std::atomic<bool> stale_{true};

  template <class T>
  using ByGroup = std::map<rclcpp::CallbackGroup::WeakPtr, T, std::owner_less<rclcpp::CallbackGroup::WeakPtr>>;

  mutable RecursiveMutex collect_lock_;  // recursive: destructors of users' objects run while it is held
  std::unique_ptr<redag::CallbackMatcher> matcher_ REDAG_PT_GUARDED_BY(collect_lock_);  // null: no workload
  std::vector<NodeBase::WeakPtr> nodes_ REDAG_GUARDED_BY(collect_lock_);
  std::map<const void *, Known> callbacks_ REDAG_GUARDED_BY(collect_lock_);  // by entity
  std::multimap<Place, Placed> placed_ REDAG_GUARDED_BY(collect_lock_);      // callbacks that the workload names
  std::map<Place, int> places_ REDAG_GUARDED_BY(collect_lock_);              // how many, with those yet to be added
  std::map<redag::TaskId, std::vector<redag::TaskId>> predecessors_ REDAG_GUARDED_BY(collect_lock_);  // the engine's
  ByGroup<std::string> group_names_ REDAG_GUARDED_BY(collect_lock_);
  std::set<const rclcpp::CallbackGroup *> left_groups_ REDAG_GUARDED_BY(collect_lock_);  // since the last collect()
  ByGroup<NodeBase::WeakPtr> manual_groups_ REDAG_GUARDED_BY(collect_lock_);
  Counters next_index_ REDAG_GUARDED_BY(collect_lock_);
  std::uint64_t next_group_ REDAG_GUARDED_BY(collect_lock_) = 0;
  bool closed_ REDAG_GUARDED_BY(collect_lock_) = false;
};

}  // namespace redag_rclcpp
