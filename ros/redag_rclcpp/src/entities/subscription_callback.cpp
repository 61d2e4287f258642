// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Subscriptions as callbacks: takes a message from the middleware, or from the buffer of its own process, and calls the
// user's function.
#include <rcl/error_handling.h>
#include <rcl/subscription.h>

#include <stdexcept>
#include <utility>

#include "compat.hpp"
#include "entities/arrival_callback.hpp"
#include "entities/entities.hpp"
#include "entities/take.hpp"
#include "rclcpp/subscription_base.hpp"

namespace redag_rclcpp {
namespace {

// Opens what rclcpp asks before it handles a message: whether intra-process communication delivers it as well.
struct Rclcpp : rclcpp::SubscriptionBase {
  using rclcpp::SubscriptionBase::matches_any_intra_process_publishers;
};

/// A message that stays in the middleware's memory, for instance shared memory, while the user's function reads it.
class Loan {
 public:
  explicit Loan(rclcpp::SubscriptionBase &subscription) : subscription_(subscription) {}
  ~Loan() {
    if (message_ == nullptr) return;
    if (rcl_return_loaned_message_from_subscription(subscription_.get_subscription_handle().get(), message_) ==
        RCL_RET_OK) {
      return;
    }
    RCLCPP_ERROR(rclcpp::get_logger("redag_rclcpp"), "cannot give back a loaned message of topic '%s': %s",
                 subscription_.get_topic_name(), rcl_get_error_string().str);
    rcl_reset_error();
  }
  Loan(const Loan &) = delete;
  Loan &operator=(const Loan &) = delete;

  /// False: there is none, or intra-process communication delivers it.
  [[nodiscard]] bool take(rclcpp::MessageInfo &info) {
    rmw_message_info_t &rmw = info.get_rmw_message_info();
    const rcl_ret_t result =
        rcl_take_loaned_message(subscription_.get_subscription_handle().get(), &message_, &rmw, nullptr);
    if (result == RCL_RET_SUBSCRIPTION_TAKE_FAILED) return false;
    check_rcl(result, "cannot take a loaned message");
    return !(subscription_.*(&Rclcpp::matches_any_intra_process_publishers))(&rmw.publisher_gid);
  }
  [[nodiscard]] void *message() const { return message_; }

 private:
  rclcpp::SubscriptionBase &subscription_;
  void *message_ = nullptr;
};

/// True if a buffer of messages of this process has one: taking from an empty one is not allowed. It looks at no wait
/// set.
bool has_message(rclcpp::Waitable &buffer) {
  static rcl_wait_set_t none = rcl_get_zero_initialized_wait_set();
  return compat::is_ready(buffer, none);
}

std::size_t depth_of(const rclcpp::QoS &qos) {
  return qos.history() == rclcpp::HistoryPolicy::KeepLast ? qos.depth() : 0;
}

class SubscriptionCallback final : public ArrivalCallback {
 public:
  /// `intra_process`: the waitable that brings the messages of its own process, or null.
  SubscriptionCallback(std::shared_ptr<ExecutorContext> context, redag::CallbackId id,
                       const rclcpp::SubscriptionBase::SharedPtr &subscription,
                       const rclcpp::Waitable::SharedPtr &intra_process)
      : ArrivalCallback(std::move(context), std::move(id), depth_of(subscription->get_actual_qos())),
        subscription_(subscription),
        intra_process_(intra_process),
        has_intra_process_(intra_process != nullptr) {}

  [[nodiscard]] bool alive() const override { return !subscription_.expired(); }
  [[nodiscard]] bool lends_messages() const override {
    const auto subscription = subscription_.lock();
    return subscription && subscription->can_loan_messages();
  }

  // The part of what is held is the waitable.
  [[nodiscard]] Held hooked() const override {
    Held held = ArrivalCallback::hooked();
    if (held.entity) held.part = intra_process_.lock();
    return held;
  }
  void count(const Held &held, WaitSetSizes &sizes) const override {
    ++sizes.subscriptions;
    if (held.part) sizes.add(part_of(held));
  }
  void add(Held &held, rcl_wait_set_t &set) const override {
    const auto &subscription = *static_cast<rclcpp::SubscriptionBase *>(held.entity.get());
    check_rcl(rcl_wait_set_add_subscription(&set, subscription.get_subscription_handle().get(), &held.index),
              "cannot wait for a subscription");
    if (held.part) compat::add_to_wait_set(part_of(held), set);
  }
  [[nodiscard]] bool is_ready(const Held &held, rcl_wait_set_t &set) const override {
    return set.subscriptions[held.index] != nullptr;
  }
  void take_leftovers(const Held &held, rcl_wait_set_t &set, bool any) override {
    const bool in_process = held.part && compat::is_ready(part_of(held), set);
    ArrivalCallback::take_leftovers(held, set, any);
    if (in_process) release_leftovers(Source::IntraProcess);
  }

 private:
  static rclcpp::Waitable &part_of(const Held &held) { return *static_cast<rclcpp::Waitable *>(held.part.get()); }

  [[nodiscard]] std::shared_ptr<void> entity() const override { return subscription_.lock(); }
  void hook() override;
  void hook_intra_process() override;
  void unhook() override;
  [[nodiscard]] bool is_hooked_by_user() const override {
    const auto subscription = subscription_.lock();
    return subscription && compat::is_hooked_by_user(*subscription);
  }
  [[nodiscard]] bool handle(const Token &token, Taking &taking) override;
  [[nodiscard]] bool handle_intra_process(const Token &token);
  [[nodiscard]] bool handle_from_middleware(rclcpp::SubscriptionBase &subscription, Taking &taking);
  // Later messages replace earlier ones.
  [[nodiscard]] bool drops_skipped() const override { return alive(); }
  [[nodiscard]] bool can_join() const override { return true; }
  void drop_skipped(Source source) override;

