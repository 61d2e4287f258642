// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Callbacks that wait without a worker, in each mode with one worker: what a user may count on. No test depends on how
// long anything takes.
#include "redag_rclcpp/coroutine.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "compat.hpp"
#include "composition_interfaces/srv/unload_node.hpp"
#include "environment.hpp"
#include "mode_test.hpp"
#include "rclcpp/rclcpp.hpp"
#include "redag/runtime/blocking.hpp"
#include "redag/threads/threads.hpp"
#include "redag_analysis/metrics/check/trace_checker.hpp"
#include "spinning.hpp"

namespace redag_rclcpp {
namespace {

using namespace std::chrono_literals;
using redag::Coroutine;
using Service = composition_interfaces::srv::UnloadNode;  // takes a number and returns a text
using Request = Service::Request;
using Response = Service::Response;
using ::testing::HasSubstr;

std::shared_ptr<Request> ask(int value) {
  auto request = std::make_shared<Request>();
  request->unique_id = static_cast<std::uint64_t>(value);
  return request;
}
int number_in(const Request &request) { return static_cast<int>(request.unique_id); }
int number_in(const Response &response) { return std::stoi(response.error_message); }
void answer(Response &response, int value) { response.error_message = std::to_string(value); }

/// True once, for timers whose first call is of interest.
class Once {
 public:
  [[nodiscard]] bool operator()() { return !done_.exchange(true); }

 private:
  std::atomic<bool> done_{false};
};

struct Ended {
  explicit Ended(std::atomic<int> &its_count) : count(its_count) {}
  ~Ended() { ++count; }
  Ended(const Ended &) = delete;
  Ended &operator=(const Ended &) = delete;
  std::atomic<int> &count;
};

class CoroutineTest : public ModeTest {
 protected:
  void TearDown() override {
    timers.clear();
    services.clear();
    clients.clear();
    server_node.reset();
    ModeTest::TearDown();
  }

  /// A service in a group of its own that answers with twice the value.
  void serve(const std::string &name) {
    if (!server_node) server_node = std::make_shared<rclcpp::Node>("server");
    const auto group =
        groups.emplace_back(server_node->create_callback_group(rclcpp::CallbackGroupType::MutuallyExclusive));
    services.push_back(server_node->create_service<Service>(
        name,
        [](const std::shared_ptr<Request> &request, const std::shared_ptr<Response> &response) {
          answer(*response, 2 * number_in(*request));
        },
        compat::services_qos(), group));
  }
  /// A service that does not answer.
  void serve_never(const std::string &name) {
    if (!server_node) server_node = std::make_shared<rclcpp::Node>("server");
    services.push_back(server_node->create_service<Service>(
        name, [this](const std::shared_ptr<rmw_request_id_t> &id, const std::shared_ptr<Request> &) {
          if (requests == 0) first_request = *id;
          ++requests;
        }));
  }
  /// In the node's default group, as the timers are.
  rclcpp::Client<Service>::SharedPtr client_of(const std::string &name) {
    clients.push_back(node->create_client<Service>(name));
    return std::static_pointer_cast<rclcpp::Client<Service>>(clients.back());
  }
  void timer(std::chrono::nanoseconds period, std::function<void()> body,
             const rclcpp::CallbackGroup::SharedPtr &group = nullptr) {
    timers.push_back(node->create_wall_timer(period, std::move(body), group));
  }
  /// Spins until `condition` holds.
  void spin_until(const std::function<bool()> &condition) {
    ReDAGExecutor executor(options);
    executor.add_node(node);
    if (server_node) executor.add_node(server_node);
    const Spinner<ReDAGExecutor> spinner(executor);
    EXPECT_TRUE(eventually(condition));
  }

