// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Waitables as callbacks: action servers and clients, QoS events, and what users derive from rclcpp::Waitable.
#include <cxxabi.h>

#include <cstdlib>
#include <memory>
#include <string>
#include <typeinfo>
#include <utility>

#include "arrival_callback.hpp"
#include "compat.hpp"
#include "entities.hpp"

namespace redag_rclcpp {
namespace {

/// The argument of the waitable's class template: "test_msgs::action::Fibonacci" for rclcpp_action::Client of it.
/// rclcpp does not tell the names of actions.
std::string action_type_of(const rclcpp::Waitable &waitable) {
  const char *const mangled = typeid(waitable).name();
  int status = 0;
  const std::unique_ptr<char, void (*)(void *)> name(abi::__cxa_demangle(mangled, nullptr, nullptr, &status),
                                                     std::free);
  const std::string type = status == 0 ? name.get() : mangled;
  const std::size_t begin = type.find('<');
  const std::size_t end = type.rfind('>');
  return begin < end && end != std::string::npos ? type.substr(begin + 1, end - begin - 1) : type;
}

Exchange exchange_of(const rclcpp::Waitable &waitable) {
  Exchange exchange;
  if (dynamic_cast<const rclcpp_action::ClientBase *>(&waitable) != nullptr) exchange.side = Exchange::Side::Client;
  if (dynamic_cast<const rclcpp_action::ServerBase *>(&waitable) != nullptr) exchange.side = Exchange::Side::Server;
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
        exchange_(exchange_of(*waitable)) {
    if (exchange_.side != Exchange::Side::None) take_part_in_exchange();
  }

  [[nodiscard]] bool alive() const override { return !waitable_.expired(); }
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
    hooked_ = true;
    waitable->set_on_ready_callback(
        [self = std::static_pointer_cast<WaitableCallback>(shared_from_this())](std::size_t count, int part) {
          self->arrived(count, Source::Middleware, part);
        });
  }
  void unhook() override {
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
  bool hooked_ = false;  // hook() was called, even if it failed
};

}  // namespace

Entity entity_of(const rclcpp::Waitable::SharedPtr &waitable) {
  return {.key = waitable.get(),
          .id = {.kind = redag::Callback::Kind::Waitable, .node = {}, .name = {}},
          .make = [waitable](std::shared_ptr<ExecutorContext> context, redag::CallbackId id) {
            return std::make_shared<WaitableCallback>(std::move(context), std::move(id), waitable);
          }};
}

}  // namespace redag_rclcpp