  const std::weak_ptr<rclcpp::SubscriptionBase> subscription_;
  const std::weak_ptr<rclcpp::Waitable> intra_process_;
  const bool has_intra_process_;
  Hook hook_;
};

void SubscriptionCallback::hook() {
  const auto subscription = subscription_.lock();
  if (!subscription) return;
  hook_.set<rclcpp::SubscriptionBase>(
      subscription,
      [](rclcpp::SubscriptionBase &entity, rcl_event_callback_t call, const void *ticket) {
        return rcl_subscription_set_on_new_message_callback(entity.get_subscription_handle().get(), call, ticket);
      },
      self());
}

void SubscriptionCallback::hook_intra_process() {
  const auto intra_process = intra_process_.lock();
  if (!intra_process) return;
  intra_process->set_on_ready_callback([self = std::static_pointer_cast<SubscriptionCallback>(shared_from_this())](
                                           std::size_t count, int) { self->arrived(count, Source::IntraProcess, 0); });
}

void SubscriptionCallback::unhook() {
  hook_.clear();
  const auto waitable = intra_process_.lock();
  if (!waitable) return;
  try {
    waitable->clear_on_ready_callback();
  } catch (const std::exception &) {
    // Setting this hook had failed as well.
  }
}

bool SubscriptionCallback::handle_intra_process(const Token &token) {
  const auto waitable = intra_process_.lock();
  if (!waitable || !has_message(*waitable)) return false;
  std::shared_ptr<void> data = waitable->take_data_by_entity_id(static_cast<std::size_t>(token.part));
  compat::execute(*waitable, data);
  return true;
}

bool SubscriptionCallback::handle(const Token &token, Taking &taking) {
  if (token.source == Source::IntraProcess) {
    taking.begin();
    return handle_intra_process(token);
  }
  const auto subscription = subscription_.lock();
  if (!subscription) {
    taking.begin();
    return false;
  }
  TRACETOOLS_TRACEPOINT(rclcpp_executor_execute,
                        static_cast<const void *>(subscription->get_subscription_handle().get()));
  const bool taken = handle_from_middleware(*subscription, taking);
  if (has_intra_process_) taking.count(taken);
  return taken;
}

bool SubscriptionCallback::handle_from_middleware(rclcpp::SubscriptionBase &subscription, Taking &taking) {
  rclcpp::MessageInfo info;
  info.get_rmw_message_info().from_intra_process = false;
  const auto begin = [&](auto take, auto handle) {
    taking.begin();
    return take_and_handle("a message of topic", subscription.get_topic_name(), take, handle);
  };
  if (subscription.is_serialized()) {
    std::shared_ptr<rclcpp::SerializedMessage> message = subscription.create_serialized_message();
    const bool taken = begin([&] { return subscription.take_serialized(*message, info); },
                             [&] { subscription.handle_serialized_message(message, info); });
    subscription.return_serialized_message(message);
    return taken;
  }
  if (subscription.can_loan_messages()) {
    Loan loan(subscription);
    return begin([&] { return loan.take(info); }, [&] { subscription.handle_loaned_message(loan.message(), info); });
  }
  std::shared_ptr<void> message = subscription.create_message();
  const bool taken = begin([&] { return subscription.take_type_erased(message.get(), info); },
                           [&] { subscription.handle_message(message, info); });
  subscription.return_message(message);
  return taken;
}

void SubscriptionCallback::drop_skipped(Source source) {
  const auto subscription = subscription_.lock();
  if (!subscription) return;
  if (source == Source::IntraProcess) {
    const auto intra_process = intra_process_.lock();
    return drop_messages(
        source, [&] { return intra_process && has_message(*intra_process) && intra_process->take_data() != nullptr; });
  }
  const auto drop = [&](auto take) {
    const auto dropped = [] {};
    drop_messages(source,
                  [&] { return take_and_handle("a message of topic", subscription->get_topic_name(), take, dropped); });
  };
  rclcpp::MessageInfo info;
  if (subscription->is_serialized()) {
    auto message = subscription->create_serialized_message();
    drop([&] { return subscription->take_serialized(*message, info); });
    subscription->return_serialized_message(message);
  } else {
    std::shared_ptr<void> message = subscription->create_message();
    // rclcpp says "nothing taken" of a message that intra-process communication delivers as well.
    drop([&] {
      return subscription->take_type_erased(message.get(), info) ||
             info.get_rmw_message_info().publisher_gid.implementation_identifier != nullptr;
    });
    subscription->return_message(message);
  }
}

rclcpp::Waitable::SharedPtr intra_process_of(rclcpp::SubscriptionBase &subscription) {
  try {
    return subscription.get_intra_process_waitable();
  } catch (const std::runtime_error &) {
    return nullptr;  // the intra-process manager is already gone
  }
}

}  // namespace

Entity entity_of(const rclcpp::SubscriptionBase::SharedPtr &subscription) {
  const rclcpp::Waitable::SharedPtr intra_process = intra_process_of(*subscription);
  return {.key = subscription.get(),
          .part = intra_process.get(),
          .id = {.kind = redag::Callback::Kind::Subscription, .node = {}, .name = subscription->get_topic_name()},
          .make = [subscription, intra_process](std::shared_ptr<ExecutorContext> context, redag::CallbackId id) {
            return std::make_shared<SubscriptionCallback>(std::move(context), std::move(id), subscription,
                                                          intra_process);
          }};
}

}  // namespace redag_rclcpp
