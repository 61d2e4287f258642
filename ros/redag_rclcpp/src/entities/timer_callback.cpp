// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Timers as callbacks: finds when they are due, and calls them.
#include <rcl/timer.h>

#include <algorithm>
#include <utility>

#include "compat.hpp"
#include "entities/entities.hpp"

namespace redag_rclcpp {

using redag::kNever;
using redag::saturated_add;
using redag::runtime::Release;

namespace {

constexpr Duration kClockReads = 10 * redag::kMicrosecond;  // clock readings further apart are repeated
constexpr std::int64_t kMostMissed = 1000;                  // largest number of missed releases that are reported
constexpr Duration kBetweenLooks = 100 * redag::kMillisecond;

/// Readings of a timer's clock and the engine's clock, taken together.
struct TimerReading {
  bool cancelled = false;
  Duration until = 0;  // time until the timer's next call; negative: overdue
  Time now = 0;        // engine's clock, read right before
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

/// The timer's clock if it is ROS time, else null.
rcl_clock_t *ros_clock_of(const rcl_timer_t &timer) {
  rcl_clock_t *clock = nullptr;
  if (rcl_timer_clock(const_cast<rcl_timer_t *>(&timer), &clock) != RCL_RET_OK) rcl_reset_error();
  return clock != nullptr && clock->type == RCL_ROS_TIME ? clock : nullptr;
}

/// True if the timer's clock stands still between messages on /clock.
bool is_simulated(const rcl_timer_t &timer) {
  rcl_clock_t *clock = ros_clock_of(timer);
  bool enabled = false;
  if (clock != nullptr && rcl_is_enabled_ros_time_override(clock, &enabled) != RCL_RET_OK) rcl_reset_error();
  return enabled;
}

bool is_steady(const rcl_timer_t &timer) {
  rcl_clock_t *clock = nullptr;
  if (rcl_timer_clock(const_cast<rcl_timer_t *>(&timer), &clock) != RCL_RET_OK) rcl_reset_error();
  return clock != nullptr && clock->type == RCL_STEADY_TIME;
}

Duration period_of(const rcl_timer_t &timer) {
  Duration period = 0;
  if (rcl_timer_get_period(&timer, &period) != RCL_RET_OK) rcl_reset_error();
  return period;
}

class TimerCallback final : public Callback {
 public:
  /// `owner`: the waitable whose timer it is; null for a timer of a group.
  TimerCallback(std::shared_ptr<ExecutorContext> context, redag::CallbackId id,
                const rclcpp::TimerBase::SharedPtr &timer, const rclcpp::Waitable::SharedPtr &owner)
      : Callback(std::move(context), std::move(id)),
        timer_(timer),
        owner_(owner),
        is_owned_(owner != nullptr),
        handle_(timer->get_timer_handle()),
        can_be_set_(!is_steady(*handle_)),
        known_period_(period_of(*handle_)) {}

  void detach() override;
  void admit() override {}
  [[nodiscard]] bool can_join() const override { return true; }
  [[nodiscard]] redag::Activation join() override {
    joined_ = true;
    return redag::Activation::Timer;
  }
  [[nodiscard]] bool alive() const override { return !timer_.expired() && (!is_owned_ || !owner_.expired()); }
  [[nodiscard]] bool has_rate() const override { return true; }
  [[nodiscard]] Duration stated_period() const override { return period_of(*handle_); }
  [[nodiscard]] std::shared_ptr<void> hold() override {
    return is_owned_ && owner_.expired() ? nullptr : timer_.lock();
  }
  [[nodiscard]] std::vector<TaskId> publishers() const override { return {}; }
  [[nodiscard]] Duration mean_interval() const override { return 0; }
  [[nodiscard]] std::uint64_t lost() const override { return lost_.load(std::memory_order_relaxed); }

  Time expire(Time now, std::vector<Release> &releases, std::vector<Release> &missed) override;
  void skipped(redag::Reason reason) noexcept override {
    if (reason != redag::Reason::Overrun) drop_expiry();
  }

