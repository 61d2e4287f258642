// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Waitables as callbacks: action servers and clients, QoS events, and what users derive from rclcpp::Waitable.
#include <utility>

#include "arrival_callback.hpp"
#include "compat.hpp"
#include "entities.hpp"

namespace redag_rclcpp {
namespace {

class WaitableCallback final : public ArrivalCallback {
 public:
  WaitableCallback(std::shared_ptr<ExecutorContext> context, redag::CallbackId id,
                   const rclcpp::Waitable::SharedPtr &waitable)
      : ArrivalCallback(std::move(context), std::move(id), 0, compat::needs_wait_set(*waitable)), waitable_(waitable) {}

  [[nodiscard]] bool alive() const override { return !waitable_.expired(); }

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
    waitable->set_on_ready_callback(
        [self = std::static_pointer_cast<WaitableCallback>(shared_from_this())](std::size_t count, int part) {
          self->arrived(count, Source::Middleware, part);
        });
  }
  void unhook() override {
    const auto waitable = waitable_.lock();
    if (!waitable) return;
    try {
      waitable->clear_on_ready_callback();
    } catch (const std::exception &) {
      // Setting this hook had failed as well.
    }
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
