// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Tests that callbacks which wait for a response that cannot reach them are named, in each mode, and others are not.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rcutils/logging.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdarg>
#include <cstdio>
#include <functional>
#include <future>
#include <list>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "mode_test.hpp"
#include "rclcpp/rclcpp.hpp"
#include "rclcpp_action/rclcpp_action.hpp"
#include "redag/live/reader.hpp"
#include "redag/live/writer.hpp"
#include "redag/threads/parker.hpp"
#include "redag_rclcpp/monitor.hpp"
#include "spinning.hpp"
#include "test_msgs/action/fibonacci.hpp"
#include "test_msgs/srv/empty.hpp"
#include "watch/thread_wait.hpp"

namespace redag_rclcpp {
namespace {

using namespace std::chrono_literals;
using rclcpp::CallbackGroupType;
using redag::kNever;
using test_msgs::action::Fibonacci;
using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using EmptyService = test_msgs::srv::Empty;
using Client = rclcpp::Client<EmptyService>::SharedPtr;

// Since Jazzy the quality of service is a rclcpp::QoS. Templates, so that what the distribution lacks is not compiled.
template <class Node>
Client create_client(const std::shared_ptr<Node> &node, const std::string &name,
                     const rclcpp::CallbackGroup::SharedPtr &group) {
  if constexpr (requires { node->template create_client<EmptyService>(name, rclcpp::ServicesQoS(), group); }) {
    return node->template create_client<EmptyService>(name, rclcpp::ServicesQoS(), group);
  } else {
    return node->template create_client<EmptyService>(name, rmw_qos_profile_services_default, group);
  }
}

template <class Node>
rclcpp::Service<EmptyService>::SharedPtr create_service(const std::shared_ptr<Node> &node, const std::string &name,
                                                        const rclcpp::CallbackGroup::SharedPtr &group,
                                                        const std::function<void()> &body) {
  const auto callback = [body](EmptyService::Request::ConstSharedPtr, EmptyService::Response::SharedPtr) { body(); };
  if constexpr (requires { node->template create_client<EmptyService>(name, rclcpp::ServicesQoS(), group); }) {
    return node->template create_service<EmptyService>(name, callback, rclcpp::ServicesQoS(), group);
  } else {
    return node->template create_service<EmptyService>(name, callback, rmw_qos_profile_services_default, group);
  }
}

/// A server of the action "fibonacci" that refuses all goals.
rclcpp_action::Server<Fibonacci>::SharedPtr create_action_server(const rclcpp::Node::SharedPtr &node) {
  return rclcpp_action::create_server<Fibonacci>(
      node, "fibonacci",
      [](const rclcpp_action::GoalUUID &, std::shared_ptr<const Fibonacci::Goal>) {
        return rclcpp_action::GoalResponse::REJECT;
      },
      [](const auto &) { return rclcpp_action::CancelResponse::ACCEPT; }, [](const auto &) {});
}

class DeadlockTest : public ModeTest {
 protected:
  void TearDown() override {
    release = true;
    spinner.reset();
    elsewhere.reset();
    other_executor.reset();
    executor.reset();
    timers.clear();
    services.clear();
    other.reset();
    ModeTest::TearDown();
  }

  /// Makes the executor of `node`, and another one for what is served elsewhere.
  void make_executors(std::uint32_t workers) {
    options.workers = workers;
    executor = std::make_unique<ReDAGExecutor>(rclcpp::ExecutorOptions(), options);
    executor->add_node(node);
    other = std::make_shared<rclcpp::Node>("other");
    other_executor = std::make_unique<rclcpp::executors::SingleThreadedExecutor>();
    other_executor->add_node(other);
  }
  void serve_elsewhere(
      const std::string &name, const std::function<void()> &body = [] {}) {
    services.push_back(create_service(other, name, nullptr, body));
  }
  /// A timer that calls `body` once.
  void once(const std::function<void()> &body, const rclcpp::CallbackGroup::SharedPtr &group = nullptr,
            const rclcpp::Node::SharedPtr &of = nullptr, std::chrono::milliseconds period = 10ms) {
    rclcpp::TimerBase::SharedPtr &timer = timers.emplace_back();
    const auto callback = [&timer, body] {
      timer->cancel();
      body();
    };
    timer = (of ? of : node)->create_wall_timer(period, callback, group);
  }
  /// Waits for a response until the test ends it.
  template <class Future>
  void wait(const Future &future) {
    while (!release && future.wait_for(20ms) != std::future_status::ready) {
    }
  }
  void call_and_wait(const Client &client) {
    wait(client->async_send_request(std::make_shared<EmptyService::Request>()).future);
  }
  void spin() {
    elsewhere = std::make_unique<Spinner<rclcpp::executors::SingleThreadedExecutor>>(*other_executor);
    spinner = std::make_unique<Spinner<ReDAGExecutor>>(*executor);
  }