  // A wait set watches the guard condition, which reports resets and time jumps.
  [[nodiscard]] Held watched() const override;
  [[nodiscard]] Held hooked() const override { return {}; }
  void count(const Held &, WaitSetSizes &sizes) const override { ++sizes.guard_conditions; }
  void add(Held &held, rcl_wait_set_t &set) const override;
  [[nodiscard]] bool is_ready(const Held &held, rcl_wait_set_t &set) const override {
    return set.guard_conditions[held.index] != nullptr;
  }
  void seen_by_wait_set() override { look(); }
  void take_leftovers(const Held &, rcl_wait_set_t &, bool) override {}

 private:
  bool connect() override;
  [[nodiscard]] bool run(Time release) override;

  /// True if only the guard condition reports resets, or jumps of the clock.
  [[nodiscard]] bool needs_wait_set() const;
  void watch_clock(rclcpp::TimerBase &timer);
  /// Computes when the timer is due. Called after a reset or a jump of its clock.
  void look();
  void reschedule();
  void tell_period();
  /// When to look at the timer again that is due then. A clock that can be set may be set meanwhile.
  [[nodiscard]] Time next_look(Time now, Time due) const {
    return can_be_set_ ? std::min(due, saturated_add(now, kBetweenLooks)) : due;
  }
  void drop_expiry();
  [[nodiscard]] std::shared_ptr<TimerCallback> self() {
    return std::static_pointer_cast<TimerCallback>(shared_from_this());
  }

