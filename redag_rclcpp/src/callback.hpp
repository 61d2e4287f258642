// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Callback represents one callback of a node as a task. It connects the hooks of the entity (timer, subscription, ...),
// keeps the pending arrivals, and executes jobs. It owns no entity: nodes can be destroyed at any time.
//
// An arrival (a message, request, ...) becomes a token. One token at a time is a released job that waits in the
// scheduler. The others wait here: a long queue costs the scheduler nothing. When the job starts, the next token is
// released. If the scheduler skips a job, its message is dropped unread. Requests, responses and the arrivals of
// waitables are not replaced by later ones. Their tokens are released again until they are taken.
//
// Threads: the middleware's threads and publishing threads call the hooks, with their own locks held. Workers call
// execute(). Lock order: the callers' locks, release_lock_, lock_, the timer queue's, the engine's. Functions of rclcpp
// that take locks are never called with a lock of this class held.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <vector>

#include "hook.hpp"
#include "rclcpp/client.hpp"
#include "rclcpp/clock.hpp"
#include "rclcpp/service.hpp"
#include "rclcpp/subscription_base.hpp"
#include "rclcpp/timer.hpp"
#include "rclcpp/waitable.hpp"
#include "redag/base/histogram.hpp"
#include "redag/base/lock_guard.hpp"
#include "redag/base/pi_mutex.hpp"
#include "redag/model/callback_match.hpp"
#include "redag/runtime/engine.hpp"
#include "timer_queue.hpp"
#include "token_queue.hpp"

namespace redag_rclcpp {

/// The part of the executor that callbacks use.
class ExecutorContext {
 public:
  virtual ~ExecutorContext() = default;