  /// Waits until `count` deadlocks last.
  std::vector<Deadlock> wait_for_deadlocks(std::size_t count = 1) {
    EXPECT_TRUE(eventually([&] { return executor->deadlocks().size() >= count; }));
    return executor->deadlocks();
  }
  /// Ends the waiting, and with it the deadlocks.
  void expect_end() {
    release = true;
    EXPECT_TRUE(eventually([&] {
      for (const Deadlock &deadlock : executor->deadlocks()) {
        if (deadlock.ended == kNever) return false;
      }
      return true;
    }));
  }
  void expect_deadlock(const std::string &waiting, const std::string &blocked, const std::string &resource) {
    const std::vector<Deadlock> found = wait_for_deadlocks();
    ASSERT_EQ(found.size(), 1U);
    EXPECT_EQ(found[0].waiting, waiting);
    EXPECT_EQ(found[0].blocked, blocked);
    EXPECT_EQ(found[0].resource, resource);
    EXPECT_TRUE(found[0].certain);
    EXPECT_EQ(found[0].ended, kNever);
    EXPECT_THAT(found[0].text, AllOf(HasSubstr(waiting + " waits for a response"), HasSubstr(blocked)));
    expect_end();
    EXPECT_EQ(executor->deadlocks().size(), 1U) << "once for each standstill";
    EXPECT_GT(executor->deadlocks()[0].ended, found[0].begun);
  }

