// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Services as callbacks: takes a request and calls the user's function. Each request is answered, also after a skip.
#include <rcl/service.h>
#include <rmw/rmw.h>

#include <string_view>
#include <utility>

#include "compat.hpp"
#include "entities/arrival_callback.hpp"
#include "entities/entities.hpp"
#include "entities/take.hpp"
#include "rclcpp/service.hpp"

namespace redag_rclcpp {
namespace {

// rmw_fastrtps (8.4.1) calls the hook of a service without looking whether it has just been taken away. A wait set
// still sees requests while there is a hook.
bool is_called_without_a_look() {
  return std::string_view(rmw_get_implementation_identifier()).starts_with("rmw_fastrtps");
}

class ServiceCallback final : public ArrivalCallback {
 public:
  ServiceCallback(std::shared_ptr<ExecutorContext> context, redag::CallbackId id,
                  const rclcpp::ServiceBase::SharedPtr &service)
      : ArrivalCallback(std::move(context), std::move(id), 0), service_(service) {
    take_part_in_exchange();
  }

  [[nodiscard]] bool alive() const override { return !service_.expired(); }
  [[nodiscard]] Exchange exchange() const override { return {.side = Exchange::Side::Server, .name = id().name}; }

  void count(const Held &, WaitSetSizes &sizes) const override { ++sizes.services; }
  void add(Held &held, rcl_wait_set_t &set) const override {
    auto &service = *static_cast<rclcpp::ServiceBase *>(held.entity.get());
    check_rcl(rcl_wait_set_add_service(&set, service.get_service_handle().get(), &held.index),
              "cannot wait for a service");
  }
  [[nodiscard]] bool is_ready(const Held &held, rcl_wait_set_t &set) const override {
    return set.services[held.index] != nullptr;
  }

 private:
  [[nodiscard]] std::shared_ptr<void> entity() const override { return service_.lock(); }

  void hook() override {
    const auto service = service_.lock();
    if (!service) return;
    hook_.set<rclcpp::ServiceBase>(
        service,
        [](rclcpp::ServiceBase &entity, rcl_event_callback_t call, const void *ticket) {
          return rcl_service_set_on_new_request_callback(entity.get_service_handle().get(), call, ticket);
        },
        self());
  }
  void unhook() override { hook_.clear(); }
  [[nodiscard]] bool is_hooked_by_user() const override {
    const auto service = service_.lock();
    return service && compat::is_hooked_by_user(*service);
  }

  [[nodiscard]] bool handle(const Token &, Taking &taking) override {
    taking.begin();
    const auto service = service_.lock();
    if (!service) return false;
    auto header = service->create_request_header();
    std::shared_ptr<void> request = service->create_request();
    return take_and_handle(
        "a request of service", service->get_service_name(),
        [&] { return service->take_type_erased_request(request.get(), *header); },
        [&] { service->handle_request(header, request); });
  }

  const std::weak_ptr<rclcpp::ServiceBase> service_;
  Hook hook_{is_called_without_a_look()};
};

}  // namespace

Entity entity_of(const rclcpp::ServiceBase::SharedPtr &service) {
  return {.key = service.get(),
          .id = {.kind = redag::Callback::Kind::Service, .node = {}, .name = service->get_service_name()},
          .make = [service](std::shared_ptr<ExecutorContext> context, redag::CallbackId id) {
            return std::make_shared<ServiceCallback>(std::move(context), std::move(id), service);
          }};
}

}  // namespace redag_rclcpp
