// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Clients as callbacks: takes a response and calls the user's function. Each response is handled, also after a skip.
// Responses of awaited calls are taken by the jobs that await them.
#include <rcl/client.h>

#include <utility>

#include "await/awaited_calls.hpp"
#include "compat.hpp"
#include "entities/arrival_callback.hpp"
#include "entities/entities.hpp"
#include "entities/take.hpp"
#include "rclcpp/client.hpp"

namespace redag_rclcpp {
namespace {

class ClientCallback final : public ArrivalCallback, public ResponseCallback {
 public:
  ClientCallback(std::shared_ptr<ExecutorContext> context, redag::CallbackId id,
                 const rclcpp::ClientBase::SharedPtr &client)
      : ArrivalCallback(std::move(context), std::move(id), 0), client_(client), calls_(AwaitedCalls::of(client)) {
    take_part_in_exchange();
  }

  [[nodiscard]] bool alive() const override { return !client_.expired(); }
  [[nodiscard]] Exchange exchange() const override { return {.side = Exchange::Side::Client, .name = id().name}; }

  void detach() override {
    calls_->detach();
    ArrivalCallback::detach();
  }
  void arrived_in_middleware(std::size_t count) noexcept override {
    if (!calls_->wake(count)) ArrivalCallback::arrived_in_middleware(count);
  }
  void leave_to_callback(std::size_t count) override { arrived(count, Source::Middleware, 0); }

  void count(const Held &, WaitSetSizes &sizes) const override { ++sizes.clients; }
  void add(Held &held, rcl_wait_set_t &set) const override {
    auto &client = *static_cast<rclcpp::ClientBase *>(held.entity.get());
    check_rcl(rcl_wait_set_add_client(&set, client.get_client_handle().get(), &held.index), "cannot wait for a client");
  }
  [[nodiscard]] bool is_ready(const Held &held, rcl_wait_set_t &set) const override {
    return set.clients[held.index] != nullptr;
  }

 private:
  [[nodiscard]] std::shared_ptr<void> entity() const override { return client_.lock(); }

  void hook() override {
    const auto client = client_.lock();
    if (!client) return;
    hook_.set<rclcpp::ClientBase>(
        client,
        [](rclcpp::ClientBase &entity, rcl_event_callback_t call, const void *ticket) {
          return rcl_client_set_on_new_response_callback(entity.get_client_handle().get(), call, ticket);
        },
        self());
    calls_->attach(std::static_pointer_cast<ClientCallback>(shared_from_this()));
  }
  void unhook() override { hook_.clear(); }
  [[nodiscard]] bool is_hooked_by_user() const override {
    const auto client = client_.lock();
    return client && compat::is_hooked_by_user(*client);
  }

  [[nodiscard]] bool handle(const Token &, Taking &taking) override {
    taking.begin();
    const auto client = client_.lock();
    if (!client) return false;
    if (Response set_aside = calls_->take_set_aside(); set_aside.message) {
      client->handle_response(set_aside.id, set_aside.message);
      return true;
    }
    Response response{client->create_request_header(), client->create_response()};
    return take_and_handle(
        "a response of service", client->get_service_name(),
        [&] { return client->take_type_erased_response(response.message.get(), *response.id); },
        [&] {
          if (!calls_->deliver(response)) client->handle_response(response.id, response.message);
        });
  }

  const std::weak_ptr<rclcpp::ClientBase> client_;
  const std::shared_ptr<AwaitedCalls> calls_;
  Hook hook_;
};

}  // namespace

Entity entity_of(const rclcpp::ClientBase::SharedPtr &client) {
  return {.key = client.get(),
          .id = {.kind = redag::Callback::Kind::Client, .node = {}, .name = client->get_service_name()},
          .make = [client](std::shared_ptr<ExecutorContext> context, redag::CallbackId id) {
            return std::make_shared<ClientCallback>(std::move(context), std::move(id), client);
          }};
}

}  // namespace redag_rclcpp
