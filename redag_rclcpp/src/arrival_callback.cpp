// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "callback.hpp"

#include <rcl/client.h>
#include <rcl/service.h>
#include <rcl/subscription.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "compat.hpp"

namespace redag_rclcpp {

using redag::kNever;

namespace {

constexpr Duration kAskAgain = 10 * redag::kMillisecond;  // between releases of a skipped job that keeps its input

std::size_t depth_of(const rclcpp::QoS &qos) {
  return qos.history() == rclcpp::HistoryPolicy::KeepLast ? qos.depth() : 0;
}

}  // namespace

Callback::Callback(std::shared_ptr<ExecutorContext> intake, redag::CallbackId id)
    : id_(std::move(id)), engine_(intake->engine()), intake_(std::move(intake)) {}

Callback::Callback(std::shared_ptr<ExecutorContext> intake, redag::CallbackId id,
                   const rclcpp::TimerBase::SharedPtr &timer)
    : Callback(std::move(intake), std::move(id)) {
  timer_ = timer;
  timer_handle_ = timer->get_timer_handle();
}

Callback::Callback(std::shared_ptr<ExecutorContext> intake, redag::CallbackId id,
                   const rclcpp::SubscriptionBase::SharedPtr &subscription,
                   const rclcpp::Waitable::SharedPtr &intra_process)
    : Callback(std::move(intake), std::move(id)) {
  subscription_ = subscription;
  intra_process_ = intra_process;
  has_intra_process_ = intra_process != nullptr;
  depth_ = depth_of(subscription->get_actual_qos());
}

Callback::Callback(std::shared_ptr<ExecutorContext> intake, redag::CallbackId id,
                   const rclcpp::ServiceBase::SharedPtr &service)
    : Callback(std::move(intake), std::move(id)) {
  service_ = service;
}

Callback::Callback(std::shared_ptr<ExecutorContext> intake, redag::CallbackId id,
                   const rclcpp::ClientBase::SharedPtr &client)
    : Callback(std::move(intake), std::move(id)) {
  client_ = client;
}

Callback::Callback(std::shared_ptr<ExecutorContext> intake, redag::CallbackId id,
                   const rclcpp::Waitable::SharedPtr &waitable, bool only_wait_set)
    : Callback(std::move(intake), std::move(id)) {
  waitable_ = waitable;
  by_wait_set_ = only_wait_set;
}

// ---- connecting an entity ----

bool Callback::attach(TaskId task) {
  task_ = task;
  if (is_timer()) {
    look_at_timer();
  } else if (!by_wait_set_) {
    try {
      hook();
    } catch (const std::exception &) {
      // The middleware, or a user's waitable, offers no such hook.
      unhook();
      by_wait_set_ = true;
    }
  }
  if (const auto timer = timer_.lock()) {
    watch_clock(*timer);
    compat::set_on_reset(*timer, [self = shared_from_this()] { self->look_at_timer(); });
    return has_waited_timer();
  }
  return by_wait_set_;
}

void Callback::hook() {
  const std::weak_ptr<Hooked> self = weak_from_this();
  if (const auto subscription = subscription_.lock()) {
    if (const auto intra_process = intra_process_.lock()) {
      intra_process->set_on_ready_callback(
          [self = shared_from_this()](std::size_t count, int) { self->arrived(count, Source::IntraProcess, 0); });
    }
    hook_.set<rclcpp::SubscriptionBase>(
        subscription,
        [](rclcpp::SubscriptionBase &entity, rcl_event_callback_t call, const void *ticket) {
          return rcl_subscription_set_on_new_message_callback(entity.get_subscription_handle().get(), call, ticket);
        },
        self);
  }
  if (const auto service = service_.lock()) {
    hook_.set<rclcpp::ServiceBase>(
        service,
        [](rclcpp::ServiceBase &entity, rcl_event_callback_t call, const void *ticket) {
          return rcl_service_set_on_new_request_callback(entity.get_service_handle().get(), call, ticket);
        },
        self);
  }
  if (const auto client = client_.lock()) {
    hook_.set<rclcpp::ClientBase>(
        client,
        [](rclcpp::ClientBase &entity, rcl_event_callback_t call, const void *ticket) {
          return rcl_client_set_on_new_response_callback(entity.get_client_handle().get(), call, ticket);
        },
        self);
  }
  if (const auto waitable = waitable_.lock()) {
    waitable->set_on_ready_callback(
        [self = shared_from_this()](std::size_t count, int part) { self->arrived(count, Source::Middleware, part); });
  }
}

void Callback::unhook() {
  const auto clear = [](auto &&clear_hook) {
    try {
      clear_hook();
    } catch (const std::exception &) {
      // Setting this hook had failed as well.
    }
  };
  hook_.clear();
  clock_watch_.reset();
  if (const auto timer = timer_.lock()) clear([&] { compat::clear_on_reset(*timer); });
  if (const auto waitable = intra_process_.lock()) clear([&] { waitable->clear_on_ready_callback(); });
  if (const auto waitable = waitable_.lock()) clear([&] { waitable->clear_on_ready_callback(); });
}

void Callback::detach() {
  std::shared_ptr<ExecutorContext> intake;
  {
    const redag::LockGuard release_guard(release_lock_);
    const redag::LockGuard guard(lock_);
    intake.swap(intake_);
    tokens_.clear();
    if (intake) intake->timers().schedule(*this, kNever);
  }
  unhook();
}

bool Callback::alive() const {
  return !timer_.expired() || !subscription_.expired() || !service_.expired() || !client_.expired() ||
         !waitable_.expired();
}

// ---- arrivals ----

void Callback::arrived(std::size_t count, Source source, int part, bool seen_only) {
  std::shared_ptr<ExecutorContext> to_wake;
  {
    const redag::LockGuard release_guard(release_lock_);
    Time now = 0;
    bool begins = false;
    Time arrival = 0;
    std::size_t overwritten = 0;
    {
      const redag::LockGuard guard(lock_);
      if (!intake_) return;  // detached: the engine may no longer exist
      now = engine_.now();
      if (intake_->learning()) learn_from_arrival(now, count, source);
      const bool direct = intake_->direct();
      if (depth_ > 0) count = std::min(count, depth_);
      bool replaces = false;
      for (std::size_t i = 0; i < count; ++i) {
        if (depth_ > 0 && kept_[index_of(source)] >= depth_) {
          const Overwritten whose = drop_oldest(source);
          if (whose == Overwritten::Released && direct && !replaces) {
            // The released job's message is gone. Its release is replaced by one for the next message.
            replaces = true;
          } else if (whose != Overwritten::Skipped) {
            ++overwritten;
          }
          if (whose == Overwritten::Started) continue;
        }
        tokens_.push(Token{.arrival = now, .source = source, .part = part, .seen_only = seen_only});
        ++kept_[index_of(source)];
      }
      if (replaces) {
        arrival = tokens_.front().arrival;
        ++released_;
        ++releasers_;
        begins = true;
      } else {
        const bool noted = noted_;
        begins = begin_release(arrival);
        if (noted_ && !noted) to_wake = intake_;
      }
    }
    for (; overwritten > 0; --overwritten) engine_.miss(task_, now, redag::Reason::QueueFull);
    if (begins) release(arrival);
  }
  if (to_wake) to_wake->wake();
}

// Removes the token of the oldest message, which the middleware has overwritten. Returns what became of its job.
Callback::Overwritten Callback::drop_oldest(Source source) {
  const std::size_t at = index_of(source);
  for (std::size_t *skipped : {&dropping_[at], &dropped_[at]}) {
    if (*skipped == 0) continue;
    --*skipped;
    --kept_[at];
    return Overwritten::Skipped;
  }
  for (std::size_t i = 0; i < tokens_.size(); ++i) {
    if (tokens_.at(i).source != source) continue;
    tokens_.erase(i);
    --kept_[at];
    return i == 0 && released_ > 0 ? Overwritten::Released : Overwritten::Waiting;
  }
  return Overwritten::Started;
}

// Prepares the release of the first token. True: the caller must call release() after it has left lock_.
bool Callback::begin_release(Time &arrival) {
  if (released_ > 0 || !intake_ || tokens_.empty()) return false;
  if (!intake_->direct()) {
    if (!noted_) {
      noted_ = true;
      intake_->note(shared_from_this());
    }
    return false;
  }
  ++released_;
  ++releasers_;
  arrival = tokens_.front().arrival;
  return true;
}

// The caller holds release_lock_ or runs in a job of the task: the task's id is not reused while one of its jobs runs.
// If the scheduler skips the job at once, the loop releases the next token.
void Callback::release(Time arrival) {
  for (bool again = true; again;) {
    engine_.release(task_, arrival);
    const redag::LockGuard guard(lock_);
    --releasers_;
    again = begin_release(arrival);
  }
}

void Callback::admit() {
  const redag::LockGuard release_guard(release_lock_);
  Time arrival = kNever;
  {
    const redag::LockGuard guard(lock_);
    noted_ = false;
    if (!intake_ || released_ > 0 || tokens_.empty()) return;
    ++released_;
    ++releasers_;
    arrival = tokens_.front().arrival;
  }
  release(arrival);
}

void Callback::skipped(redag::Reason reason) noexcept {
  if (is_timer()) {
    if (reason != redag::Reason::Overrun) drop_expiry();
    return;
  }
  {
    const redag::LockGuard guard(lock_);
    if (!intake_) return;
    // Reason::Overrun means that arrived() has replaced this job. The token now belongs to the new job.
    if (released_ == 1 && reason != redag::Reason::Overrun && !tokens_.empty()) {
      const Token &token = tokens_.front();
      if (token.seen_only || subscription_.expired()) {
        // The token stays released; the timer queue repeats its release.
        if (intake_->timers().schedule(*this, engine_.now() + kAskAgain)) intake_->timers_changed();
        return;
      }
      ++dropped_[index_of(token.source)];
      tokens_.pop();
    }
    --released_;
    if (releasers_ > 0) return;  // the thread in release() looks for the next token
  }
  const redag::LockGuard release_guard(release_lock_);
  Time arrival = kNever;
  bool begins = false;
  {
    const redag::LockGuard guard(lock_);
    begins = begin_release(arrival);
  }
  if (begins) release(arrival);
}

bool Callback::take_token(Token &token) {
  Time next = kNever;
  bool begins = false;
  {
    const redag::LockGuard guard(lock_);
    if (released_ > 0) --released_;
    if (tokens_.empty()) return false;
    token = tokens_.pop();
    const std::size_t at = index_of(token.source);
    dropping_[at] += std::exchange(dropped_[at], 0);
    token.after_skipped = dropping_[at] > 0;
    begins = begin_release(next);
  }
  if (begins) release(next);
  return true;
}

void Callback::learn_from_arrival(Time now, std::size_t count, Source source) {
  if (arrivals_[0] + arrivals_[1] == 0) first_arrival_ = now;
  last_arrival_ = now;
  arrivals_[index_of(source)] += count;
  // Messages of this process arrive on the publishing thread, within the job that is the task's predecessor.
  const auto publisher = engine_.current_task();
  if (publisher && std::find(publishers_.begin(), publishers_.end(), *publisher) == publishers_.end()) {
    publishers_.push_back(*publisher);
  }
}

std::vector<TaskId> Callback::publishers() const {
  const redag::LockGuard guard(lock_);
  return publishers_;
}

Duration Callback::mean_interval() const {
  const redag::LockGuard guard(lock_);
  // If another process subscribes as well, the middleware brings each message of this process a second time, and rclcpp
  // does not take it. The measured share of taken messages is assumed to hold for overwritten messages, too.
  auto arrivals = static_cast<double>(arrivals_[index_of(Source::Middleware)]);
  if (takes_ > 0) arrivals *= static_cast<double>(taken_) / static_cast<double>(takes_);
  arrivals += static_cast<double>(arrivals_[index_of(Source::IntraProcess)]);
  const auto handled = static_cast<Duration>(std::llround(arrivals));
  if (handled < 3) return 0;
  return (last_arrival_ - first_arrival_) / (handled - 1);
}

// ---- the wait set ----

Callback::Waited Callback::waited() const {
  Waited waited;
  if (is_timer()) {
    if (has_waited_timer()) waited.timer = timer_handle_;
    return waited;
  }
  {
    const redag::LockGuard guard(lock_);
    if (!by_wait_set_ || seen_ || !intake_) return waited;
  }
  waited.subscription = subscription_.lock();
  waited.service = service_.lock();
  waited.client = client_.lock();
  waited.waitable = waitable_.lock();
  return waited;
}

Callback::Waited Callback::hooked() const {
  Waited hooked;
  if (by_wait_set_) return hooked;
  hooked.subscription = subscription_.lock();
  hooked.service = service_.lock();
  hooked.client = client_.lock();
  hooked.waitable = intra_process_.lock();
  return hooked;
}

void Callback::take_leftovers(bool middleware, bool intra_process) {
  for (const Source source : {Source::Middleware, Source::IntraProcess}) {
    if (!(source == Source::Middleware ? middleware : intra_process)) continue;
    {
      const redag::LockGuard guard(lock_);
      leftovers_[index_of(source)] = true;
      if (kept_[index_of(source)] > 0) continue;
    }
    arrived(1, source, 0);
  }
}

void Callback::seen_by_wait_set() {
  {
    const redag::LockGuard guard(lock_);
    seen_ = true;
  }
  arrived(1, Source::Middleware, 0, true);
}

}  // namespace redag_rclcpp
