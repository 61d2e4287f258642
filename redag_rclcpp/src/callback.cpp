#include "callback.hpp"

#include <rcl/timer.h>
#include <rcl/wait.h>
#include <tracetools/tracetools.h>

#include <algorithm>
#include <mutex>
#include <utility>

#include "compat.hpp"
#include "rclcpp/executor.hpp"
#include "rclcpp/logging.hpp"
#include "redag/runtime/running_job.hpp"

#ifndef TRACETOOLS_TRACEPOINT  // its name before Jazzy
#define TRACETOOLS_TRACEPOINT TRACEPOINT
#endif

namespace redag_rclcpp {

using redag::kNever;
using redag::runtime::Release;
using redag::sched::Outcome;

namespace {

constexpr Duration kClockReads = 10 * redag::kMicrosecond;  // two clocks read further apart than this are read again
constexpr std::int64_t kMostMissed = 1000;                  // missed releases told of one by one

// rclcpp executes what we have no reason to do otherwise.
struct Rclcpp : rclcpp::Executor {
  using rclcpp::Executor::execute_subscription;
};

/// Takes with `take`, then calls `handle`. False: there was nothing to take. As rclcpp's executors do.
template <class Take, class Handle>
bool take_and_handle(const char *what, const char *name, Take take, Handle handle) {
  bool taken = false;
  try {
    taken = take();
  } catch (const rclcpp::exceptions::RCLError &error) {
    RCLCPP_ERROR(rclcpp::get_logger("redag_rclcpp"), "taking %s '%s' failed: %s", what, name, error.what());
  }
  if (taken) handle();
  return taken;
}

std::size_t depth_of(const rclcpp::QoS &qos) {
  return qos.history() == rclcpp::HistoryPolicy::KeepLast ? qos.depth() : 0;
}

/// A timer's clock and ours, read together.
struct TimerReading {
  bool cancelled = false;
  Duration until = 0;  // its next call; negative: that is overdue
  Time now = 0;        // ours, right before
};

TimerReading read_timer(const rcl_timer_t &timer, const redag::runtime::Engine &engine) {
  TimerReading reading;
  for (int attempt = 0; attempt < 3; ++attempt) {
    reading.now = engine.now();
    reading.cancelled = rcl_timer_get_time_until_next_call(&timer, &reading.until) != RCL_RET_OK;
    if (reading.cancelled) rcl_reset_error();
    if (reading.cancelled || engine.now() - reading.now < kClockReads) break;
  }
  return reading;
}

/// The timer's clock, if it is ROS time; else null.
rcl_clock_t *ros_clock_of(const rcl_timer_t &timer) {
  rcl_clock_t *clock = nullptr;
  if (rcl_timer_clock(const_cast<rcl_timer_t *>(&timer), &clock) != RCL_RET_OK) rcl_reset_error();
  return clock != nullptr && clock->type == RCL_ROS_TIME ? clock : nullptr;
}

/// Does the clock stand still between messages on /clock?
bool is_simulated(const rcl_timer_t &timer) {
  rcl_clock_t *clock = ros_clock_of(timer);
  bool enabled = false;
  if (clock != nullptr && rcl_is_enabled_ros_time_override(clock, &enabled) != RCL_RET_OK) rcl_reset_error();
  return enabled;
}

/// Does only its guard condition tell of resets, or of jumps of time?
bool has_to_be_waited_for(const rcl_timer_t &timer) {
  return !compat::kTimersTellOfResets || ros_clock_of(timer) != nullptr;
}

Duration period_of(const rcl_timer_t &timer) {
  Duration period = 0;
  if (rcl_timer_get_period(&timer, &period) != RCL_RET_OK) rcl_reset_error();
  return period;
}

}  // namespace

Callback::Callback(std::shared_ptr<Intake> intake, redag::CallbackId id)
    : id_(std::move(id)), engine_(intake->engine()), intake_(std::move(intake)) {}

Callback::Callback(std::shared_ptr<Intake> intake, redag::CallbackId id, const rclcpp::TimerBase::SharedPtr &timer)
    : Callback(std::move(intake), std::move(id)) {
  timer_ = timer;
  timer_handle_ = timer->get_timer_handle();
}

Callback::Callback(std::shared_ptr<Intake> intake, redag::CallbackId id,
                   const rclcpp::SubscriptionBase::SharedPtr &subscription,
                   const rclcpp::Waitable::SharedPtr &intra_process)
    : Callback(std::move(intake), std::move(id)) {
  subscription_ = subscription;
  intra_process_ = intra_process;
  depth_ = depth_of(subscription->get_actual_qos());
}

Callback::Callback(std::shared_ptr<Intake> intake, redag::CallbackId id, const rclcpp::ServiceBase::SharedPtr &service)
    : Callback(std::move(intake), std::move(id)) {
  service_ = service;
  by_wait_set_ = compat::needs_wait_set(std::string(service->get_service_name()));
}

Callback::Callback(std::shared_ptr<Intake> intake, redag::CallbackId id, const rclcpp::ClientBase::SharedPtr &client)
    : Callback(std::move(intake), std::move(id)) {
  client_ = client;
}

Callback::Callback(std::shared_ptr<Intake> intake, redag::CallbackId id, const rclcpp::Waitable::SharedPtr &waitable,
                   bool only_wait_set)
    : Callback(std::move(intake), std::move(id)) {
  waitable_ = waitable;
  by_wait_set_ = only_wait_set;
}

// ---- being connected ----

bool Callback::attach(TaskId task) {
  task_ = task;
  if (is_timer()) {
    look_at_timer();
  } else if (!by_wait_set_) {
    try {
      hook();
    } catch (const std::exception &) {
      // The middleware, or a waitable of the user's, has no such hook.
      unhook();
      by_wait_set_ = true;
    }
  }
  if (const auto timer = timer_.lock()) {
    compat::set_on_reset(*timer, [self = shared_from_this()] { self->look_at_timer(); });
    return has_to_be_waited_for(*timer_handle_);
  }
  return by_wait_set_;
}

void Callback::hook() {
  const auto tell = [self = shared_from_this()](std::size_t count) { self->arrived(count, Source::Middleware, 0); };
  if (const auto subscription = subscription_.lock()) {
    if (const auto intra_process = intra_process_.lock()) {
      intra_process->set_on_ready_callback(
          [self = shared_from_this()](std::size_t count, int) { self->arrived(count, Source::IntraProcess, 0); });
    }
    subscription->set_on_new_message_callback(tell);
  }
  if (const auto service = service_.lock()) service->set_on_new_request_callback(tell);
  if (const auto client = client_.lock()) client->set_on_new_response_callback(tell);
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
      // It could not be set either.
    }
  };
  if (const auto timer = timer_.lock()) clear([&] { compat::clear_on_reset(*timer); });
  if (const auto subscription = subscription_.lock()) clear([&] { subscription->clear_on_new_message_callback(); });
  if (const auto waitable = intra_process_.lock()) clear([&] { waitable->clear_on_ready_callback(); });
  if (const auto service = service_.lock()) clear([&] { service->clear_on_new_request_callback(); });
  if (const auto client = client_.lock()) clear([&] { client->clear_on_new_response_callback(); });
  if (const auto waitable = waitable_.lock()) clear([&] { waitable->clear_on_ready_callback(); });
}

