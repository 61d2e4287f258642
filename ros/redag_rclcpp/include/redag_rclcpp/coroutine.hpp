// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Callbacks that wait without a worker: a callback is a coroutine if redag_rclcpp::coroutine() wraps a function that
// returns redag::Coroutine. It may then await the response of a service, also where its client is in its own mutually
// exclusive group:
//
//   timer_ = create_wall_timer(100ms, redag_rclcpp::coroutine([this]() -> redag::Coroutine {
//     const auto response = co_await redag_rclcpp::call(client_, std::make_shared<Trigger::Request>());
//   }));
//
// docs/ros2.md, "Callbacks that wait", has the rules.
#pragma once

#include <chrono>
#include <coroutine>
#include <functional>
#include <memory>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>

#include "rclcpp/client.hpp"
#include "rclcpp/clock.hpp"
#include "rclcpp/function_traits.hpp"
#include "rclcpp/service.hpp"
#include "redag/engine/coroutine.hpp"
#include "redag/runtime/async_event.hpp"
#include "redag/runtime/device_handle.hpp"

namespace redag_rclcpp {

class Callback;

namespace detail {

/// The job of the calling callback, which a coroutine is about to be part of.
class CallbackJob {
 public:
  /// Throws std::logic_error if the calling thread runs no callback that may wait.
  CallbackJob();

  /// True if the middleware takes the message back when the callback returns.
  [[nodiscard]] bool lends_messages() const;
  /// Runs the coroutine until its first wait. The job goes on with the rest.
  static void run(redag::Coroutine coroutine);

 private:
  std::shared_ptr<Callback> callback_;
};

/// What a shared pointer owns, if that can be copied; otherwise void.
template <class Pointer>
struct Pointee {
  using Type = void;
};
template <class Message>
requires std::is_copy_constructible_v<Message>
struct Pointee<std::shared_ptr<Message>> {
  using Type = std::remove_const_t<Message>;
};

/// The argument as the coroutine keeps it.
template <class Argument>
std::decay_t<Argument> keep(const CallbackJob &job, Argument &&argument) {
  using Message = typename Pointee<std::decay_t<Argument>>::Type;
  if constexpr (!std::is_void_v<Message>) {
    if (argument && job.lends_messages()) return std::make_shared<Message>(*argument);
  }
  return std::forward<Argument>(argument);
}

/// Its frame has all that the user's coroutine may refer to: the function with its captures, and the arguments.
template <class Function, class... Arguments>
redag::Coroutine run_callback(std::shared_ptr<Function> function, std::decay_t<Arguments>... arguments) {
  co_await (*function)(static_cast<Arguments &&>(arguments)...);
}

template <class Function, class... Arguments>
std::function<void(Arguments...)> make_callback(std::shared_ptr<Function> function, const std::tuple<Arguments...> *) {
  static_assert(std::is_same_v<std::invoke_result_t<Function &, Arguments...>, redag::Coroutine>,
                "redag_rclcpp::coroutine() takes a function that returns redag::Coroutine");
  return [function](Arguments... arguments) {
    const CallbackJob job;
    CallbackJob::run(run_callback<Function, Arguments...>(function, keep(job, std::forward<Arguments>(arguments))...));
  };
}

/// For co_await: runs the coroutine that Derived::run() returns, and returns Derived::result().
template <class Derived>
class Awaitable {
 public:
  [[nodiscard]] bool await_ready() const noexcept { return false; }
  [[nodiscard]] std::coroutine_handle<> await_suspend(std::coroutine_handle<> caller) {
    part_ = derived().run();
    return redag::Coroutine::Part{part_.handle()}.await_suspend(caller);
  }
  [[nodiscard]] auto await_resume() {
    redag::Coroutine::Part{part_.handle()}.await_resume();
    return derived().result();
  }
  /// By value: GCC 12 copies an awaiter that it is given by reference.
  [[nodiscard]] Derived in_coroutine() && { return std::move(derived()); }

 private:
  friend Derived;
  Awaitable() = default;
  [[nodiscard]] Derived &derived() { return static_cast<Derived &>(*this); }

  redag::Coroutine part_;
};

/// One call of a service. The library's part, which knows no types.
class CallBase {
 public:
  CallBase(const std::shared_ptr<rclcpp::ClientBase> &client, std::shared_ptr<void> request,
           std::chrono::steady_clock::time_point until)
      : client_(client), request_(std::move(request)), until_(until) {}

  /// Waits for the response.
  [[nodiscard]] redag::Coroutine run();

 protected:
  CallBase(CallBase &&) = default;
  CallBase &operator=(CallBase &&) = delete;
  ~CallBase() = default;
  /// The response; null: it did not come in time.
  [[nodiscard]] std::shared_ptr<void> take_response() { return std::move(response_); }

