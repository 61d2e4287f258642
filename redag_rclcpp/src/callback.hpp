// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// One callback of a node as a task: its entity (timer, subscription, ...), the hooks that tell when it has something to
// do, what is pending, and how it is executed. Owns no entity: nodes can be destroyed at any time.
//
// An arrival (a message, request, ...) becomes a token. Of the tokens one at a time is a released job that waits in the
// scheduler; the others wait here, so that a long queue costs the scheduler nothing. When the job starts, the next
// token is released. Where the scheduler skips the job, its message is dropped, unread; but requests, responses and
// what waitables wait for are not data that the next ones replace: they are released again until they are taken.
//
// Threads: hooks are called by the middleware's and by publishing threads, with locks of theirs held; execute() by
// workers. Lock order: theirs, release_lock_, lock_, the timer queue's, the engine's. Nothing of rclcpp that takes
// locks is called with one of ours held.
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

/// What callbacks need of the executor.
class Intake {
 public:
  virtual ~Intake() = default;

  virtual redag::runtime::Engine &engine() = 0;
  virtual TimerQueue &timers() = 0;
  /// May arrivals be released to the scheduler at once? Otherwise note() collects who has some.
  [[nodiscard]] virtual bool direct() const = 0;
  /// Takes no lock but its own.
  virtual void note(std::shared_ptr<class Callback> callback) = 0;
  /// Somebody was noted: whoever waits for work looks again. Not with locks of ours held.
  virtual void wake() = 0;
  /// The queue's next() is earlier than it was.
  virtual void timers_changed() = 0;
  /// Something that the wait set saw has been dealt with.
  virtual void wait_set_changed() = 0;
  [[nodiscard]] virtual bool learning() const = 0;
};