  const std::weak_ptr<rclcpp::TimerBase> timer_;
  const std::weak_ptr<rclcpp::Waitable> owner_;
  const bool is_owned_;
  const std::shared_ptr<const rcl_timer_t> handle_;  // the handle alone: the last owner of a timer cancels it
  const bool can_be_set_;                            // its clock
  bool joined_ = false;                              // its jobs wait for those of other callbacks
  rclcpp::JumpHandler::SharedPtr clock_watch_;       // reports that simulated time begins or ends
  Time last_release_ = kNever;                       // guarded by the timer queue's lock
  std::atomic<bool> uncalled_{false};                // released, and not called since
  std::atomic<std::uint64_t> lost_{0};
  std::atomic<bool> restarted_{false};  // the timer's grid begins anew
  std::atomic<Duration> known_period_;  // to the scheduler, or soon
};

bool TimerCallback::connect() {
  look();
  if (const auto timer = timer_.lock()) {
    watch_clock(*timer);
    compat::set_on_reset(*timer, [self = self()] { self->look(); });
    return needs_wait_set();
  }
  return false;
}

void TimerCallback::detach() {
  std::shared_ptr<ExecutorContext> left;
  {
    const redag::LockGuard guard(lock_);
    left = leave();
  }
  clock_watch_.reset();
  const auto timer = timer_.lock();
  if (!timer) return;
  try {
    compat::clear_on_reset(*timer);
  } catch (const std::exception &) {
    // Setting this hook had failed as well.
  }
}

WaitSetMember::Held TimerCallback::watched() const {
  return needs_wait_set() ? Held{.entity = std::const_pointer_cast<rcl_timer_t>(handle_)} : Held{};
}

void TimerCallback::add(Held &held, rcl_wait_set_t &set) const {
  check_rcl(rcl_wait_set_add_guard_condition(&set, rcl_timer_get_guard_condition(handle_.get()), &held.index),
            "cannot wait for a timer's guard condition");
}

bool TimerCallback::needs_wait_set() const { return !compat::kTimersTellOfResets || ros_clock_of(*handle_) != nullptr; }

// Watches for simulated time being switched on or off: rcl then sets the timer anew without triggering anything.
void TimerCallback::watch_clock(rclcpp::TimerBase &timer) {
  if (ros_clock_of(*handle_) == nullptr) return;
  rcl_jump_threshold_t changes{};
  changes.on_clock_change = true;
  clock_watch_ = compat::clock_of(timer)->create_jump_callback(
      nullptr,
      [weak = std::weak_ptr<TimerCallback>(self())](const rcl_time_jump_t &) {
        if (const auto self = weak.lock()) self->look();
      },
      changes);
}

void TimerCallback::look() {
  restarted_ = true;
  reschedule();
}

// The program has exchanged the period.
void TimerCallback::tell_period() {
  std::shared_ptr<ExecutorContext> executor;
  {
    const redag::LockGuard guard(lock_);
    executor = context();
  }
  if (executor) executor->rate_seen();
}

void TimerCallback::reschedule() {
  const TimerReading reading = read_timer(*handle_, engine());
  Time due = next_look(reading.now, saturated_add(reading.now, reading.until));
  if (reading.cancelled || (reading.until > 0 && is_simulated(*handle_))) due = kNever;
  const redag::LockGuard guard(lock_);
  if (context() && context()->timers().schedule(*this, due)) context()->timers_changed();
}

Time TimerCallback::expire(Time now, std::vector<Release> &releases, std::vector<Release> &missed) {
  const bool simulated = is_simulated(*handle_);
  const TimerReading reading = read_timer(*handle_, engine());
  if (reading.cancelled) return kNever;
  if (reading.until > 0) return simulated ? kNever : next_look(now, saturated_add(reading.now, reading.until));

  const Duration period = period_of(*handle_);
  if (simulated || period == 0) {
    // Simulated time has no points on the engine's clock, and a period of 0 has no grid.
    if (!uncalled_.exchange(true)) {
      releases.push_back(Release{task(), now});
    }
    return kNever;
  }
  // The latest point of the grid that has passed. The call itself stands for the first point that was not called.
  const Time nominal = reading.now + reading.until + -reading.until / period * period;
  if (restarted_.exchange(false)) last_release_ = kNever;
  const bool again = last_release_ != kNever && nominal - last_release_ < period / 2;
  if (!again || !uncalled_) {
    if (last_release_ != kNever) {
      const std::int64_t between = (nominal - last_release_ + period / 2) / period - 1;
      for (std::int64_t i = std::min(between, kMostMissed); i > 0; --i)
        missed.push_back({task(), nominal - i * period});
    }
    last_release_ = nominal;
    uncalled_ = true;
    releases.push_back(Release{task(), nominal});
  }
  return next_look(now, saturated_add(nominal, period));
}

// Consumes the expiry of a skipped job if no other job will. A timer with a grid needs none of this: the next point's
// job consumes the expiry. The release thread, which may call this, must not become the last owner of the timer.
void TimerCallback::drop_expiry() {
  if (!is_simulated(*handle_) && period_of(*handle_) != 0) return;
  if (rcl_timer_call(const_cast<rcl_timer_t *>(handle_.get())) != RCL_RET_OK) rcl_reset_error();
  uncalled_ = false;
  reschedule();
}

bool TimerCallback::run(Time /*release*/) {
  const auto timer = timer_.lock();
  const auto owner = owner_.lock();  // the timer's function may use it
  if (!timer || (is_owned_ && !owner)) return false;
  bool due = false;
  if (rcl_timer_is_ready(handle_.get(), &due) != RCL_RET_OK) rcl_reset_error();
  uncalled_ = false;
  const bool stopped = restarted_ || timer->is_canceled();
  // If the timer was neither cancelled nor reset, the previous job started so late that its call consumed this expiry
  // as well. Then the expiry is lost and counts as a miss. A job that has waited for others is called nevertheless, in
  // place of the next expiry: it stands for their data, which no later job gets.
  if (!due && (stopped || !joined_)) {
    if (!stopped) lost_.fetch_add(1, std::memory_order_relaxed);
    reschedule();
    return false;
  }
  TRACETOOLS_TRACEPOINT(rclcpp_executor_execute, static_cast<const void *>(handle_.get()));
  const auto call = compat::begin_call(*timer);
  if (!call) return false;
  const Duration period = period_of(*handle_);
  if (known_period_.exchange(period) != period) tell_period();
  const bool always_due = period == 0;
  if (!always_due) reschedule();
  compat::execute(*timer, call);
  if (always_due) reschedule();
  return true;
}

}  // namespace

Entity entity_of(const rclcpp::TimerBase::SharedPtr &timer) { return entity_of(nullptr, timer); }

Entity entity_of(const rclcpp::Waitable::SharedPtr &waitable, const rclcpp::TimerBase::SharedPtr &timer) {
  return {.key = timer.get(),
          .owner = waitable.get(),
          .id = {.kind = waitable ? redag::Callback::Kind::Waitable : redag::Callback::Kind::Timer,
                 .node = {},
                 .name = waitable ? "timer" : "",
                 .period = period_of(*timer->get_timer_handle())},
          .make = [waitable, timer](std::shared_ptr<ExecutorContext> context, redag::CallbackId id) {
            return std::make_shared<TimerCallback>(std::move(context), std::move(id), timer, waitable);
          }};
}

}  // namespace redag_rclcpp