void Callback::detach() {
  std::shared_ptr<Intake> intake;
  {
    const std::lock_guard release_guard(release_lock_);
    const std::lock_guard guard(lock_);
    intake.swap(intake_);
    tokens_.clear();
    if (intake && is_timer()) intake->timers().schedule(*this, kNever);
  }
  unhook();
}

bool Callback::alive() const {
  return !timer_.expired() || !subscription_.expired() || !service_.expired() || !client_.expired() ||
         !waitable_.expired();
}

// ---- arrivals ----

void Callback::arrived(std::size_t count, Source source, int part, bool seen_only) {
  std::shared_ptr<Intake> to_wake;
  {
    const std::lock_guard release_guard(release_lock_);
    Time now = 0;
    bool release = false;
    Time arrival = 0;
    std::size_t overwritten = 0;
    {
      const std::lock_guard guard(lock_);
      if (!intake_) return;  // and perhaps there is no engine any more
      now = engine_.now();
      if (intake_->learning()) learn_from_arrival(now, count);
      const bool direct = intake_->direct();
      if (depth_ > 0) count = std::min(count, depth_);
      for (std::size_t i = 0; i < count; ++i) {
        // The job that waits for a dropped token is now the next one's: its release takes the place of the old one.
        if (depth_ > 0 && kept_[index_of(source)] >= depth_) {
          if (drop_oldest(source) && direct) {
            release = true;
          } else {
            ++overwritten;
          }
        }
        tokens_.push(Token{now, source, part, seen_only});
        ++kept_[index_of(source)];
      }
      arrival = tokens_.front().arrival;
      if (direct) {
        release = release || !released_;
        released_ = true;
      } else if (!released_ && !noted_) {
        noted_ = true;
        intake_->note(shared_from_this());
        to_wake = intake_;
      }
    }
    for (; overwritten > 0; --overwritten) engine_.miss(task_, now, redag::Reason::QueueFull);
    if (release) engine_.release(task_, arrival);
  }
  if (to_wake) to_wake->wake();
}