class Callback final : public TimerQueue::Timer,
                       public Hooked,
                       public redag::runtime::SkipListener,
                       public std::enable_shared_from_this<Callback> {
 public:
  Callback(std::shared_ptr<Intake> intake, redag::CallbackId id, const rclcpp::TimerBase::SharedPtr &timer);
  /// `intra_process`: the waitable through which the subscription gets messages of its own process; or null.
  Callback(std::shared_ptr<Intake> intake, redag::CallbackId id,
           const rclcpp::SubscriptionBase::SharedPtr &subscription, const rclcpp::Waitable::SharedPtr &intra_process);
  Callback(std::shared_ptr<Intake> intake, redag::CallbackId id, const rclcpp::ServiceBase::SharedPtr &service);
  Callback(std::shared_ptr<Intake> intake, redag::CallbackId id, const rclcpp::ClientBase::SharedPtr &client);
  /// `only_wait_set`: its on-ready hook does not tell of everything.
  Callback(std::shared_ptr<Intake> intake, redag::CallbackId id, const rclcpp::Waitable::SharedPtr &waitable,
           bool only_wait_set);

  /// Connects the entity: what arrives from now on is released as jobs of `task`. True if part of it can only be
  /// watched by a wait set: see waited().
  bool attach(TaskId task);
  /// Disconnects it: from now on no hook releases anything. Not with locks of ours held.
  void detach();

  /// Runs one job.
  redag::sched::Outcome execute(const redag::runtime::Job &job);

  /// Releases the first token, if none is released. For who collects note()d callbacks, and when direct() begins.
  void admit();

  // What a wait set has to watch for this callback; see Bridge.
  struct Waited {
    std::shared_ptr<const rcl_timer_t> timer;  // its guard condition tells of resets and jumps of time
    rclcpp::SubscriptionBase::SharedPtr subscription;
    rclcpp::ServiceBase::SharedPtr service;
    rclcpp::ClientBase::SharedPtr client;
    rclcpp::Waitable::SharedPtr waitable;
  };
  /// Nothing while an arrival that the wait set saw is not dealt with.
  [[nodiscard]] Waited waited() const;
  /// The entities with hooks; `waitable`: the intra-process part of a subscription.
  [[nodiscard]] Waited hooked() const;
  /// There is something in the middleware, or in the intra-process buffer, that no hook may have told of: takes until
  /// nothing is left.
  void take_leftovers(bool middleware, bool intra_process);
  /// The wait set saw an arrival.
  void seen_by_wait_set();
  /// The timer was reset or its clock jumped: looks when it is due.
  void look_at_timer();

  Time expire(Time now, std::vector<redag::runtime::Release> &releases,
              std::vector<redag::runtime::Release> &missed) override;
  void arrived_in_middleware(std::size_t count) noexcept override { arrived(count, Source::Middleware, 0); }
  void skipped(redag::Reason reason) noexcept override;

  /// Does the entity still exist?
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

  /// What was learned: tasks that published what arrived here, each once; and the mean time between arrivals that are
  /// handled (0: fewer than three).
  [[nodiscard]] std::vector<TaskId> publishers() const;
  [[nodiscard]] Duration mean_interval() const;

 private:
  enum class Source : std::uint8_t { Middleware, IntraProcess };
  struct Token {
    Time arrival = 0;
    Source source = Source::Middleware;
    int part = 0;                // of a waitable
    bool seen_only = false;      // by the wait set: what arrived has to be asked for
    bool after_skipped = false;  // there are messages to be dropped before it; set by take_token()
  };
  class Taking;

  static std::size_t index_of(Source source) { return static_cast<std::size_t>(source); }

  Callback(std::shared_ptr<Intake> intake, redag::CallbackId id);

  void hook();
  void unhook();
  void arrived(std::size_t count, Source source, int part, bool seen_only = false);
  enum class Overwritten : std::uint8_t {
    Skipped,   // a message whose job was skipped, and counted, before
    Released,  // that of the job that waits in the scheduler
    Waiting,   // that of a later token
    Started,   // that of a job that has started and not yet taken it: it takes the one that came instead
  };
  [[nodiscard]] Overwritten drop_oldest(Source source) REDAG_REQUIRES(lock_);
  void learn_from_arrival(Time now, std::size_t count, Source source) REDAG_REQUIRES(lock_);
  [[nodiscard]] bool take_token(Token &token);
  [[nodiscard]] bool begin_release(Time &arrival) REDAG_REQUIRES(lock_);
  void release(Time arrival);
  void drop_expiry();

  /// Does only the timer's guard condition tell of resets, or of jumps of time?
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
  redag::runtime::Engine &engine_;  // not after detach(), except by a job
  TaskId task_;

  std::shared_ptr<void> kept_until_done_;  // Core's collect_lock_

  std::weak_ptr<rclcpp::TimerBase> timer_;
  std::shared_ptr<const rcl_timer_t> timer_handle_;  // not the timer: that cancels it when it is destroyed
  std::weak_ptr<rclcpp::SubscriptionBase> subscription_;
  std::weak_ptr<rclcpp::Waitable> intra_process_;
  bool has_intra_process_ = false;
  std::weak_ptr<rclcpp::ServiceBase> service_;
  std::weak_ptr<rclcpp::ClientBase> client_;
  std::weak_ptr<rclcpp::Waitable> waitable_;
  std::size_t depth_ = 0;                 // arrivals that each source keeps; 0: all
  Hook hook_;                             // of the middleware
  std::atomic<bool> by_wait_set_{false};  // the entity cannot be hooked

  // Held while a hook releases, so that detach() can wait for it, but not while a worker takes its token: a worker that
  // wakes before the hook is done with the engine must not wait for the hook.
  redag::PiMutex release_lock_;

  mutable redag::PiMutex lock_;
  std::shared_ptr<Intake> intake_ REDAG_GUARDED_BY(lock_);  // null once detached
  TokenQueue<Token> tokens_ REDAG_GUARDED_BY(lock_);  // the first one is that of the released job, if there is one
  // By source. Messages are kept until the moment before they are taken: what arrives earlier may overwrite them.
  std::size_t kept_[2] REDAG_GUARDED_BY(lock_) = {0, 0};      // by the middleware
  std::size_t dropped_[2] REDAG_GUARDED_BY(lock_) = {0, 0};   // of these, whose jobs were skipped; they have no token
  std::size_t dropping_[2] REDAG_GUARDED_BY(lock_) = {0, 0};  // the same, before a job that has started: it drops them
  bool leftovers_[2] REDAG_GUARDED_BY(lock_) = {false, false};  // there may be more messages than tokens
  std::uint32_t released_ REDAG_GUARDED_BY(lock_) =
      0;  // jobs that wait in the scheduler, or whose skip is still to be told
  std::uint32_t releasers_ REDAG_GUARDED_BY(lock_) = 0;  // threads in release()
  bool noted_ REDAG_GUARDED_BY(lock_) = false;           // note()d, and not admitted since
  bool seen_ REDAG_GUARDED_BY(lock_) = false;            // by the wait set, and not dealt with
  std::vector<TaskId> publishers_ REDAG_GUARDED_BY(lock_);
  std::uint64_t arrivals_[2] REDAG_GUARDED_BY(lock_) = {0, 0};
  // From the middleware, where intra-process communication delivers messages, too.
  std::uint64_t takes_ REDAG_GUARDED_BY(lock_) = 0;  // that were tried
  std::uint64_t taken_ REDAG_GUARDED_BY(lock_) = 0;  // that found a message for the callback
  Time first_arrival_ REDAG_GUARDED_BY(lock_) = 0;
  Time last_arrival_ REDAG_GUARDED_BY(lock_) = 0;

  // Timers.
  rclcpp::JumpHandler::SharedPtr clock_watch_;  // of ROS time: simulation begins or ends
  Time last_release_ = redag::kNever;           // the timer queue's lock
  std::atomic<bool> uncalled_{false};           // released, and not called since
  std::atomic<bool> restarted_{false};          // its grid begins anew

  std::atomic<Duration> deadline_{redag::kNever};
  std::atomic<std::uint64_t> late_{0};
  redag::Histogram response_;
  redag::Histogram execution_;
};

}  // namespace redag_rclcpp