  std::atomic<bool> release{false};
  rclcpp::Node::SharedPtr other;
  std::unique_ptr<rclcpp::executors::SingleThreadedExecutor> other_executor;
  std::unique_ptr<ReDAGExecutor> executor;
  std::vector<rclcpp::ServiceBase::SharedPtr> services;
  std::list<rclcpp::TimerBase::SharedPtr> timers;  // their callbacks keep references
  std::unique_ptr<Spinner<ReDAGExecutor>> spinner;
  std::unique_ptr<Spinner<rclcpp::executors::SingleThreadedExecutor>> elsewhere;
};

// ---- deadlocks ----

TEST_P(DeadlockTest, AClientInTheGroupOfTheCallbackThatWaits) {
  make_executors(2);
  serve_elsewhere("/map");
  const auto client = create_client(node, "/map", nullptr);
  once([&] { call_and_wait(client); });
  ASSERT_TRUE(client->wait_for_service(kLimit));
  spin();
  expect_deadlock("/node timer 10 ms (0)", "/node client /map", "the default callback group of /node");
}

TEST_P(DeadlockTest, AGroupThatIsNotTheDefaultOne) {
  make_executors(2);
  serve_elsewhere("/map");
  const auto group = new_group();
  const auto client = create_client(node, "/map", group);
  once([&] { call_and_wait(client); }, group);
  ASSERT_TRUE(client->wait_for_service(kLimit));
  spin();
  const std::vector<Deadlock> found = wait_for_deadlocks();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_THAT(found[0].resource, AllOf(HasSubstr("callback group g"), HasSubstr(" of /node")));
  expect_end();
}

TEST_P(DeadlockTest, AClientThatGetsNoWorker) {
  make_executors(1);
  serve_elsewhere("/map");
  const auto client = create_client(node, "/map", new_group());
  once([&] { call_and_wait(client); });
  ASSERT_TRUE(client->wait_for_service(kLimit));
  spin();
  expect_deadlock("/node timer 10 ms (0)", "/node client /map", "the only worker");
}

TEST_P(DeadlockTest, AReentrantGroupWithOneWorker) {
  make_executors(1);
  serve_elsewhere("/map");
  const auto group = groups.emplace_back(node->create_callback_group(CallbackGroupType::Reentrant));
  const auto client = create_client(node, "/map", group);
  once([&] { call_and_wait(client); }, group);
  ASSERT_TRUE(client->wait_for_service(kLimit));
  spin();
  expect_deadlock("/node timer 10 ms (0)", "/node client /map", "the only worker");
}

TEST_P(DeadlockTest, SeveralCallbacksThatHaveAllWorkers) {
  make_executors(2);
  serve_elsewhere("/a");
  serve_elsewhere("/b");
  const auto a = create_client(node, "/a", new_group());
  const auto b = create_client(node, "/b", new_group());
  std::atomic<int> waiting{0};
  const auto call = [&](const Client &client) {
    ++waiting;
    while (waiting < 2) std::this_thread::yield();
    call_and_wait(client);
  };
  once([&] { call(a); }, new_group());
  once([&] { call(b); }, new_group());
  ASSERT_TRUE(a->wait_for_service(kLimit));
  ASSERT_TRUE(b->wait_for_service(kLimit));
  spin();
  const std::vector<Deadlock> found = wait_for_deadlocks(2);
  ASSERT_EQ(found.size(), 2U);
  for (const Deadlock &deadlock : found) {
    EXPECT_THAT(deadlock.waiting, HasSubstr("/node timer 10 ms ("));
    EXPECT_THAT(deadlock.blocked, AnyOf("/node client /a", "/node client /b"));
    EXPECT_EQ(deadlock.resource, "any of the 2 workers");
  }
  EXPECT_NE(found[0].waiting, found[1].waiting);
  expect_end();
}

TEST_P(DeadlockTest, AServiceInTheGroupOfItsCaller) {
  make_executors(2);
  services.push_back(create_service(node, "/map", nullptr, [] {}));
  const auto client = create_client(node, "/map", new_group());
  once([&] { call_and_wait(client); });
  ASSERT_TRUE(client->wait_for_service(kLimit));
  spin();
  expect_deadlock("/node timer 10 ms (0)", "/node service /map", "the default callback group of /node");
}

TEST_P(DeadlockTest, AServiceThatGetsNoWorker) {
  make_executors(1);
  services.push_back(create_service(node, "/map", new_group(), [] {}));
  const auto client = create_client(node, "/map", new_group());
  once([&] { call_and_wait(client); });
  ASSERT_TRUE(client->wait_for_service(kLimit));
  spin();
  expect_deadlock("/node timer 10 ms (0)", "/node service /map", "the only worker");
}

TEST_P(DeadlockTest, ServicesThatCallEachOther) {
  make_executors(4);
  const auto group_a = new_group();
  const auto group_b = new_group();
  const auto to_a = create_client(node, "/a", new_group());
  const auto to_b = create_client(node, "/b", new_group());
  services.push_back(create_service(node, "/a", group_a, [] {}));
  services.push_back(create_service(node, "/b", group_b, [] {}));
  std::atomic<int> waiting{0};
  const auto call = [&](const Client &client) {
    ++waiting;
    while (waiting < 2) std::this_thread::yield();
    call_and_wait(client);
  };
  once([&] { call(to_b); }, group_a, node, 10ms);
  once([&] { call(to_a); }, group_b, node, 20ms);
  ASSERT_TRUE(to_a->wait_for_service(kLimit));
  ASSERT_TRUE(to_b->wait_for_service(kLimit));
  spin();
  std::vector<Deadlock> found = wait_for_deadlocks(2);
  ASSERT_EQ(found.size(), 2U);
  if (found[0].waiting > found[1].waiting) std::swap(found[0], found[1]);
  EXPECT_THAT(found[0].waiting, HasSubstr("/node timer 10 ms ("));
  EXPECT_EQ(found[0].blocked, "/node service /b");
  EXPECT_THAT(found[0].text, HasSubstr("while " + found[1].waiting + " holds callback group"));
  EXPECT_THAT(found[1].waiting, HasSubstr("/node timer 20 ms ("));
  EXPECT_EQ(found[1].blocked, "/node service /a");
  expect_end();
}

TEST_P(DeadlockTest, AnActionClientInTheGroupOfTheCallbackThatWaits) {
  make_executors(2);
  const auto server = create_action_server(other);
  const auto client = rclcpp_action::create_client<Fibonacci>(node, "fibonacci");
  once([&] { wait(client->async_send_goal(Fibonacci::Goal())); });
  ASSERT_TRUE(client->wait_for_action_server(kLimit));
  spin();
  const std::vector<Deadlock> found = wait_for_deadlocks();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].waiting, "/node timer 10 ms (0)");
  EXPECT_THAT(found[0].blocked, AllOf(HasSubstr("/node action /fibonacci"),
                                      HasSubstr("(action client of test_msgs::action::Fibonacci)")));
  EXPECT_EQ(found[0].resource, "the default callback group of /node");
  EXPECT_THAT(found[0].text, HasSubstr("SendGoalOptions"));
  expect_end();
}