// True if the dropped token was that of the released job.
bool Callback::drop_oldest(Source source) {
  for (std::size_t i = 0; i < tokens_.size(); ++i) {
    if (tokens_.at(i).source != source) continue;
    tokens_.erase(i);
    --kept_[index_of(source)];
    return i == 0 && released_;
  }
  return false;
}

void Callback::admit() {
  const std::lock_guard release_guard(release_lock_);
  Time arrival = kNever;
  {
    const std::lock_guard guard(lock_);
    noted_ = false;
    if (!intake_ || released_ || tokens_.empty()) return;
    released_ = true;
    arrival = tokens_.front().arrival;
  }
  engine_.release(task_, arrival);
}

bool Callback::take_token(Token &token) {
  Time next = kNever;
  {
    const std::lock_guard guard(lock_);
    released_ = false;
    if (tokens_.empty()) return false;
    token = tokens_.pop();
    --kept_[index_of(token.source)];
    if (tokens_.empty() || !intake_) return true;
    if (intake_->direct()) {
      released_ = true;
      next = tokens_.front().arrival;
    } else if (!noted_) {
      noted_ = true;
      intake_->note(shared_from_this());
    }
  }
  // The task is still ours: an id is not used again while a job of it runs.
  if (next != kNever) engine_.release(task_, next);
  return true;
}

void Callback::learn_from_arrival(Time now, std::size_t count) {
  if (arrivals_ == 0) first_arrival_ = now;
  last_arrival_ = now;
  arrivals_ += count;
  // Messages of this process arrive on the thread that publishes them: in the job that is the task's predecessor.
  const auto publisher = engine_.current_task();
  if (publisher && std::find(publishers_.begin(), publishers_.end(), *publisher) == publishers_.end()) {
    publishers_.push_back(*publisher);
  }
}

std::vector<TaskId> Callback::publishers() const {
  const std::lock_guard guard(lock_);
  return publishers_;
}

Duration Callback::mean_interval() const {
  const std::lock_guard guard(lock_);
  if (arrivals_ < 3) return 0;
  return (last_arrival_ - first_arrival_) / static_cast<Duration>(arrivals_ - 1);
}

// ---- what the wait set does for us ----

Callback::Waited Callback::waited() const {
  Waited waited;
  if (is_timer()) {
    if (has_to_be_waited_for(*timer_handle_)) waited.timer = timer_handle_;
    return waited;
  }
  {
    const std::lock_guard guard(lock_);
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
      const std::lock_guard guard(lock_);
      leftovers_[index_of(source)] = true;
      if (kept_[index_of(source)] > 0) continue;
    }
    arrived(1, source, 0);
  }
}

void Callback::seen_by_wait_set() {
  {
    const std::lock_guard guard(lock_);
    seen_ = true;
  }
  arrived(1, Source::Middleware, 0, true);
}

// ---- timers ----

void Callback::look_at_timer() {
  restarted_ = true;
  reschedule();
}

void Callback::reschedule() {
  const TimerReading reading = read_timer(*timer_handle_, engine_);
  Time due = reading.now + reading.until;
  if (reading.cancelled || (reading.until > 0 && is_simulated(*timer_handle_))) due = kNever;
  const std::lock_guard guard(lock_);
  if (intake_ && intake_->timers().schedule(*this, due)) intake_->timers_changed();
}

Time Callback::expire(Time now, std::vector<Release> &releases, std::vector<Release> &missed) {
  const bool simulated = is_simulated(*timer_handle_);
  const TimerReading reading = read_timer(*timer_handle_, engine_);
  if (reading.cancelled) return kNever;
  if (reading.until > 0) return simulated ? kNever : reading.now + reading.until;

  const Duration period = period_of(*timer_handle_);
  if (simulated || period == 0) {
    // Times of another clock have no point on ours; a period of 0 has no grid.
    if (!uncalled_.exchange(true)) {
      releases.push_back(Release{task_, now});
    }
    return kNever;
  }
  // The latest point of the grid: the call itself is for the first one that was not called.
  const Time nominal = reading.now + reading.until + -reading.until / period * period;
  if (restarted_.exchange(false)) last_release_ = kNever;
  const bool again = last_release_ != kNever && nominal - last_release_ < period / 2;
  if (!again || !uncalled_) {
    if (last_release_ != kNever) {
      const std::int64_t between = (nominal - last_release_ + period / 2) / period - 1;
      for (std::int64_t i = std::min(between, kMostMissed); i > 0; --i) missed.push_back({task_, nominal - i * period});
    }
    last_release_ = nominal;
    uncalled_ = true;
    releases.push_back(Release{task_, nominal});
  }
  return nominal + period;
}

// ---- execution ----