  virtual redag::runtime::Engine &engine() = 0;
  virtual TimerQueue &timers() = 0;
  /// True if arrivals may be released to the scheduler at once. Otherwise note() collects callbacks with arrivals.
  [[nodiscard]] virtual bool direct() const = 0;
  /// Adds a callback to be admitted later. Takes no lock but its own.
  virtual void note(std::shared_ptr<class Callback> callback) = 0;
  /// Wakes the thread that waits for work, after note(). The caller holds no lock of this package.
  virtual void wake() = 0;
  /// Called when the queue's next() has become earlier.
  virtual void timers_changed() = 0;
  /// Called when a job has handled an arrival that the wait set saw.
  virtual void wait_set_changed() = 0;
  [[nodiscard]] virtual bool learning() const = 0;
};

class Callback final : public TimerQueue::Timer,
                       public Hooked,
                       public redag::runtime::SkipListener,
                       public std::enable_shared_from_this<Callback> {
 public:
  Callback(std::shared_ptr<ExecutorContext> intake, redag::CallbackId id, const rclcpp::TimerBase::SharedPtr &timer);
  /// `intra_process`: the waitable that brings the subscription messages of its own process, or null.
  Callback(std::shared_ptr<ExecutorContext> intake, redag::CallbackId id,
           const rclcpp::SubscriptionBase::SharedPtr &subscription, const rclcpp::Waitable::SharedPtr &intra_process);
  Callback(std::shared_ptr<ExecutorContext> intake, redag::CallbackId id,
           const rclcpp::ServiceBase::SharedPtr &service);
  Callback(std::shared_ptr<ExecutorContext> intake, redag::CallbackId id, const rclcpp::ClientBase::SharedPtr &client);
  /// `only_wait_set`: the waitable's on-ready hook does not report everything.
  Callback(std::shared_ptr<ExecutorContext> intake, redag::CallbackId id, const rclcpp::Waitable::SharedPtr &waitable,
           bool only_wait_set);

  /// Connects the entity: later arrivals are released as jobs of `task`. True if a wait set must watch part of it; see
  /// waited().
  bool attach(TaskId task);
  /// Disconnects the entity: hooks release nothing any more. The caller holds no lock of a callback.
  void detach();

  /// Runs one job. NoData: there was nothing to execute.
  redag::sched::Outcome execute(const redag::runtime::Job &job);

  /// Releases the first token, if none is released. Called for callbacks that note() collected.
  void admit();

  /// The parts of this callback that a wait set must watch; see Bridge.
  struct Waited {
    std::shared_ptr<const rcl_timer_t> timer;  // its guard condition reports resets and time jumps
    rclcpp::SubscriptionBase::SharedPtr subscription;
    rclcpp::ServiceBase::SharedPtr service;
    rclcpp::ClientBase::SharedPtr client;
    rclcpp::Waitable::SharedPtr waitable;
  };
  /// Empty while an arrival that the wait set saw has not been handled.
  [[nodiscard]] Waited waited() const;
  /// The entities with hooks. `waitable` is the intra-process part of a subscription.
  [[nodiscard]] Waited hooked() const;
  /// The middleware or the intra-process buffer holds messages that no hook may have reported. Releases jobs until
  /// nothing is left.
  void take_leftovers(bool middleware, bool intra_process);
  /// Releases a job for an arrival that the wait set saw.
  void seen_by_wait_set();
  /// Computes when the timer is due. Called after a reset or a jump of its clock.
  void look_at_timer();

  Time expire(Time now, std::vector<redag::runtime::Release> &releases,
              std::vector<redag::runtime::Release> &missed) override;
  void arrived_in_middleware(std::size_t count) noexcept override { arrived(count, Source::Middleware, 0); }
  void skipped(redag::Reason reason) noexcept override;

  /// True while the entity exists.
  [[nodiscard]] bool alive() const;
  [[nodiscard]] const redag::CallbackId &id() const { return id_; }
  [[nodiscard]] TaskId task() const { return task_; }
  [[nodiscard]] bool is_timer() const { return timer_handle_ != nullptr; }

  void set_deadline(Duration deadline) { deadline_.store(deadline, std::memory_order_relaxed); }
  [[nodiscard]] const redag::Histogram &response() const { return response_; }
  /// Destroys `object` with this callback: after detach(), when its jobs in progress have ended.
  void keep_until_done(std::shared_ptr<void> object) { kept_until_done_ = std::move(object); }

  [[nodiscard]] const redag::Histogram &execution() const { return execution_; }
  [[nodiscard]] std::uint64_t late() const { return late_.load(std::memory_order_relaxed); }

  /// Learned values. publishers(): the tasks whose jobs published the messages that arrived here. mean_interval(): the
  /// mean time between arrivals that are handled; 0: fewer than three arrivals.
  [[nodiscard]] std::vector<TaskId> publishers() const;
  [[nodiscard]] Duration mean_interval() const;

 private:
  enum class Source : std::uint8_t { Middleware, IntraProcess };
  struct Token {
    Time arrival = 0;
    Source source = Source::Middleware;
    int part = 0;                // number of the waitable's part
    bool seen_only = false;      // the wait set saw it, no hook
    bool after_skipped = false;  // set by take_token(): drop messages of skipped jobs first
  };
  class Taking;

  static std::size_t index_of(Source source) { return static_cast<std::size_t>(source); }

  Callback(std::shared_ptr<ExecutorContext> intake, redag::CallbackId id);

  void hook();
  void unhook();
  void arrived(std::size_t count, Source source, int part, bool seen_only = false);
  enum class Overwritten : std::uint8_t {
    Skipped,   // its job was skipped and counted before
    Released,  // its job waits in the scheduler
    Waiting,   // its token waits for a later release
    Started,   // its job has started, and takes the newer message instead
  };
  [[nodiscard]] Overwritten drop_oldest(Source source) REDAG_REQUIRES(lock_);
  void learn_from_arrival(Time now, std::size_t count, Source source) REDAG_REQUIRES(lock_);
  [[nodiscard]] bool take_token(Token &token);
  [[nodiscard]] bool begin_release(Time &arrival) REDAG_REQUIRES(lock_);
  void release(Time arrival);
  void drop_expiry();

  /// True if only the timer's guard condition reports resets, or jumps of its clock.
  [[nodiscard]] bool has_waited_timer() const;
  void watch_clock(rclcpp::TimerBase &timer);
  void reschedule();

  // False: there was nothing to do.
  [[nodiscard]] bool execute_timer();
  [[nodiscard]] bool execute_token(const Token &token);
  [[nodiscard]] bool execute_arrival(const Token &token, Taking &taking);
  [[nodiscard]] bool execute_subscription(rclcpp::SubscriptionBase &subscription, Taking &taking);
  [[nodiscard]] bool execute_service();
  [[nodiscard]] bool execute_client();
  [[nodiscard]] bool execute_waitable(rclcpp::Waitable &waitable, const Token &token);
  void drop_messages(Source source);
  template <class Take>
  void drop_messages(Source source, Take take) REDAG_EXCLUDES(lock_);

  const redag::CallbackId id_;
  redag::runtime::Engine &engine_;  // after detach() only jobs may use it
  TaskId task_;

  std::shared_ptr<void> kept_until_done_;  // guarded by Core::collect_lock_

  std::weak_ptr<rclcpp::TimerBase> timer_;
  std::shared_ptr<const rcl_timer_t> timer_handle_;  // the handle alone: the last owner of a timer cancels it
  std::weak_ptr<rclcpp::SubscriptionBase> subscription_;
  std::weak_ptr<rclcpp::Waitable> intra_process_;
  bool has_intra_process_ = false;
  std::weak_ptr<rclcpp::ServiceBase> service_;
  std::weak_ptr<rclcpp::ClientBase> client_;
  std::weak_ptr<rclcpp::Waitable> waitable_;
  std::size_t depth_ = 0;                 // arrivals that each source keeps; 0: all
  Hook hook_;                             // of the subscription, service or client
  std::atomic<bool> by_wait_set_{false};  // a wait set watches the entity

  // Held while a hook releases a job, which lets detach() wait for the hook. Not held while a worker takes its token: a
  // worker may wake before the hook is done with the engine, and must not wait for it.
  redag::PiMutex release_lock_;

  mutable redag::PiMutex lock_;
  std::shared_ptr<ExecutorContext> intake_ REDAG_GUARDED_BY(lock_);  // null once detached
  TokenQueue<Token> tokens_ REDAG_GUARDED_BY(lock_);                 // if a job is released, the first token is its
  // Indexed by source. The source keeps a message until the moment before it is taken. Earlier arrivals may overwrite
  // it.
  std::size_t kept_[2] REDAG_GUARDED_BY(lock_) = {0, 0};        // messages that the source keeps
  std::size_t dropped_[2] REDAG_GUARDED_BY(lock_) = {0, 0};     // part of kept_: their jobs were skipped; without token
  std::size_t dropping_[2] REDAG_GUARDED_BY(lock_) = {0, 0};    // part of kept_: to be dropped by the next job
  bool leftovers_[2] REDAG_GUARDED_BY(lock_) = {false, false};  // there may be more messages than tokens
  std::uint32_t released_ REDAG_GUARDED_BY(lock_) = 0;   // jobs in the scheduler, or whose skip it has yet to report
  std::uint32_t releasers_ REDAG_GUARDED_BY(lock_) = 0;  // number of threads in release()
  bool noted_ REDAG_GUARDED_BY(lock_) = false;           // noted by note(), not yet admitted
  bool seen_ REDAG_GUARDED_BY(lock_) = false;            // seen by the wait set, not yet handled
  std::vector<TaskId> publishers_ REDAG_GUARDED_BY(lock_);
  std::uint64_t arrivals_[2] REDAG_GUARDED_BY(lock_) = {0, 0};
  // Messages from the middleware, counted if intra-process communication delivers messages as well.
  std::uint64_t takes_ REDAG_GUARDED_BY(lock_) = 0;  // attempts to take one
  std::uint64_t taken_ REDAG_GUARDED_BY(lock_) = 0;  // attempts that found a message for the callback
  Time first_arrival_ REDAG_GUARDED_BY(lock_) = 0;
  Time last_arrival_ REDAG_GUARDED_BY(lock_) = 0;

  // Timers only.
  rclcpp::JumpHandler::SharedPtr clock_watch_;  // reports that simulated time begins or ends
  Time last_release_ = redag::kNever;           // guarded by the timer queue's lock
  std::atomic<bool> uncalled_{false};           // released, and not called since
  std::atomic<bool> restarted_{false};          // the timer's grid begins anew

  std::atomic<Duration> deadline_{redag::kNever};
  std::atomic<std::uint64_t> late_{0};
  redag::Histogram response_;
  redag::Histogram execution_;
};

}  // namespace redag_rclcpp