TEST_P(DeadlockTest, AnActionServerInTheGroupOfItsCaller) {
  make_executors(2);
  const auto server = create_action_server(node);
  const auto client = rclcpp_action::create_client<Fibonacci>(node, "fibonacci", new_group());
  once([&] { wait(client->async_send_goal(Fibonacci::Goal())); });
  ASSERT_TRUE(client->wait_for_action_server(kLimit));
  spin();
  const std::vector<Deadlock> found = wait_for_deadlocks();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_THAT(found[0].blocked, HasSubstr("(action server of test_msgs::action::Fibonacci)"));
  EXPECT_EQ(found[0].resource, "the default callback group of /node");
  expect_end();
}

TEST_P(DeadlockTest, ADagWhosePlacesAreTaken) {
  options.workload = valid(R"(
name: test
dags:
  - name: d
    max_active: 1
    tasks:
      - {name: ask, period: 10ms, callback: {node: /node, timer: 10ms}}
      - {name: answer, period: 10ms, callback: {node: /node, client: /map}}
)");
  make_executors(2);
  serve_elsewhere("/map");
  const auto client = create_client(node, "/map", new_group());
  once([&] { call_and_wait(client); });
  ASSERT_TRUE(client->wait_for_service(kLimit));
  spin();
  expect_deadlock("d.ask", "d.answer", "a place in DAG d (max_active 1)");
}

// ---- no deadlocks ----

// All of these last longer than a deadlock needs to be noticed.
TEST_P(DeadlockTest, OthersAreNotNamed) {
  constexpr auto kLong = 2s;
  make_executors(8);
  serve_elsewhere("/fast");
  const auto slow_node = std::make_shared<rclcpp::Node>("slow");
  const auto slow_service = create_service(slow_node, "/slow", nullptr, [&] { std::this_thread::sleep_for(kLong); });
  rclcpp::executors::SingleThreadedExecutor slow_executor;
  slow_executor.add_node(slow_node);
  // A service of this executor that takes long, and has a group and a worker.
  services.push_back(create_service(node, "/own", new_group(), [&] { std::this_thread::sleep_for(kLong); }));
  std::atomic<int> done{0};
  std::vector<Client> clients;
  const auto client = [&](const std::string &name, const rclcpp::CallbackGroup::SharedPtr &group) {
    return clients.emplace_back(create_client(node, name, group));
  };
  const auto no_wait = [](const Client &fast) { fast->async_send_request(std::make_shared<EmptyService::Request>()); };

  const auto waits = new_group();  // for a slow service, while another response waits for this group
  const auto fast_1 = client("/fast", waits);
  const auto slow = client("/slow", new_group());
  once(
      [&, fast_1, slow] {
        no_wait(fast_1);
        call_and_wait(slow);
        ++done;
      },
      waits);
  // Nodes with one client each: there is nothing else that their callbacks could wait for.
  const auto computer = std::make_shared<rclcpp::Node>("computer");
  const auto sleeper = std::make_shared<rclcpp::Node>("sleeper");
  const auto fast_2 = clients.emplace_back(create_client(computer, "/fast", nullptr));
  const auto fast_3 = clients.emplace_back(create_client(sleeper, "/fast", nullptr));
  once(
      [&, fast_2] {
        no_wait(fast_2);
        use_processor(1s);
        ++done;
      },
      nullptr, computer);
  once(
      [&, fast_3] {
        no_wait(fast_3);
        rclcpp::sleep_for(std::chrono::nanoseconds(kLong));
        ++done;
      },
      nullptr, sleeper);
  executor->add_node(computer);
  executor->add_node(sleeper);
  const auto own = client("/own", new_group());
  once(
      [&, own] {
        call_and_wait(own);
        ++done;
      },
      new_group());
  for (const Client &each : clients) ASSERT_TRUE(each->wait_for_service(kLimit));

  spin();
  Spinner slow_spinner(slow_executor);
  EXPECT_TRUE(eventually([&] { return done == 4; }));
  for (const Deadlock &deadlock : executor->deadlocks()) ADD_FAILURE() << deadlock.text;
}

