// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Waitables as callbacks: action servers and clients, QoS events, and what users derive from rclcpp::Waitable.
#include <rcl/event_callback.h>

#include <functional>
#include <memory>
#include <string>
#include <utility>

#include "compat.hpp"
#include "entities/action_names.hpp"
#include "entities/arrival_callback.hpp"
#include "entities/entities.hpp"
#include "entities/hook.hpp"
#include "redag_rclcpp/join.hpp"

namespace redag_rclcpp {
namespace {

Exchange::Side side_of(const rclcpp::Waitable &waitable) {
  if (dynamic_cast<const rclcpp_action::ClientBase *>(&waitable) != nullptr) return Exchange::Side::Client;
  if (dynamic_cast<const rclcpp_action::ServerBase *>(&waitable) != nullptr) return Exchange::Side::Server;
  return Exchange::Side::None;
}

Exchange exchange_of(const rclcpp::Waitable &waitable) {
  Exchange exchange;
  exchange.side = side_of(waitable);
  exchange.is_action = exchange.side != Exchange::Side::None;
  if (exchange.is_action) exchange.name = action_type_of(waitable);
  return exchange;
}

class WaitableCallback final : public ArrivalCallback {
 public:
  WaitableCallback(std::shared_ptr<ExecutorContext> context, redag::CallbackId id,
                   const rclcpp::Waitable::SharedPtr &waitable)
      : ArrivalCallback(std::move(context), std::move(id), 0, compat::needs_wait_set(*waitable)),
        waitable_(waitable),
        exchange_(exchange_of(*waitable)),
        is_join_(dynamic_cast<const JoinBase *>(waitable.get()) != nullptr) {
    if (exchange_.side != Exchange::Side::None) take_part_in_exchange();
  }

  [[nodiscard]] bool alive() const override { return !waitable_.expired(); }
  // Other waitables can need a call for each time that they are ready.
  [[nodiscard]] bool can_join() const override { return is_join_; }
  [[nodiscard]] Exchange exchange() const override { return exchange_; }

  // The on-ready hook also reports what was ready before.
  [[nodiscard]] Held hooked() const override { return {}; }
  void count(const Held &held, WaitSetSizes &sizes) const override { sizes.add(waitable_of(held)); }
  void add(Held &held, rcl_wait_set_t &set) const override { compat::add_to_wait_set(waitable_of(held), set); }
  [[nodiscard]] bool is_ready(const Held &held, rcl_wait_set_t &set) const override {
    return compat::is_ready(waitable_of(held), set);
  }

 private:
  static rclcpp::Waitable &waitable_of(const Held &held) { return *static_cast<rclcpp::Waitable *>(held.entity.get()); }

  [[nodiscard]] std::shared_ptr<void> entity() const override { return waitable_.lock(); }

  void hook() override {
    const auto waitable = waitable_.lock();
    if (!waitable) return;
    if (const auto event = compat::event_to_hook(waitable)) {
      event_hook_.set<rcl_event_t>(
          event,
          [](rcl_event_t &entity, rcl_event_callback_t call, const void *ticket) {
            return rcl_event_set_callback(&entity, call, ticket);
          },
          self());
      return;
    }
    hooked_ = true;
    waitable->set_on_ready_callback(
        [self = std::static_pointer_cast<WaitableCallback>(shared_from_this())](std::size_t count, int part) {
          self->arrived(count, Source::Middleware, part);
        });
  }
  void unhook() override {
    event_hook_.clear();
    const auto waitable = waitable_.lock();
    if (!waitable || !hooked_) return;  // without a hook of ours, it may be the user's
    hooked_ = false;
    try {
      waitable->clear_on_ready_callback();
    } catch (const std::exception &) {
      // Setting this hook had failed as well.
    }
  }

  [[nodiscard]] bool is_hooked_by_user() const override {
    const auto waitable = waitable_.lock();
    return waitable && compat::is_hooked_by_user(*waitable);
  }

  // A join drops messages itself.
  void drop_skipped(Source source) override {
    drop_messages(source, [] { return true; });
  }
  [[nodiscard]] bool handle(const Token &token, Taking &taking) override {
    taking.begin();
    const auto waitable = waitable_.lock();
    if (!waitable) return false;
    std::shared_ptr<void> data = token.seen_only
                                     ? waitable->take_data()
                                     : waitable->take_data_by_entity_id(static_cast<std::size_t>(token.part));
    compat::execute(*waitable, data);
    return true;
  }

  const std::weak_ptr<rclcpp::Waitable> waitable_;
  const Exchange exchange_;
  const bool is_join_;
  Hook event_hook_;      // of a QoS event whose hook is set below rclcpp
  bool hooked_ = false;  // hook() has set the on-ready hook, even if that failed
};

}  // namespace

Entity entity_of(const rclcpp::Waitable::SharedPtr &waitable) {
  const bool is_action = side_of(*waitable) != Exchange::Side::None;
  return {.key = waitable.get(),
          .id = {.kind = is_action ? redag::Callback::Kind::Action : redag::Callback::Kind::Waitable,
                 .node = {},
                 .name = {}},
          .name_of = is_action ? [waitable](rclcpp::Context &context) { return action_name_of(*waitable, context); }
                               : std::function<std::string(rclcpp::Context &)>(),
          .make = [waitable](std::shared_ptr<ExecutorContext> context, redag::CallbackId id) {
            return std::make_shared<WaitableCallback>(std::move(context), std::move(id), waitable);
          }};
}

}  // namespace redag_rclcpp