Outcome Callback::execute(const redag::runtime::Job &job) {
  Token token;
  const bool executed = is_timer() ? execute_timer() : take_token(token) && execute_token(token);
  if (!executed) return Outcome::NoData;
  const Duration response = engine_.now() - job.release;
  response_.add(response);
  if (response > deadline_.load(std::memory_order_relaxed)) late_.fetch_add(1, std::memory_order_relaxed);
  execution_.add(redag::runtime::RunningJob::current()->close());
  return Outcome::Finished;
}

bool Callback::execute_timer() {
  const auto timer = timer_.lock();
  if (!timer) return false;
  bool due = false;
  if (rcl_timer_is_ready(timer_handle_.get(), &due) != RCL_RET_OK) rcl_reset_error();
  uncalled_ = false;
  if (!due) {
    // Cancelled, or reset meanwhile; or the job before this one started so late that its call consumed this expiry too,
    // which is lost.
    if (!restarted_ && !timer->is_canceled()) late_.fetch_add(1, std::memory_order_relaxed);
    reschedule();
    return false;
  }
  TRACETOOLS_TRACEPOINT(rclcpp_executor_execute, static_cast<const void *>(timer_handle_.get()));
  compat::TimerCall call(*timer);
  if (!call.valid()) return false;
  const bool always_due = period_of(*timer_handle_) == 0;
  if (!always_due) reschedule();
  call.execute();
  if (always_due) reschedule();
  return true;
}

bool Callback::execute_token(const Token &token) {
  // What the wait set saw is dealt with when this is left, however that is.
  struct Watch {
    ~Watch() {
      if (!token.seen_only) return;
      std::shared_ptr<Intake> intake;
      {
        const std::lock_guard guard(self.lock_);
        self.seen_ = false;
        intake = self.intake_;
      }
      if (intake) intake->wait_set_changed();
    }
    Callback &self;
    const Token &token;
  } watch{*this, token};

  const bool taken = execute_arrival(token);
  bool more = false;
  {
    const std::lock_guard guard(lock_);
    bool &leftovers = leftovers_[index_of(token.source)];
    leftovers = leftovers && taken;
    more = leftovers && kept_[index_of(token.source)] == 0;
  }
  if (more) arrived(1, token.source, 0);
  return taken;
}

bool Callback::execute_arrival(const Token &token) {
  if (token.source == Source::IntraProcess) {
    const auto waitable = intra_process_.lock();
    // An empty buffer must not be taken from.
    rcl_wait_set_t unused = rcl_get_zero_initialized_wait_set();
    return waitable && compat::is_ready(*waitable, unused) && execute_waitable(*waitable, token);
  }
  if (const auto waitable = waitable_.lock()) return execute_waitable(*waitable, token);
  return execute_subscription() || execute_service() || execute_client();
}

bool Callback::execute_waitable(rclcpp::Waitable &waitable, const Token &token) {
  std::shared_ptr<void> data =
      token.seen_only ? waitable.take_data() : waitable.take_data_by_entity_id(static_cast<std::size_t>(token.part));
  compat::execute(waitable, data);
  return true;
}

bool Callback::execute_subscription() {
  const auto subscription = subscription_.lock();
  if (!subscription) return false;
  TRACETOOLS_TRACEPOINT(rclcpp_executor_execute,
                        static_cast<const void *>(subscription->get_subscription_handle().get()));
  if (subscription->is_serialized() || subscription->can_loan_messages()) {
    Rclcpp::execute_subscription(subscription);
    return true;
  }
  rclcpp::MessageInfo info;
  info.get_rmw_message_info().from_intra_process = false;
  std::shared_ptr<void> message = subscription->create_message();
  const bool taken = take_and_handle(
      "a message of topic", subscription->get_topic_name(),
      [&] { return subscription->take_type_erased(message.get(), info); },
      [&] { subscription->handle_message(message, info); });
  subscription->return_message(message);
  return taken;
}

bool Callback::execute_service() {
  const auto service = service_.lock();
  if (!service) return false;
  auto header = service->create_request_header();
  std::shared_ptr<void> request = service->create_request();
  return take_and_handle(
      "a request of service", service->get_service_name(),
      [&] { return service->take_type_erased_request(request.get(), *header); },
      [&] { service->handle_request(header, request); });
}

bool Callback::execute_client() {
  const auto client = client_.lock();
  if (!client) return false;
  auto header = client->create_request_header();
  std::shared_ptr<void> response = client->create_response();
  return take_and_handle(
      "a response of service", client->get_service_name(),
      [&] { return client->take_type_erased_response(response.get(), *header); },
      [&] { client->handle_response(header, response); });
}

}  // namespace redag_rclcpp
