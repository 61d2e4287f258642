// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_rclcpp/executor.hpp"

#include <stdexcept>
#include <utility>

#include "compat.hpp"
#include "core.hpp"

namespace redag_rclcpp {

using std::chrono::nanoseconds;

namespace {

/// Sets a flag and clears it again. Throws if the flag is already set.
class Claim {
 public:
  Claim(std::atomic_bool &flag, const char *function) : flag_(flag) {
    if (flag_.exchange(true)) throw std::runtime_error(std::string(function) + "() called while already spinning");
  }
  ~Claim() { flag_.store(false); }
  Claim(const Claim &) = delete;
  Claim &operator=(const Claim &) = delete;

 private:
  std::atomic_bool &flag_;
};

/// Claims the executor for one spin function. The executor's own flag is claimed before rclcpp's. cancel() clears
/// rclcpp's flag while callbacks still run, and setting it at that moment would undo the cancel().
class Spinning {
 public:
  Spinning(std::atomic_bool &occupied, std::atomic_bool &spinning, const char *function)
      : occupied_(occupied, function), spinning_(spinning, function) {}

 private:
  Claim occupied_;
  Claim spinning_;
};

}  // namespace

ReDAGExecutor::ReDAGExecutor(const rclcpp::ExecutorOptions &options, ReDAGOptions redag_options)
    : rclcpp::Executor(options), core_(std::make_shared<Core>(options.context, std::move(redag_options))) {
  ExecutorHooks hooks;
  hooks.groups = [this] {
    compat::update_groups(*this);
    return get_all_callback_groups();
  };
  hooks.may_spin = [this] { return rclcpp::ok(context_) && spinning.load(); };
  hooks.stop = [this] { cancel(); };
  core_->open(std::move(hooks), {compat::address_of(interrupt_guard_condition_), shutdown_guard_condition_.get()});
}

ReDAGExecutor::ReDAGExecutor(ReDAGOptions redag_options)
    : ReDAGExecutor(rclcpp::ExecutorOptions(), std::move(redag_options)) {}

ReDAGExecutor::~ReDAGExecutor() { core_->close(); }

// ---- nodes and groups ----

void ReDAGExecutor::add_node(distribution::NodePointer node, bool notify) {
  core_->registry().change([&] {
    compat::executed(*this).add_node(node);
    core_->registry().add_node(node);
  });
  if (notify) compat::address_of(interrupt_guard_condition_)->trigger();
}

void ReDAGExecutor::remove_node(distribution::NodePointer node, bool notify) {
  std::vector<rclcpp::CallbackGroup::SharedPtr> kept;  // destroyed without a lock
  core_->registry().change([&] {
    kept = compat::keep_groups(*this);
    compat::executed(*this).remove_node(node);
    core_->registry().remove_node(node);
  });
  if (notify) compat::address_of(interrupt_guard_condition_)->trigger();
}

// Takes `instance` by value: if no callback is in progress, it is destroyed here, with no lock held.
void ReDAGExecutor::retire_node(const rclcpp::node_interfaces::NodeBaseInterface::SharedPtr &node,
                                std::shared_ptr<void> instance) {
  core_->registry().keep_until_done(*node, instance);
  remove_node(node);
}

void ReDAGExecutor::add_callback_group(distribution::GroupPointer group, distribution::NodePointer node, bool notify) {
  core_->registry().change([&] {
    compat::add_group(*this, group, node);
    core_->registry().add_group(group, node);
  });
  if (notify) compat::address_of(interrupt_guard_condition_)->trigger();
}

void ReDAGExecutor::remove_callback_group(distribution::GroupPointer group, bool notify) {
  core_->registry().change([&] {
    compat::executed(*this).remove_callback_group(group);
    core_->registry().remove_group(group);
  });
  if (notify) compat::address_of(interrupt_guard_condition_)->trigger();
}

// ---- spinning ----

void ReDAGExecutor::spin() {
  const Spinning claimed(occupied_, spinning, "spin");
  if (!core_->begin_first_spin()) return;
  core_->spin();
}

void ReDAGExecutor::spin_some(nanoseconds max_duration) {
  const Spinning claimed(occupied_, spinning, "spin_some");
  if (!core_->begin_first_spin()) return;
  core_->spin_ready(max_duration, false);
}

void ReDAGExecutor::spin_all(nanoseconds max_duration) {
  if (max_duration < nanoseconds(0)) throw std::invalid_argument("max_duration must be greater than or equal to 0");
  const Spinning claimed(occupied_, spinning, "spin_all");
  if (!core_->begin_first_spin()) return;
  core_->spin_ready(max_duration, true);
}

void ReDAGExecutor::spin_once(nanoseconds timeout) {
  const Spinning claimed(occupied_, spinning, "spin_once");
  if (!core_->begin_first_spin()) return;
  core_->spin_one(timeout);
}

// Limits each wait to 10 ms, because something other than a callback of this executor may complete the future.
void ReDAGExecutor::spin_for_future(nanoseconds timeout) {
  constexpr nanoseconds kLongest = std::chrono::milliseconds(10);
  const bool is_long = timeout < nanoseconds(0) || timeout > kLongest;
  if (!core_->begin_first_spin()) {
    rclcpp::Executor::cancel();
    return;
  }
  core_->spin_one(is_long ? kLongest : timeout);
}

// Called by rclcpp's spin_until_future_complete, which sets rclcpp's flag but not occupied_.
void ReDAGExecutor::spin_once_impl(nanoseconds timeout) {
  try {
    const Claim occupied(occupied_, "spin_until_future_complete");
    spin_for_future(timeout);
  } catch (...) {
    rclcpp::Executor::cancel();  // a cancelled spin that has not returned yet may have seen rclcpp's flag set
    throw;
  }
}

// On Humble rclcpp calls spin_once_impl() instead.
rclcpp::FutureReturnCode ReDAGExecutor::spin_until_future_complete_impl(
    nanoseconds timeout, const std::function<std::future_status(nanoseconds)> &wait_for_future) {
  using rclcpp::FutureReturnCode;
  const auto is_complete = [&] { return wait_for_future(nanoseconds(0)) == std::future_status::ready; };
  if (is_complete()) return FutureReturnCode::SUCCESS;
  const auto start = std::chrono::steady_clock::now();
  const Spinning claimed(occupied_, spinning, "spin_until_future_complete");
  while (rclcpp::ok(context_) && spinning.load()) {
    nanoseconds left = timeout;
    if (timeout >= nanoseconds(0))
      left = std::max(nanoseconds(0), timeout - (std::chrono::steady_clock::now() - start));
    spin_for_future(left);
    if (is_complete()) return FutureReturnCode::SUCCESS;
    if (timeout >= nanoseconds(0) && std::chrono::steady_clock::now() - start >= timeout) {
      return FutureReturnCode::TIMEOUT;
    }
  }
  return FutureReturnCode::INTERRUPTED;
}

void ReDAGExecutor::cancel() {
  core_->cancel_first_spin();
  core_->start_no_more();
  rclcpp::Executor::cancel();  // last: the spin may end, and another one begin, while this thread has no processor
}

// ---- queries ----

const redag::runtime::Mode &ReDAGExecutor::mode() const { return core_->setup().mode; }
std::uint32_t ReDAGExecutor::workers() const { return core_->setup().config.workers; }
std::vector<std::string> ReDAGExecutor::warnings() const { return core_->warnings(); }
std::vector<std::string> ReDAGExecutor::errors() const { return core_->errors(); }
std::vector<Deadlock> ReDAGExecutor::deadlocks() const { return core_->deadlocks(); }
std::vector<CallbackStats> ReDAGExecutor::stats(bool percentiles) const {
  return core_->tasks().stats(core_->engine(), percentiles);
}
const std::vector<redag::Dag> &ReDAGExecutor::dags() const { return core_->tasks().dags(); }
const redag::runtime::Engine &ReDAGExecutor::engine() const { return core_->engine(); }
redag::Workload ReDAGExecutor::learned() const { return core_->tasks().learned(); }
bool ReDAGExecutor::learning_done() const { return core_->learning_done(); }
std::uint64_t ReDAGExecutor::lost_events() const { return core_->engine().lost_events(); }

void ReDAGExecutor::drain_trace(std::vector<redag::JobEvent> &events) { core_->engine().drain(events); }
std::string ReDAGExecutor::task_name(redag::TaskId task) const { return core_->tasks().name_of(task); }
redag::trace::Trace ReDAGExecutor::as_trace(std::vector<redag::JobEvent> events) const {
  std::vector<std::uint32_t> positions;
  redag::trace::RunInfo info = core_->run_info(positions);
  for (redag::JobEvent &event : events) event.task = redag::TaskId(positions.at(event.task.value));
  return {std::move(info), std::move(events)};
}

redag::trace::RunInfo ReDAGExecutor::run_info(std::vector<std::uint32_t> &positions) const {
  return core_->run_info(positions);
}

}  // namespace redag_rclcpp
