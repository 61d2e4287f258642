// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// ArrivalCallback keeps the pending arrivals of an entity. An arrival (a message, request, ...) becomes a token. One
// token at a time is a released job that waits in the scheduler; the others wait here, and cost the scheduler nothing.
// When the job starts, the next token is released. If the scheduler skips a job, its message is dropped unread. Inputs
// that later ones do not replace (requests, responses) keep their tokens, which are released again until they are
// taken.
//
// A joined callback also waits for other callbacks. Then the scheduler releases the job once all of them have completed
// and a message is there, and the job takes the newest message that was there at its release. Older ones are dropped.
// Beside intra-process communication, the middleware can bring a message a second time. rclcpp does not take this copy,
// and the job goes on to the newest message of its process.
//
// Threads: the middleware's threads and publishing threads call the hooks, with their own locks held. An arrival
// and a job each take lock_ once, and the engine's lock once. Lock order: the callers' locks, lock_, the timer queue's,
// the engine's.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "entities/callback.hpp"
#include "entities/hook.hpp"
#include "entities/token_queue.hpp"
#include "redag/engine/in_progress.hpp"

namespace redag_rclcpp {

class ArrivalCallback : public Callback, public Hooked {
 public:
  void detach() override;
  void admit() override;
  [[nodiscard]] bool has_rate() const override { return false; }
  [[nodiscard]] std::vector<TaskId> publishers() const override;
  [[nodiscard]] Duration mean_interval() const override;
  [[nodiscard]] bool has_learned() const override;
  [[nodiscard]] std::vector<KeptInput> kept() const override;
  [[nodiscard]] std::optional<Time> waits_since() const override;
  [[nodiscard]] std::shared_ptr<void> hold() override { return entity(); }

  void arrived_in_middleware(std::size_t count) noexcept override { arrived(count, Source::Middleware, 0); }
  Time expire(Time now, std::vector<redag::runtime::Release> &releases,
              std::vector<redag::runtime::Release> &missed) override;
  void skipped(redag::Reason reason) noexcept override;

  [[nodiscard]] Held watched() const override;
  [[nodiscard]] Held hooked() const override;
  void seen_by_wait_set() override;
  void take_leftovers(const Held &held, rcl_wait_set_t &set, bool any) override;

 protected:
  enum class Source : std::uint8_t { Middleware, IntraProcess };
  struct Token {
    Time arrival = 0;
    Time origin = 0;  // of the message's data
    Source source = Source::Middleware;
    int part = 0;                // number of the waitable's part
    bool seen_only = false;      // the wait set saw it, no hook
    bool after_skipped = false;  // set by take_token(): drop messages of skipped jobs first
    redag::JobSlot sender;       // the job on whose thread it arrived, if any
  };

  // Taking guards the message that a started job is about to take. The middleware keeps this message until begin() and
  // may overwrite it; the job then takes the newer one. begin() is called as late as possible, because creating the
  // message to take into can take long.
  class Taking {
   public:
    Taking(ArrivalCallback &callback, Source source) : callback_(callback), source_(source) {}
    ~Taking();
    Taking(const Taking &) = delete;
    Taking &operator=(const Taking &) = delete;

    void begin();
    /// Counts an attempt; `taken`: it found a message for the callback.
    void count(bool taken);

   private:
    ArrivalCallback &callback_;
    const Source source_;
    bool begun_ = false;
  };

  /// `depth`: arrivals that each source keeps; 0: all. `only_wait_set`: there is no usable hook.
  ArrivalCallback(std::shared_ptr<ExecutorContext> context, redag::CallbackId id, std::size_t depth,
                  bool only_wait_set = false)
      : Callback(std::move(context), std::move(id)), depth_(depth), by_wait_set_(only_wait_set) {}

  [[nodiscard]] std::shared_ptr<ArrivalCallback> self() {
    return std::static_pointer_cast<ArrivalCallback>(shared_from_this());
  }
  void arrived(std::size_t count, Source source, int part, bool seen_only = false);
  [[nodiscard]] redag::Activation join() override {
    joined_ = true;
    return redag::Activation::Data;
  }
  /// For the constructors of callbacks that have an exchange(): the executor is told of what arrives.
  void take_part_in_exchange() { takes_part_ = true; }
  /// There may be more messages of `source` than tokens: releases jobs until nothing is left.
  void release_leftovers(Source source);
  /// Drops the messages whose jobs were skipped, for drop_skipped(). `take` takes one message; false: there is none.
  template <class Take>
  void drop_messages(Source source, Take take) REDAG_EXCLUDES(lock_) {
    for (bool taken = true; taken; taken = take()) {
      if (!begin_drop(source)) return;
    }
    forget_dropped(source);
  }

 private:
  // ---- what each kind of entity defines ----