 private:
  const std::weak_ptr<rclcpp::ClientBase> client_;  // the coroutine keeps no entity of its node
  std::shared_ptr<void> request_;
  const std::chrono::steady_clock::time_point until_;
  std::shared_ptr<void> response_;
};

template <class Service>
class Call : public CallBase, public Awaitable<Call<Service>> {
 public:
  using CallBase::CallBase;

  [[nodiscard]] std::shared_ptr<typename Service::Response> result() {
    return std::static_pointer_cast<typename Service::Response>(take_response());
  }
};

/// For co_await: see sleep_until().
class ClockSleep : public Awaitable<ClockSleep> {
 public:
  ClockSleep(std::shared_ptr<rclcpp::Clock> clock, const rclcpp::Time &until);

  [[nodiscard]] redag::Coroutine run();
  void result() const {}

 private:
  std::shared_ptr<rclcpp::Clock> clock_;
  rclcpp::Time until_;
};

}  // namespace detail

/// A callback for subscriptions, timers, responses and the like, from a function with the same arguments that returns
/// redag::Coroutine. While it waits, its worker runs other callbacks, and it keeps its callback group. The coroutine
/// keeps the function's captures and its arguments, those passed by reference as copies.
///
/// Calling it throws std::logic_error unless ReDAGExecutor::spin() runs the callback.
template <class Function>
[[nodiscard]] auto coroutine(Function &&function) {
  using Stored = std::decay_t<Function>;
  using Arguments = typename rclcpp::function_traits::function_traits<Stored>::arguments;
  return detail::make_callback(std::make_shared<Stored>(std::forward<Function>(function)),
                               static_cast<const Arguments *>(nullptr));
}

/// A callback for create_service<Service>(), from a function that takes the request and the response to fill, both as
/// shared pointers by value, and returns redag::Coroutine. The response is sent when the coroutine has ended. If it
/// ends by an exception, none is sent, as with other callbacks.
template <class Service, class Function>
[[nodiscard]] auto service_coroutine(Function &&function) {
  using Request = std::shared_ptr<typename Service::Request>;
  using Server = rclcpp::Service<Service>;
  auto callback = coroutine(
      [function = std::make_shared<std::decay_t<Function>>(std::forward<Function>(function))](
          std::weak_ptr<Server> weak, std::shared_ptr<rmw_request_id_t> id, Request request) -> redag::Coroutine {
        const auto response = std::make_shared<typename Service::Response>();
        co_await (*function)(std::move(request), response);
        if (const auto server = weak.lock()) server->send_response(*id, *response);
      });
  return std::function<void(std::shared_ptr<Server>, std::shared_ptr<rmw_request_id_t>, Request)>(
      [callback = std::move(callback)](const std::shared_ptr<Server> &server, std::shared_ptr<rmw_request_id_t> id,
                                       Request request) { callback(server, std::move(id), std::move(request)); });
}

/// A device of the executor that runs the calling callback: co_await device("gpu").run(f)
/// (redag::runtime::DeviceHandle). Throws std::out_of_range if the executor has no such device, and std::logic_error
/// outside callbacks.
[[nodiscard]] redag::runtime::DeviceHandle device(const std::string &name);

/// co_await sleep_until(clock, time): goes on once the clock shows `time`, for instance that of a node, get_clock().
/// With use_sim_time this is at the first message on /clock that says so. A clock that goes back makes the wait longer,
/// and one that jumps ahead ends it. If the system's clock is set, this is seen within 100 ms. Throws
/// std::invalid_argument if the time is of another clock type.
[[nodiscard]] detail::ClockSleep sleep_until(const std::shared_ptr<rclcpp::Clock> &clock, const rclcpp::Time &time);
/// co_await sleep_for(clock, duration): as sleep_until(), `duration` after what the clock shows now.
[[nodiscard]] detail::ClockSleep sleep_for(const std::shared_ptr<rclcpp::Clock> &clock,
                                           const rclcpp::Duration &duration);

/// co_await call(client, request): sends the request and returns the response. Waits for the service to be available
/// first, and logs a warning if that takes longer than a second. The client's node must be in a ReDAGExecutor, which
/// may be another one. Throws std::runtime_error if the client is destroyed meanwhile.
template <class Service>
[[nodiscard]] detail::Call<Service> call(const std::shared_ptr<rclcpp::Client<Service>> &client,
                                         std::shared_ptr<typename Service::Request> request) {
  return {client, std::move(request), std::chrono::steady_clock::time_point::max()};
}
/// The same with a limit on all that: returns null if there is no response after `timeout` on
/// std::chrono::steady_clock. A response that comes later is dropped.
template <class Service, class Rep, class Period>
[[nodiscard]] detail::Call<Service> call(const std::shared_ptr<rclcpp::Client<Service>> &client,
                                         std::shared_ptr<typename Service::Request> request,
                                         std::chrono::duration<Rep, Period> timeout) {
  return {client, std::move(request), redag::from_now(timeout)};
}

}  // namespace redag_rclcpp