INSTANTIATE_TEST_SUITE_P(Modes, DeadlockTest,
                         ::testing::Values(redag::PreemptionMode::None, redag::PreemptionMode::Cooperative,
                                           redag::PreemptionMode::Os),
                         [](const auto &mode) { return std::string(to_string(mode.param)); });

// ---- the log ----

std::mutex log_lock;
std::vector<std::string> logged;  // "SEVERITY text"

void keep_log(const rcutils_log_location_t *, int severity, const char *, rcutils_time_point_value_t,
              const char *format, va_list *arguments) {
  va_list copy;
  va_copy(copy, *arguments);
  char text[2048];
  std::vsnprintf(text, sizeof(text), format, copy);
  va_end(copy);
  const std::lock_guard guard(log_lock);
  logged.push_back(std::to_string(severity) + " " + text);
}

std::vector<std::string> logged_with(const std::string &part) {
  const std::lock_guard guard(log_lock);
  std::vector<std::string> lines;
  for (const std::string &line : logged) {
    if (line.find(part) != std::string::npos) lines.push_back(line);
  }
  return lines;
}

class DeadlockLog : public DeadlockTest {};

TEST_P(DeadlockLog, HasOneErrorAndTheEnd) {
  make_executors(2);
  const auto before = rcutils_logging_get_output_handler();
  rcutils_logging_set_output_handler(keep_log);
  serve_elsewhere("/map");
  const auto client = create_client(node, "/map", nullptr);
  once([&] { call_and_wait(client); });
  ASSERT_TRUE(client->wait_for_service(kLimit));
  spin();
  ASSERT_EQ(wait_for_deadlocks().size(), 1U);
  EXPECT_TRUE(eventually([&] { return !logged_with("deadlock: ").empty(); }));
  expect_end();
  EXPECT_TRUE(eventually([&] { return !logged_with("the deadlock of").empty(); }));
  rcutils_logging_set_output_handler(before);
  EXPECT_THAT(logged_with("deadlock: "),
              ElementsAre(HasSubstr(std::to_string(RCUTILS_LOG_SEVERITY_ERROR) +
                                    " deadlock: /node timer 10 ms (0) waits for a response that cannot reach it: the "
                                    "response for /node client /map arrived")));
  EXPECT_THAT(logged_with("the deadlock of"), ElementsAre(HasSubstr("/node timer 10 ms (0) has ended after")));
}