  rmw_request_id_t first_request{};  // that serve_never() has; written before `requests`
  std::atomic<int> requests{0};
  rclcpp::Node::SharedPtr server_node;
  std::vector<rclcpp::ServiceBase::SharedPtr> services;
  std::vector<rclcpp::ClientBase::SharedPtr> clients;
  std::vector<rclcpp::TimerBase::SharedPtr> timers;
};

INSTANTIATE_TEST_SUITE_P(Modes, CoroutineTest,
                         ::testing::Values(redag::PreemptionMode::None, redag::PreemptionMode::Cooperative,
                                           redag::PreemptionMode::Os),
                         [](const auto &test) { return std::string(to_string(test.param)); });

// The deadlock of the documentation of ROS 2, with one line changed. REDAG_CALLS sets how often (100000 take seconds).
TEST_P(CoroutineTest, ACallbackCallsAServiceWhoseClientIsInItsOwnGroup) {
  const auto calls = static_cast<int>(from_environment("REDAG_CALLS", 500));
  serve("twice");
  const auto client = client_of("twice");
  std::atomic<int> answered{0};
  timer(1ms, coroutine([&, once = std::make_shared<Once>()]() -> Coroutine {
          if (!(*once)()) co_return;
          for (int i = 0; i < calls; ++i) {
            const auto response = co_await call(client, ask(i));
            if (number_in(*response) == 2 * i) ++answered;
          }
        }));
  ReDAGExecutor executor(options);
  executor.add_node(node);
  executor.add_node(server_node);
  const Spinner<ReDAGExecutor> spinner(executor);
  bool moves = true;
  for (int before = -1; moves && answered < calls; before = answered) {
    moves = eventually([&] { return answered > before; });
  }
  EXPECT_EQ(answered, calls);
}

// A job for each call, which costs a release and the end of a job more.
TEST_P(CoroutineTest, EachJobOfATimerCalls) {
  serve("twice");
  const auto client = client_of("twice");
  std::atomic<int> answered{0};
  timer(100us, coroutine([&]() -> Coroutine {
          const auto response = co_await call(client, ask(21));
          if (number_in(*response) == 42) ++answered;
        }));
  spin_until([&] { return answered >= 200; });
}

TEST_P(CoroutineTest, TheGroupIsHeldAndTheWorkerIsFree) {
  std::atomic<bool> inside{false};
  std::atomic<int> overlaps{0};
  std::atomic<int> others{0};
  std::atomic<int> in_group{0};
  std::atomic<int> rounds{0};
  redag::AsyncEvent event;
  timer(1ms, coroutine([&]() -> Coroutine {
          inside = true;
          const int before = others;
          while (others == before) co_await event;
          inside = false;
          ++rounds;
        }));
  timer(1ms, [&] {
    if (inside) ++overlaps;
    ++in_group;
  });
  timer(
      1ms,
      [&] {
        ++others;
        event.set();
      },
      new_group());
  spin_until([&] { return rounds >= 20 && in_group >= 5; });
  EXPECT_EQ(overlaps, 0);
}

// Responses of ordinary calls are for the client's callback in the client's group, whoever takes them.
TEST_P(CoroutineTest, OrdinaryCallsOfTheSameClientKeepTheirGroup) {
  constexpr int kRounds = 50;
  serve("twice");
  const auto client = client_of("twice");
  std::atomic<bool> inside{false};
  std::atomic<int> overlaps{0};
  std::atomic<int> ordinary{0};
  std::atomic<int> awaited{0};
  timer(1ms, coroutine([&]() -> Coroutine {
          if (awaited == kRounds) co_return;
          inside = true;
          for (int i = 0; i < 3; ++i) {
            client->async_send_request(ask(i), [&, i](rclcpp::Client<Service>::SharedFuture future) {
              if (inside) ++overlaps;
              if (number_in(*future.get()) == 2 * i) ++ordinary;
            });
          }
          const auto response = co_await call(client, ask(100));
          EXPECT_EQ(number_in(*response), 200);
          inside = false;
          ++awaited;
        }));
  spin_until([&] { return awaited == kRounds && ordinary == 3 * kRounds; });
  EXPECT_EQ(ordinary, 3 * kRounds);
  EXPECT_EQ(overlaps, 0);
}

TEST_P(CoroutineTest, ManyCallsOfOneClientAtATime) {
  constexpr int kCallers = 8;  // fewer than the requests that a service keeps
  constexpr int kCalls = 30;
  serve("twice");
  const auto client = client_of("twice");
  std::atomic<int> answered{0};
  for (int caller = 0; caller < kCallers; ++caller) {
    timer(1ms, coroutine([&, caller, once = std::make_shared<Once>()]() -> Coroutine {
            if (!(*once)()) co_return;
            for (int i = 0; i < kCalls; ++i) {
              const auto response = co_await call(client, ask(1000 * caller + i));
              if (number_in(*response) == 2 * (1000 * caller + i)) ++answered;
            }
          }),
          new_group());
  }
  options.threads = kCallers + 4;
  spin_until([&] { return answered == kCallers * kCalls; });
}

// All clients of a service receive its responses. While an urgent callback has the worker, those to another client
// arrive, and then that of the call. Each time a response is taken, rmw_fastrtps drops one of them.
TEST_P(CoroutineTest, AResponseBehindThoseToAnotherClient) {
  constexpr int kOthers = 5;  // with that of the call, fewer than a client keeps
  std::atomic<bool> serves{false};
  std::atomic<int> served{0};
  std::atomic<int> others_received{0};
  const auto elsewhere = std::make_shared<rclcpp::Node>("elsewhere");
  const auto service = elsewhere->create_service<Service>(
      "twice", [&](const std::shared_ptr<Request> &request, const std::shared_ptr<Response> &response) {
        while (!serves) std::this_thread::yield();
        answer(*response, 2 * number_in(*request));
        ++served;
      });
  const auto other = elsewhere->create_client<Service>("twice");
  const auto client = client_of("twice");
  ASSERT_TRUE(other->wait_for_service(kLimit));
  ASSERT_TRUE(client->wait_for_service(kLimit));
  for (int i = 0; i < kOthers; ++i) {
    other->async_send_request(ask(1), [&](rclcpp::Client<Service>::SharedFuture) { ++others_received; });
  }
  std::atomic<bool> calls{false};
  std::atomic<bool> answered{false};
  timer(100ms, coroutine([&, once = std::make_shared<Once>()]() -> Coroutine {
          if (!(*once)()) co_return;
          calls = true;
          const auto response = co_await call(client, ask(2));
          EXPECT_EQ(number_in(*response), 4);
          answered = true;
        }));
  timer(
      1ms,
      [&, once = std::make_shared<Once>()] {
        if (!calls || !(*once)()) return;
        serves = true;
        const auto end = std::chrono::steady_clock::now() + 1s;  // in `os`, the request may not be sent yet
        const auto all_are_sent = [&] { return served == kOthers + 1 && others_received == kOthers; };
        while (!all_are_sent() && std::chrono::steady_clock::now() < end) std::this_thread::yield();
        std::this_thread::sleep_for(20ms);  // the call's response is on its way
      },
      new_group());
  rclcpp::executors::SingleThreadedExecutor executor;
  executor.add_node(elsewhere);
  const Spinner<rclcpp::executors::SingleThreadedExecutor> spinner(executor);
  spin_until([&] { return answered.load(); });
}

TEST_P(CoroutineTest, ACallThatIsNotAnsweredEndsAtItsTimeout) {
  serve_never("never");
  serve("twice");
  const auto never = client_of("never");
  const auto absent = client_of("absent");
  const auto twice = client_of("twice");
  std::vector<bool> got;
  std::atomic<bool> done{false};
  timer(1ms, coroutine([&]() -> Coroutine {
          if (done) co_return;
          const auto start = std::chrono::steady_clock::now();
          while (requests == 0) {
            const auto response = co_await call(never, ask(1), 20ms);
            EXPECT_EQ(response, nullptr);
          }
          got.push_back(co_await call(absent, ask(1), 20ms) != nullptr);
          EXPECT_GE(std::chrono::steady_clock::now() - start, 20ms);
          got.push_back(co_await call(twice, ask(1), std::chrono::nanoseconds::max()) != nullptr);
          done = true;
        }));
  spin_until([&] { return done.load(); });
  EXPECT_EQ(got, (std::vector<bool>{false, true}));
}

// A response that comes after the timeout belongs to no call. It must not be given to the next one.
TEST_P(CoroutineTest, ALateResponseIsDropped) {
  serve_never("late");
  const auto client = client_of("late");
  std::atomic<bool> done{false};
  timer(1ms, coroutine([&]() -> Coroutine {
          if (done) co_return;
          while (requests == 0) {
            const auto first = co_await call(client, ask(1), 5ms);
            EXPECT_EQ(first, nullptr);
          }
          Response late;
          answer(late, 111);
          std::static_pointer_cast<rclcpp::Service<Service>>(services[0])->send_response(first_request, late);
          const auto second = co_await call(client, ask(2), 5ms);
          EXPECT_EQ(second, nullptr);
          done = true;
        }));
  spin_until([&] { return done.load(); });
}

TEST_P(CoroutineTest, CallbacksOfEveryKind) {
  serve("twice");
  const auto client = client_of("twice");
  std::atomic<int> by_reference{0};
  std::atomic<int> by_pointer{0};
  std::atomic<int> responses{0};
  const auto first = node->create_subscription<test_msgs::msg::Empty>(
      "first", 10, coroutine([&](const test_msgs::msg::Empty &) -> Coroutine {
        if (number_in(*co_await call(client, ask(1))) == 2) ++by_reference;
      }));
  const auto second = node->create_subscription<test_msgs::msg::Empty>(
      "first", 10, coroutine([&](std::unique_ptr<test_msgs::msg::Empty> message) -> Coroutine {
        co_await redag::sleep_for(1ms);
        if (message) ++by_pointer;
      }));
  // A service that calls another one.
  const auto four = node->create_service<Service>(
      "four_times", service_coroutine<Service>(
                        [&](std::shared_ptr<Request> request, std::shared_ptr<Response> response) -> Coroutine {
                          const auto doubled = co_await call(client, ask(number_in(*request)));
                          answer(*response, 2 * number_in(*doubled));
                        }));
  const auto caller = node->create_client<Service>("four_times", compat::services_qos(), new_group());
  const auto publisher = node->create_publisher<test_msgs::msg::Empty>("first", 10);
  timer(1ms, coroutine([&]() -> Coroutine {
          publisher->publish(test_msgs::msg::Empty());
          if (number_in(*co_await call(caller, ask(5))) == 20) ++responses;
          // The callback of a response can wait as well.
          client->async_send_request(ask(1), coroutine([&](rclcpp::Client<Service>::SharedFuture future) -> Coroutine {
                                       co_await redag::sleep_for(100us);
                                       if (number_in(*future.get()) == 2) ++responses;
                                     }));
        }),
        new_group());
  spin_until([&] { return by_reference >= 5 && by_pointer >= 5 && responses >= 10; });
}

TEST_P(CoroutineTest, ADeviceServesACallback) {
  options.workload = valid(R"(
name: w
platform: {devices: {gpu: {slots: 1}}}
dags:
  - name: d
    tasks:
      - name: sees
        period: 1ms
        segments: [{cpu: 100us}, {device: gpu, for: 100us}, {cpu: 100us}]
        callback: {node: /node, timer: {period: 1ms, index: 0}}
)");
  const std::vector<int> usable = redag::runtime::usable_cpus();
  options.workers = 1;
  std::atomic<bool> pinned{false};
  std::atomic<int> served{0};
  std::atomic<int> rounds{0};
  std::atomic<bool> refused{false};
  timer(1ms, coroutine([&]() -> Coroutine {
          co_await device("gpu").run([&] {
            ++served;
            pinned = pinned || redag::runtime::usable_cpus() != usable;  // as the worker is in mode os
          });
          ++rounds;
        }));
  timer(
      1ms,
      [&] {
        try {
          (void)device("dla");
        } catch (const std::out_of_range &) {
          refused = true;
        }
      },
      new_group());
  spin_until([&] { return rounds >= 10 && refused; });
  EXPECT_GE(served, rounds);
  EXPECT_FALSE(pinned);
}

// A synchronous call with one worker: the client is in a group of its own, and the worker is lent.
TEST_P(CoroutineTest, ACallThatBlocksLendsItsWorker) {
  serve("double");
  options.threads = options.workers + 16;
  const auto group = groups.emplace_back(node->create_callback_group(rclcpp::CallbackGroupType::MutuallyExclusive));
  const auto client = node->create_client<Service>("double", compat::services_qos(), group);
  std::atomic<int> result{0};
  timer(10ms, [&, first = std::make_shared<Once>()] {
    if (!(*first)()) return;
    const redag::Blocking scope;
    EXPECT_TRUE(scope.lends());
    ASSERT_TRUE(client->wait_for_service(60s));
    result = number_in(*client->async_send_request(ask(21)).get());
  });
  spin_until([&] { return result != 0; });
  EXPECT_EQ(result.load(), 42);
}

TEST_P(CoroutineTest, CancelEndsWaits) {
  serve_never("never");
  const auto client = client_of("never");
  std::atomic<int> ended{0};
  std::atomic<int> went_on{0};
  timer(1ms, coroutine([&]() -> Coroutine {
          const Ended local(ended);
          (void)co_await call(client, ask(1));
          ++went_on;
        }));
  ReDAGExecutor executor(options);
  executor.add_node(node);
  executor.add_node(server_node);
  for (int round = 1; round <= 3; ++round) {
    Spinner<ReDAGExecutor> spinner(executor);
    EXPECT_TRUE(eventually([&] { return requests == round; }));
    EXPECT_EQ(ended, round - 1);
    spinner.stop();
    EXPECT_EQ(ended, round) << "before spin() returns";
  }
  EXPECT_EQ(went_on, 0);
}

TEST_P(CoroutineTest, ADestroyedNodeEndsItsWaits) {
  serve_never("never");
  std::atomic<int> ended{0};
  std::atomic<int> went_on{0};
  std::atomic<int> asleep{0};
  auto doomed = std::make_shared<rclcpp::Node>("doomed");
  auto client = doomed->create_client<Service>("never");
  auto calls = doomed->create_wall_timer(1ms, coroutine([&]() -> Coroutine {
                                           const Ended local(ended);
                                           (void)co_await call(client, ask(1));
                                           ++went_on;
                                         }));
  const auto group = doomed->create_callback_group(rclcpp::CallbackGroupType::MutuallyExclusive);
  auto sleeps = doomed->create_wall_timer(1ms, coroutine([&]() -> Coroutine {
                                            const Ended local(ended);
                                            ++asleep;
                                            co_await redag::sleep_for(1h);
                                            ++went_on;
                                          }),
                                          group);
  ReDAGExecutor executor(options);
  executor.add_node(doomed);
  executor.add_node(server_node);
  const Spinner<ReDAGExecutor> spinner(executor);
  EXPECT_TRUE(eventually([&] { return requests == 1 && asleep == 1; }));
  executor.remove_node(doomed);
  calls.reset();
  sleeps.reset();
  client.reset();
  doomed.reset();
  EXPECT_TRUE(eventually([&] { return ended == 2; }));
  EXPECT_EQ(went_on, 0);
}

// The executor does not know yet that the entity is gone when the wait ends.
TEST_P(CoroutineTest, ACallbackWhoseTimerIsGoneDoesNotGoOn) {
  redag::AsyncEvent event;
  std::atomic<int> waits{0};
  std::atomic<int> ended{0};
  std::atomic<int> went_on{0};
  timer(1ms, coroutine([&]() -> Coroutine {
          const Ended local(ended);
          ++waits;
          co_await event;
          ++went_on;
        }));
  ReDAGExecutor executor(options);
  executor.add_node(node);
  const Spinner<ReDAGExecutor> spinner(executor);
  EXPECT_TRUE(eventually([&] { return waits == 1; }));
  timers.clear();
  event.set();
  EXPECT_TRUE(eventually([&] { return ended == 1; }));
  EXPECT_EQ(went_on, 0);
}

TEST_P(CoroutineTest, AnExceptionAfterAWaitLeavesSpin) {
  timer(1ms, coroutine([&]() -> Coroutine {
          co_await redag::sleep_for(1ms);
          throw std::runtime_error("after the wait");
        }));
  ReDAGExecutor executor(options);
  executor.add_node(node);
  try {
    executor.spin();
    FAIL() << "no exception";
  } catch (const std::runtime_error &error) {
    EXPECT_STREQ(error.what(), "after the wait");
  }
}

TEST_P(CoroutineTest, WhereNothingWouldGoOnItIsRefused) {
  timer(1ms, coroutine([&]() -> Coroutine { co_await redag::sleep_for(1ms); }));
  {
    ReDAGExecutor executor(options);
    executor.add_node(node);
    try {
      (void)eventually([&] {
        executor.spin_once(100ms);
        return false;
      });
      FAIL() << "no exception";
    } catch (const std::logic_error &error) {
      EXPECT_THAT(error.what(), HasSubstr("spin()"));
    }
  }
  rclcpp::executors::SingleThreadedExecutor other;
  other.add_node(node);
  try {
    (void)eventually([&] {
      other.spin_once(100ms);
      return false;
    });
    FAIL() << "no exception";
  } catch (const std::logic_error &error) {
    EXPECT_THAT(error.what(), HasSubstr("ReDAGExecutor"));
  }
}

TEST_P(CoroutineTest, OneJobWithAllOfItsWaitsIsCountedAndTraced) {
  std::atomic<int> rounds{0};
  options.trace_capacity = 10000;
  serve("twice");
  const auto client = client_of("twice");
  timer(5ms, coroutine([&]() -> Coroutine {
          co_await redag::sleep_for(1ms);
          (void)co_await call(client, ask(1));
          ++rounds;
        }));
  ReDAGExecutor executor(options);
  executor.add_node(node);
  executor.add_node(server_node);
  {
    const Spinner<ReDAGExecutor> spinner(executor);
    EXPECT_TRUE(eventually([&] { return rounds >= 10; }));
  }
  for (const CallbackStats &stats : executor.stats()) {
    if (stats.id.kind != redag::Callback::Kind::Timer) continue;
    EXPECT_EQ(stats.jobs.finished, static_cast<std::uint64_t>(rounds));
    EXPECT_GE(stats.response_p50, redag::kMillisecond);
    EXPECT_GT(stats.execution_max, 0);
  }
  std::vector<redag::JobEvent> events;
  executor.drain_trace(events);
  const redag::trace::Trace trace = executor.as_trace(events);
  const auto report = redag::metrics::check_trace(trace, redag::metrics::rules_for(trace.info));
  EXPECT_TRUE(report.ok()) << report.to_string();
}

}  // namespace
}  // namespace redag_rclcpp
