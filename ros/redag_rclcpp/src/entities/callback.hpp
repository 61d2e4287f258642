// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Callback represents one callback of a node as a task. Each kind of entity (timer, subscription, ...) has a class of
// its own, in its own file; entities.hpp makes them. A callback owns no entity: nodes can be destroyed at any time.
//
// Threads: workers call execute(); any thread may call the rest. Lock order: the callers' locks, lock_, the timer
// queue's, the engine's. Functions of rclcpp that take locks are never called with lock_ held.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "entities/executor_context.hpp"
#include "entities/wait_set_member.hpp"
#include "redag/base/lock_guard.hpp"
#include "redag/base/pi_mutex.hpp"
#include "redag/engine/coroutine_body.hpp"
#include "redag/engine/engine.hpp"
#include "redag/loader/callback_match.hpp"
#include "timer_queue.hpp"
#include "watch/deadlock_detector.hpp"

namespace redag_rclcpp {

class Callback : public TimerQueue::Timer,
                 public WaitSetMember,
                 public redag::runtime::SkipListener,
                 public redag::runtime::CoroutineOwner,
                 public std::enable_shared_from_this<Callback> {
 public:
  /// True if its jobs can wait for other callbacks. False: somebody waits for an answer to each of its inputs.
  [[nodiscard]] virtual bool can_join() const { return false; }
  /// Called before attach() for a callback whose jobs do so. Returns what its task must be. Data: what arrives is one
  /// of its predecessors.
  [[nodiscard]] virtual redag::Activation join() { return redag::Activation::Timer; }
  /// Connects the entity: later arrivals are released as jobs of `task`. True if a wait set must watch it.
  bool attach(TaskId task) {
    task_ = task;
    in_wait_set_ = connect();
    return in_wait_set_;
  }
  /// What attach() returned.
  [[nodiscard]] bool in_wait_set() const { return in_wait_set_; }
  /// Disconnects the entity: hooks release nothing any more. The caller holds no lock of a callback.
  virtual void detach() = 0;

  /// Runs one job. NoData: there was nothing to execute.
  redag::sched::Outcome execute(const redag::runtime::Job &job);

  /// Called in one of its jobs, before a coroutine begins in it. Throws std::logic_error if jobs cannot wait now.
  void let_wait() const;
  /// See ExecutorContext.
  [[nodiscard]] redag::runtime::DeviceHandle device(const std::string &name) const;
  /// True if the middleware takes messages back when the callback returns.
  [[nodiscard]] virtual bool lends_messages() const { return false; }

  /// Releases what has arrived. Called for callbacks that ExecutorContext::note() collected.
  virtual void admit() = 0;

  /// True while the entity exists.
  [[nodiscard]] virtual bool alive() const = 0;
  /// True if the entity itself states the rate of its releases.
  [[nodiscard]] virtual bool has_rate() const = 0;
  /// The period that it states now; 0: none.
  [[nodiscard]] virtual Duration stated_period() const { return 0; }

  /// Learned values. publishers(): the tasks whose jobs published the messages that arrived here. mean_interval(): the
  /// mean time between arrivals that are handled; 0: fewer than three arrivals. has_learned(): they no longer change.
  [[nodiscard]] virtual std::vector<TaskId> publishers() const = 0;
  [[nodiscard]] virtual Duration mean_interval() const = 0;
  [[nodiscard]] virtual bool has_learned() const { return true; }

  /// For clients and servers of services and actions: which one, and the inputs that have arrived and were not taken,
  /// the oldest first.
  [[nodiscard]] virtual Exchange exchange() const { return {}; }
  [[nodiscard]] virtual std::vector<KeptInput> kept() const { return {}; }
  /// For callbacks that join others: when the oldest message arrived that waits for them.
  [[nodiscard]] virtual std::optional<Time> waits_since() const { return std::nullopt; }

  [[nodiscard]] const redag::CallbackId &id() const { return id_; }
  [[nodiscard]] TaskId task() const { return task_; }

  void set_deadline(Duration deadline) { deadline_.store(deadline, std::memory_order_relaxed); }
  /// Releases for which there was nothing to execute, because an earlier job came too late.
  [[nodiscard]] virtual std::uint64_t lost() const { return 0; }

  /// Destroys `object` with this callback: after detach(), when its jobs in progress have ended.
  void keep_until_done(std::shared_ptr<void> object) { kept_until_done_ = std::move(object); }

 protected:
  Callback(std::shared_ptr<ExecutorContext> context, redag::CallbackId id)
      : id_(std::move(id)), engine_(context->engine()), context_(std::move(context)) {}

  /// Leaves the executor, as part of detach(). The caller destroys the result without a lock.
  [[nodiscard]] std::shared_ptr<ExecutorContext> leave() REDAG_REQUIRES(lock_);
  [[nodiscard]] redag::runtime::Engine &engine() const { return engine_; }
  [[nodiscard]] Duration deadline() const { return deadline_.load(std::memory_order_relaxed); }

  mutable redag::PiMutex lock_;
  /// Null once detached: the engine may no longer exist, and only jobs may use it.
  [[nodiscard]] const std::shared_ptr<ExecutorContext> &context() const REDAG_REQUIRES(lock_) { return context_; }

 private:
  /// See attach(); the task is set.
  virtual bool connect() = 0;
  /// Runs the callback for one job, released at `release`. False: there was nothing to execute.
  [[nodiscard]] virtual bool run(Time release) = 0;
  /// Throws redag::WaitCancelled once detached.
  [[nodiscard]] std::shared_ptr<ExecutorContext> context_now() const REDAG_EXCLUDES(lock_);

  const redag::CallbackId id_;
  redag::runtime::Engine &engine_;
  TaskId task_;
  bool in_wait_set_ = false;
  std::shared_ptr<ExecutorContext> context_ REDAG_GUARDED_BY(lock_);
  std::shared_ptr<void> kept_until_done_;  // guarded by Registry::collect_lock_
  std::atomic<Duration> deadline_{redag::kNever};
};

/// The callback whose job the calling thread runs. Throws std::logic_error if there is none that may wait.
[[nodiscard]] Callback &this_callback();

}  // namespace redag_rclcpp