  /// Sets the middleware's hook. Throws if the middleware, or a user's waitable, offers none.
  virtual void hook() = 0;
  /// Sets the hook that reports messages of this process, if there are any.
  virtual void hook_intra_process() {}
  /// Clears the hooks, also where hook() had failed.
  virtual void unhook() = 0;
  /// True if the user has set the middleware's hook. A wait set then watches the entity in its place.
  [[nodiscard]] virtual bool is_hooked_by_user() const = 0;
  /// The entity; null once it is gone.
  [[nodiscard]] virtual std::shared_ptr<void> entity() const = 0;
  /// Takes what arrived and calls the user's function. False: there was nothing.
  [[nodiscard]] virtual bool handle(const Token &token, Taking &taking) = 0;
  /// True if a skipped job's message is dropped. Otherwise its token is released again.
  [[nodiscard]] virtual bool drops_skipped() const { return false; }
  /// Drops the messages of skipped jobs, by drop_messages().
  virtual void drop_skipped(Source) {}

  // ---- tokens ----

  static std::size_t index_of(Source source) { return static_cast<std::size_t>(source); }

  bool connect() override;
  [[nodiscard]] bool run(Time release) override;
  [[nodiscard]] bool execute_token(const Token &token);
  enum class Overwritten : std::uint8_t {
    Skipped,   // its job was skipped and counted before
    Released,  // its job waits in the scheduler
    Waiting,   // its token waits for a later release
    Started,   // its job has started, and takes the newer message instead
  };
  [[nodiscard]] Overwritten drop_oldest(Source source) REDAG_REQUIRES(lock_);
  [[nodiscard]] Time origin_of(Time now, const redag::runtime::RunningJob *publisher) REDAG_REQUIRES(lock_);
  [[nodiscard]] bool learn_from_arrival(Time now, std::size_t count, Source source,
                                        const redag::runtime::RunningJob *publisher) REDAG_REQUIRES(lock_);
  [[nodiscard]] bool take_token(Token &token);
  [[nodiscard]] bool run_newest(Time release);
  [[nodiscard]] bool take_newest(Time release, bool or_later, Token &token);
  void pass_over(std::size_t position) REDAG_REQUIRES(lock_);
  [[nodiscard]] bool begin_release(redag::runtime::Release &release) REDAG_REQUIRES(lock_);
  void begin_release_of_first(redag::runtime::Release &release) REDAG_REQUIRES(lock_);
  [[nodiscard]] bool begin_receive(redag::runtime::Release &message) REDAG_REQUIRES(lock_);
  [[nodiscard]] bool is_direct() REDAG_REQUIRES(lock_);
  void tell(const redag::runtime::Release &release, Time now);
  void end_release() REDAG_EXCLUDES(lock_);
  [[nodiscard]] bool begin_drop(Source source) REDAG_EXCLUDES(lock_);
  void forget_dropped(Source source) REDAG_EXCLUDES(lock_);

  bool takes_part_ = false;  // see take_part_in_exchange()
  bool joined_ = false;      // see join()
  const std::size_t depth_;
  std::atomic<bool> by_wait_set_;  // a wait set watches the entity

  // Uses of the engine that were begun under lock_ and go on without it. detach() waits for them. No worker does: it
  // may wake before the hook that released its job is done with the engine.
  redag::runtime::InProgress releases_;

  TokenQueue<Token> tokens_ REDAG_GUARDED_BY(lock_);  // if a job is released, the first token is its
  // Indexed by source. The source keeps a message until the moment before it is taken. Earlier arrivals may overwrite
  // it. Taking::begin() lowers kept_ without a lock, all else changes it under lock_: a thread that finds the source
  // full there comes before a job that begins to take meanwhile.
  std::atomic<std::size_t> kept_[2] = {0, 0};                 // messages that the source keeps
  std::size_t dropped_[2] REDAG_GUARDED_BY(lock_) = {0, 0};   // part of kept_: their jobs were skipped; without token
  std::size_t dropping_[2] REDAG_GUARDED_BY(lock_) = {0, 0};  // part of kept_: to be dropped by the next job
  std::atomic<bool> leftovers_[2] = {false, false};           // there may be more messages than tokens
  std::atomic<bool> came_[2] = {false, false};                // messages have come; if from both, some are copies
  std::uint32_t released_ REDAG_GUARDED_BY(lock_) = 0;  // jobs in the scheduler, or whose skip it has yet to report
  bool noted_ REDAG_GUARDED_BY(lock_) = false;          // noted by note(), not yet admitted
  bool seen_ REDAG_GUARDED_BY(lock_) = false;           // seen by the wait set, not yet handled
  std::vector<TaskId> publishers_ REDAG_GUARDED_BY(lock_);
  std::uint64_t arrivals_[2] REDAG_GUARDED_BY(lock_) = {0, 0};
  // Messages from the middleware, counted if intra-process communication delivers messages as well.
  std::atomic<std::uint64_t> takes_{0};  // attempts to take one
  std::atomic<std::uint64_t> taken_{0};  // attempts that found a message for the callback
  Time first_arrival_ REDAG_GUARDED_BY(lock_) = 0;
  Time last_arrival_ REDAG_GUARDED_BY(lock_) = 0;
  std::uint64_t tells_at_ REDAG_GUARDED_BY(lock_) = 3;  // number of arrivals
  bool has_learned_ REDAG_GUARDED_BY(lock_) = false;
  Time last_origin_ REDAG_GUARDED_BY(lock_) = 0;
};

}  // namespace redag_rclcpp