TEST_P(DeadlockLog, IsInTheMetricsOnTheLivePageAndInTheTrace) {
  make_executors(2);
  serve_elsewhere("/map");
  const auto client = create_client(node, "/map", nullptr);
  once([&] { call_and_wait(client); });
  ASSERT_TRUE(client->wait_for_service(kLimit));
  const auto monitoring = std::make_shared<rclcpp::Node>("monitoring");
  executor->add_node(monitoring);
  Monitor monitor(monitoring, *executor);
  spin();
  const std::vector<Deadlock> found = wait_for_deadlocks();
  ASSERT_EQ(found.size(), 1U);
  const auto deadlock = [&] { return nlohmann::json::parse(monitor.metrics()).at("deadlocks").at(0); };
  EXPECT_EQ(deadlock().at("waiting"), found[0].waiting);
  EXPECT_EQ(deadlock().at("blocked"), found[0].blocked);
  EXPECT_EQ(deadlock().at("resource"), found[0].resource);
  EXPECT_EQ(deadlock().at("text"), found[0].text);
  EXPECT_EQ(deadlock().at("certain"), true);
  EXPECT_EQ(deadlock().at("begun_ns"), found[0].begun);
  EXPECT_TRUE(deadlock().at("ended_ns").is_null());
  std::vector<redag::trace::Remark> remarks = executor->as_trace({}).info.remarks;
  ASSERT_EQ(remarks.size(), 1U);
  EXPECT_EQ(remarks[0], (redag::trace::Remark{.begun = found[0].begun, .text = "deadlock: " + found[0].text}));
  const auto alert = [] {
    for (const redag::live::Listed &listed : redag::live::list_pages(redag::live::kFolder)) {
      if (listed.pid == ::getpid() && listed.page) return listed.page->frame.alert;
    }
    return std::string("no page");
  };
  EXPECT_TRUE(eventually([&] {
    return alert() ==
           "deadlock: /node timer 10 ms (0) waits for /node client /map, which cannot get the default callback group "
           "of /node";
  })) << alert();

  expect_end();
  EXPECT_GT(deadlock().at("ended_ns"), found[0].begun);
  remarks = executor->as_trace({}).info.remarks;
  ASSERT_EQ(remarks.size(), 1U);
  EXPECT_EQ(remarks[0].ended, executor->deadlocks()[0].ended);
  EXPECT_TRUE(eventually([&] { return alert().empty(); })) << alert();
  spinner.reset();
  executor->remove_node(monitoring);
}

INSTANTIATE_TEST_SUITE_P(Modes, DeadlockLog, ::testing::Values(redag::PreemptionMode::None),
                         [](const auto &mode) { return std::string(to_string(mode.param)); });

// ---- what threads wait for ----

class Thread {
 public:
  explicit Thread(const std::function<void()> &body)
      : thread_([this, body] {
          id = static_cast<int>(syscall(SYS_gettid));
          body();
        }) {
    eventually([&] { return id != 0; });
  }
  ~Thread() { thread_.join(); }
  Thread(const Thread &) = delete;
  Thread &operator=(const Thread &) = delete;

  std::atomic<int> id{0};

 private:
  std::thread thread_;
};

TEST(ThreadWait, AFutureIsRecognised) {
  std::promise<std::shared_ptr<int>> promise;
  std::shared_future<std::shared_ptr<int>> future = promise.get_future().share();
  Thread forever([&] { future.wait(); });
  Thread limited([&] { (void)future.wait_for(1h); });
  EXPECT_TRUE(eventually([&] { return wait_of_thread(forever.id) == ThreadWait::Future; }));
  EXPECT_TRUE(eventually([&] { return wait_of_thread(limited.id) == ThreadWait::Future; }));
  promise.set_value(nullptr);
}

TEST(ThreadWait, OtherWaitsAreNoFutures) {
  std::atomic<bool> end{false};
  std::mutex mutex;
  std::condition_variable condition;
  Thread on_condition([&] {
    std::unique_lock lock(mutex);
    condition.wait(lock, [&] { return end.load(); });
  });
  redag::runtime::Event event;
  Thread on_event([&] { event.wait(); });
  Thread asleep([&] {
    while (!end) std::this_thread::sleep_for(1s);
  });
  for (const Thread *thread : {&on_condition, &on_event, &asleep}) {
    EXPECT_TRUE(eventually([&] { return wait_of_thread(thread->id) == ThreadWait::Other; }));
  }
  end = true;
  event.set();
  const std::lock_guard lock(mutex);
  condition.notify_all();
}

TEST(ThreadWait, AThreadThatRunsDoesNotWait) {
  std::atomic<bool> end{false};
  Thread busy([&] {
    while (!end) {
    }
  });
  EXPECT_TRUE(eventually([&] { return wait_of_thread(busy.id) == ThreadWait::None; }));
  end = true;
  EXPECT_EQ(wait_of_thread(0x7ffffff0), ThreadWait::Unknown) << "no such thread";
}

}  // namespace
}  // namespace redag_rclcpp
