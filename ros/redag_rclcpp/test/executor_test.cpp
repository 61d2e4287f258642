// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Features of ReDAGExecutor beyond rclcpp's executors: order, bounds, learning, exceptions, figures, traces.
#include "redag_rclcpp/executor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <functional>
#include <future>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "live_page.hpp"
#include "mode_test.hpp"
#include "rclcpp/rclcpp.hpp"
#include "redag/engine/preemption_point.hpp"
#include "redag/live/pages.hpp"
#include "redag/live/reader.hpp"
#include "redag/live/writer.hpp"
#include "redag/loader/validate.hpp"
#include "redag/threads/parker.hpp"
#include "redag_analysis/metrics/check/trace_checker.hpp"
#include "spinning.hpp"
#include "test_msgs/srv/empty.hpp"

namespace redag_rclcpp {
namespace {

using namespace std::chrono_literals;
using std::chrono::steady_clock;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

using ExecutorTest = ModeTest;

constexpr const char *kThreeRates = R"(
name: rates
dags:
  - name: slow
    tasks: [{name: slow, period: 100ms, callback: {node: /node, subscription: /slow}}]
  - name: fast
    tasks: [{name: fast, period: 10ms, callback: {node: /node, subscription: /fast}}]
  - name: middle
    tasks: [{name: middle, period: 50ms, callback: {node: /node, subscription: /middle}}]
)";

TEST_P(ExecutorTest, RunsTheHighestRateFirst) {
  options.workload = valid(kThreeRates);
  ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
  std::vector<std::string> order;
  auto slow = subscribe("/slow", [&] { order.push_back("slow"); });
  auto middle = subscribe("/middle", [&] { order.push_back("middle"); });
  auto fast = subscribe("/fast", [&] { order.push_back("fast"); });
  executor.add_node(node);
  for (const char *topic : {"/slow", "/middle", "/fast"}) publisher(topic)->publish(Empty());
  executor.spin_all(kLimit);
  EXPECT_THAT(order, ElementsAre("fast", "middle", "slow"));
}

// The only worker runs callbacks of one rate. While the first of them runs, a message comes from outside its chain.
class EqualRatesTest : public ModeTest {
 protected:
  void SetUp() override {
    ModeTest::SetUp();
    options.default_period = std::chrono::hours(1);  // also the deadline: data that is older counts as new
  }
  void note(const char *name) {
    const std::lock_guard guard(mutex_);
    order_.emplace_back(name);
  }
  std::vector<std::string> order() {
    const std::lock_guard guard(mutex_);
    return order_;
  }
  static void publish_from_outside(rclcpp::Publisher<Empty> &to) {
    std::thread([&to] { to.publish(Empty()); }).join();
  }

 private:
  std::mutex mutex_;
  std::vector<std::string> order_;
};

TEST_P(EqualRatesTest, TheOldestDataGoesFirst) {
  ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
  auto to_other = publisher("/other");
  auto to_end = publisher("/end");
  auto other = subscribe("/other", [&] { note("other"); });
  auto end = subscribe("/end", [&] { note("end"); });
  auto begin = subscribe("/begin", [&] {
    note("begin");
    publish_from_outside(*to_other);
    to_end->publish(Empty());
  });
  executor.add_node(node);
  Spinner spinner(executor);
  publisher("/begin")->publish(Empty());
  EXPECT_TRUE(eventually([&] { return order().size() == 3; }));
  spinner.stop();
  EXPECT_THAT(order(), ElementsAre("begin", "end", "other"));
}

// Callbacks that publish to each other in a circle leave turns to others.
TEST_P(EqualRatesTest, ACircleIsNotOlderThanItsEquals) {
  ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
  auto to_other = publisher("/other");
  auto to_first = publisher("/first");
  auto to_second = publisher("/second");
  auto other = subscribe("/other", [&] { note("other"); });
  auto second = subscribe("/second", [&] {
    note("second");
    if (order().size() < 20) to_first->publish(Empty());
  });
  bool is_first = true;
  auto first = subscribe("/first", [&] {
    note("first");
    if (std::exchange(is_first, false)) publish_from_outside(*to_other);
    to_second->publish(Empty());
  });
  executor.add_node(node);
  Spinner spinner(executor);
  to_first->publish(Empty());
  EXPECT_TRUE(eventually([&] { return order().size() >= 20; }));
  spinner.stop();
  ASSERT_GE(order().size(), 3U);
  EXPECT_EQ(order()[2], "other");
}

TEST_P(ExecutorTest, WorkersTakeTheHighestRateFirst) {
  options.workload = valid(kThreeRates);
  ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
  std::mutex mutex;
  std::vector<std::string> order;
  const auto add = [&](const char *name) {
    const std::lock_guard guard(mutex);
    order.emplace_back(name);
  };
  auto to_fast = publisher("/fast");
  auto to_middle = publisher("/middle");
  auto to_slow = publisher("/slow");
  // The job of the highest rate releases all others while it holds the only worker.
  std::atomic<bool> first{true};
  auto slow = subscribe("/slow", [&] { add("slow"); });
  auto middle = subscribe("/middle", [&] { add("middle"); });
  auto fast = subscribe("/fast", [&] {
    add("fast");
    if (!first.exchange(false)) return;
    to_slow->publish(Empty());
    to_middle->publish(Empty());
    to_fast->publish(Empty());
  });
  executor.add_node(node);
  Spinner spinner(executor);
  to_fast->publish(Empty());
  EXPECT_TRUE(eventually([&] {
    const std::lock_guard guard(mutex);
    return order.size() == 4;
  }));
  spinner.stop();
  EXPECT_THAT(order, ElementsAre("fast", "fast", "middle", "slow"));
}

TEST_P(ExecutorTest, MaxActiveBoundsADag) {
  options.workers = 3;
  options.workload = valid(R"(
name: bounded
dags:
  - name: perception
    max_active: 1
    tasks:
      - {name: a, period: 10ms, callback: {node: /node, subscription: /a}}
      - {name: b, period: 10ms, callback: {node: /node, subscription: /b}}
      - {name: c, period: 10ms, callback: {node: /node, subscription: /c}}
)");
  ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
  std::atomic<int> inside{0};
  std::atomic<int> most{0};
  std::atomic<int> count{0};
  const auto body = [&] {
    const int now = ++inside;
    if (now > most) most = now;
    std::this_thread::sleep_for(2ms);
    --inside;
    ++count;
  };
  auto a = subscribe("/a", body);
  auto b = subscribe("/b", body);
  auto c = subscribe("/c", body);
  executor.add_node(node);
  Spinner spinner(executor);
  for (int i = 0; i < 5; ++i) {
    for (const char *topic : {"/a", "/b", "/c"}) publisher(topic)->publish(Empty());
  }
  EXPECT_TRUE(eventually([&] { return count == 15; }));
  spinner.stop();
  EXPECT_EQ(most, 1);
}

TEST_P(ExecutorTest, IsSeenLive) {
  options.workload = valid(R"(
name: seen
dags:
  - name: control
    max_active: 3
    tasks: [{name: tick, period: 10ms, deadline: 8ms, callback: {node: /node, timer: 10ms}}]
)");
  const std::string path = redag::live::page_path(redag::live::kFolder, ::getpid(), 0);
  {
    ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
    LivePage page(executor);
    page.set_bounds({{"control.tick", 3 * redag::kMillisecond}});
    auto timer = node->create_wall_timer(10ms, [] {});
    auto never = node->create_wall_timer(std::chrono::hours(24 * 365 * 150), [] {});  // more than a page can hold
    executor.add_node(node);
    Spinner spinner(executor);
    std::optional<redag::live::Frame> frame;
    EXPECT_TRUE(eventually([&] {
      const auto read = redag::live::read_page(path);
      if (!read || read->frame.tasks.empty() || read->frame.tasks[0].figures.finished == 0) return false;
      frame = read->frame;
      return true;
    }));
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->name, "seen");
    EXPECT_EQ(frame->driver, "ros");
    EXPECT_EQ(frame->dags[0].max_active, 3U);
    EXPECT_EQ(frame->tasks[0].name, "tick");
    EXPECT_EQ(frame->tasks[0].deadline, 8 * redag::kMillisecond);
    EXPECT_EQ(frame->tasks[0].bound, 3 * redag::kMillisecond);
    EXPECT_GT(frame->tasks[0].figures.response_max, 0);
  }
  EXPECT_FALSE(redag::live::read_page(path));
}

TEST_P(ExecutorTest, CancelBeforeTheFirstSpinIsNotLost) {
  ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
  executor.add_node(node);
  executor.cancel();
  executor.spin();  // returns
  std::atomic<int> count{0};
  auto timer = node->create_wall_timer(1ms, [&] {
    if (++count == 3) executor.cancel();
  });
  executor.spin();
  EXPECT_GE(count, 3);
}

// As with rclcpp's executors: what a callback closes after these calls, no other callback uses.
TEST_P(ExecutorTest, NoCallbackStartsAfterOneHasCancelledOrShutDown) {
  for (const bool shuts_down : {false, true}) {
    SCOPED_TRACE(shuts_down);
    ReDAGExecutor executor(options);
    auto out = publisher("/x");
    std::atomic<int> calls{0};
    auto subscription = subscribe("/x", [&] {
      ++calls;
      shuts_down ? static_cast<void>(rclcpp::shutdown()) : executor.cancel();
      std::this_thread::sleep_for(5ms);  // time for others to begin
    });
    executor.add_node(node);
    for (int i = 0; i < 10; ++i) out->publish(Empty());
    executor.spin();
    EXPECT_EQ(calls, 1);
    executor.remove_node(node);
  }
}

// The thread that cancels gets its processor back only once the next spin() is idle.
TEST_P(ExecutorTest, ASlowCancelEndsNoLaterSpin) {
  cpu_set_t one;
  CPU_ZERO(&one);
  CPU_SET(sched_getcpu(), &one);
  std::atomic<int> ticks{0};
  std::thread canceller([&] {  // threads inherit their processors
    ASSERT_EQ(sched_setaffinity(0, sizeof one, &one), 0);
    ReDAGExecutor executor(options);
    const auto timer = node->create_wall_timer(1ms, [&] { ++ticks; });
    executor.add_node(node);
    std::atomic<bool> done{false};
    const auto spins = std::async(std::launch::async, [&] {
      while (!done) executor.spin();
    });
    const sched_param none{};
    ASSERT_EQ(sched_setscheduler(0, SCHED_IDLE, &none), 0);
    for (int i = 0; i < 10 && !HasFailure(); ++i) {
      const int before = ticks;
      EXPECT_TRUE(eventually([&] { return ticks > before; }));
      executor.cancel();
    }
    done = true;
    do executor.cancel();  // a call between two spins is lost
    while (spins.wait_for(10ms) != std::future_status::ready);
  });
  canceller.join();
}

TEST_P(ExecutorTest, ANodeRemovedWhileSpinningCanJoinAnyOtherExecutor) {
  auto timer = node->create_wall_timer(1ms, [] {});
  ReDAGExecutor executor(options);
  executor.add_node(node);
  const Spinner spinner(executor);
  executor.remove_node(node);
  ReDAGExecutor second(options);
  second.add_node(node);
  second.remove_node(node);
  rclcpp::executors::SingleThreadedExecutor third;
  third.add_node(node);
  third.spin_some();
  third.remove_node(node);
}

TEST_P(ExecutorTest, AGroupThatMovesBetweenExecutorsIsServed) {
  auto group = node->create_callback_group(rclcpp::CallbackGroupType::MutuallyExclusive, false);
  ReDAGExecutor a(options);
  for (int round = 0; round < 2; ++round) {
    a.add_callback_group(group, node->get_node_base_interface());
    a.remove_callback_group(group);
    ReDAGExecutor b(options);
    b.add_callback_group(group, node->get_node_base_interface());
    b.remove_callback_group(group);
  }
  a.add_callback_group(group, node->get_node_base_interface());
  const Spinner spinner(a);
  std::atomic<int> calls{0};
  auto timer = node->create_wall_timer(
      1ms, [&] { ++calls; }, group);
  EXPECT_TRUE(eventually([&] { return calls >= 3; })) << "an entity that was created later";
}

// The first spin also collects the entities, which can take longer than a short limit.
TEST_P(ExecutorTest, AShortSpinSomeRunsWhatIsReady) {
  ReDAGExecutor executor(options);
  int calls = 0;
  const rclcpp::TimerBase::SharedPtr timer = node->create_wall_timer(1ms, [&] { ++calls; });
  executor.add_node(node);
  std::this_thread::sleep_for(2ms);  // the timer's first call is due
  executor.spin_some(1ns);
  EXPECT_EQ(calls, 1);
}

TEST_P(ExecutorTest, SpinThrowsACallbacksException) {
  ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
  auto timer = node->create_wall_timer(1ms, [] { throw std::domain_error("from a callback"); });
  executor.add_node(node);
  EXPECT_THROW(executor.spin(), std::domain_error);
  EXPECT_THROW(while (true) executor.spin_once(1s), std::domain_error);
  EXPECT_FALSE(executor.is_spinning());
}

TEST_P(ExecutorTest, AHandlerCanContinueAfterAnException) {
  std::atomic<int> handled{0};
  std::string task;
  options.on_exception = [&](const ExceptionInfo &info) {
    if (handled == 0) task = info.task;
    ++handled;
    return OnException::Continue;
  };
  ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
  auto timer = node->create_wall_timer(1ms, [] { throw std::domain_error("from a callback"); });
  executor.add_node(node);
  Spinner spinner(executor);
  EXPECT_TRUE(eventually([&] { return handled >= 3; }));
  spinner.stop();
  EXPECT_THAT(task, HasSubstr("/node timer 1"));
  EXPECT_GE(executor.stats().at(0).jobs.aborted, 3U);
}

// Also after cancel(), which clears rclcpp's own flag long before spin() returns. The cancel() must still take effect.
TEST_P(ExecutorTest, SpinningInACallbackIsRefused) {
  ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
  std::atomic<int> calls{0};
  std::atomic<int> refused{0};
  std::promise<void> promise;
  const std::shared_future<void> future = promise.get_future().share();
  const auto try_all = [&] {
    const std::vector<std::function<void()>> functions = {
        [&] { executor.spin(); }, [&] { executor.spin_some(); }, [&] { executor.spin_all(1ms); },
        [&] { executor.spin_once(1ms); }, [&] { executor.spin_until_future_complete(future, 1ms); }};
    for (const std::function<void()> &spin : functions) {
      try {
        spin();
      } catch (const std::runtime_error &) {
        ++refused;
      }
    }
  };
  auto timer = node->create_wall_timer(1ms, [&] {
    ++calls;
    try_all();
    executor.cancel();
    try_all();
  });
  executor.add_node(node);
  executor.spin();
  EXPECT_EQ(refused, 10 * calls);
}

TEST_P(ExecutorTest, APeriodOfNothingIsRefused) {
  options.default_period = 0ns;
  EXPECT_THROW(ReDAGExecutor(rclcpp::ExecutorOptions(), options), std::invalid_argument);
}

TEST_P(ExecutorTest, MissedPeriodsOfATimerAreCounted) {
  ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
  std::atomic<int> count{0};
  auto timer = node->create_wall_timer(10ms, [&] {
    if (++count == 3) std::this_thread::sleep_for(105ms);
    if (count == 6) executor.cancel();
  });
  executor.add_node(node);
  executor.spin();
  CallbackStats stats;
  for (const CallbackStats &s : executor.stats()) {
    if (s.id.kind == redag::Callback::Kind::Timer) stats = s;
  }
  EXPECT_EQ(stats.period, 10'000'000);
  EXPECT_EQ(stats.jobs.released,
            stats.jobs.finished + stats.jobs.skipped + stats.jobs.aborted + stats.jobs.in_flight());
  // The long run spans at least ten points of the grid. The last point's job ran, perhaps late.
  EXPECT_GE(stats.jobs.skipped, 8U);
  EXPECT_GE(stats.misses, 9U);
}

TEST_P(ExecutorTest, WhatOneExecutorLeavesTheNextOneTakes) {
  for (const bool intra_process : {false, true}) {
    SCOPED_TRACE(intra_process);
    auto other = std::make_shared<rclcpp::Node>("other", rclcpp::NodeOptions().use_intra_process_comms(intra_process));
    int count = 0;
    auto subscription =
        other->create_subscription<Empty>("/x", rclcpp::QoS(10), [&](Empty::ConstSharedPtr) { ++count; });
    auto to_x = other->create_publisher<Empty>("/x", rclcpp::QoS(10));
    ASSERT_TRUE(eventually([&] { return intra_process || to_x->get_subscription_count() > 0; }));
    {
      ReDAGExecutor first(rclcpp::ExecutorOptions(), options);
      first.add_node(other);
      for (int i = 0; i < 3; ++i) to_x->publish(Empty());
      std::this_thread::sleep_for(20ms);
    }
    ReDAGExecutor second(rclcpp::ExecutorOptions(), options);
    second.add_node(other);
    to_x->publish(Empty());
    std::this_thread::sleep_for(20ms);
    second.spin_all(kLimit);
    EXPECT_EQ(count, 4);
  }
}

// The subscription's handle outlives it and still gets messages. AddressSanitizer would report a call into the
// destroyed part.
TEST_P(ExecutorTest, AMessageForADestroyedSubscriptionIsNoCallOfWhatIsGone) {
  ReDAGExecutor executor(options);
  auto ours = std::make_shared<rclcpp::Node>("through_the_middleware");
  auto subscription = ours->create_subscription<Empty>("/gone", rclcpp::QoS(10), [](Empty::ConstSharedPtr) {});
  auto publisher = ours->create_publisher<Empty>("/gone", rclcpp::QoS(10));
  executor.add_node(ours);
  publisher->publish(Empty());
  executor.spin_all(100ms);

  const auto handle = subscription->get_subscription_handle();
  subscription.reset();
  for (int round = 0; round < 2; ++round) {
    publisher->publish(Empty());  // the hook is still set
    executor.spin_all(100ms);
    ours->create_wall_timer(1h, [] {});  // makes the executor notice the destroyed subscription before the second round
  }
  const auto stats = executor.stats();
  EXPECT_TRUE(std::none_of(stats.begin(), stats.end(), [](const auto &s) { return s.id.name == "/gone"; }));
}

// Callbacks of a node use the object that has the node as base or member.
TEST_P(ExecutorTest, ARetiredNodeIsDestroyedWhenItsCallbacksHaveEnded) {
  std::atomic<bool> started{false};
  redag::runtime::Event end;
  std::atomic<int> destroyed{0};
  const auto make_node = [&](const char *name) {
    auto *const made = new rclcpp::Node(name, rclcpp::NodeOptions().start_parameter_event_publisher(false));
    return std::shared_ptr<rclcpp::Node>(made, [&](rclcpp::Node *gone) {
      delete gone;
      ++destroyed;
    });
  };
  auto idle = make_node("idle");
  auto busy = make_node("busy");
  const auto unused = idle->create_wall_timer(1h, [] {});
  const auto timer = busy->create_wall_timer(1ms, [&] {
    started = true;
    end.wait();
  });
  ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
  executor.add_node(idle);
  executor.add_node(busy);
  const Spinner spinner(executor);
  ASSERT_TRUE(eventually([&] { return started.load(); }));
  const auto retire = [&](std::shared_ptr<rclcpp::Node> &retired) {
    const auto base = retired->get_node_base_interface();
    executor.retire_node(base, std::move(retired));
  };
  retire(idle);
  EXPECT_EQ(destroyed, 1);
  retire(busy);
  EXPECT_EQ(destroyed, 1) << "its callback is in progress";
  end.set();
  EXPECT_TRUE(eventually([&] { return destroyed == 2; }));
}

TEST_P(ExecutorTest, WhatIsCreatedInAnEmptyGroupIsServed) {
  ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
  auto group = node->create_callback_group(rclcpp::CallbackGroupType::MutuallyExclusive, false);
  executor.add_callback_group(group, node->get_node_base_interface());
  std::atomic<int> count{0};
  auto timer = node->create_wall_timer(
      1ms,
      [&] {
        if (++count == 3) executor.cancel();
      },
      group);
  executor.spin();
  EXPECT_GE(count, 3);
}

TEST_P(ExecutorTest, LearnsRatesAndEdges) {
  options.learn = 400ms;
  ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
  auto out = publisher("/b");
  auto b_out = publisher("/c");
  auto source = node->create_wall_timer(
      20ms, [&] { out->publish(Empty()); }, new_group());
  auto b = subscribe("/b", [&] { b_out->publish(Empty()); });
  auto c = subscribe("/c", [] {});
  executor.add_node(node);
  Spinner spinner(executor);
  EXPECT_TRUE(eventually([&] { return !executor.is_spinning() || executor.learning_done(); }));
  ASSERT_TRUE(eventually([&] {
    for (const CallbackStats &stats : executor.stats()) {
      if (stats.id.name == "/c") return stats.period == 20'000'000;
    }
    return false;
  }));
  spinner.stop();
  const redag::Workload learned = executor.learned();
  EXPECT_FALSE(has_errors(redag::validate(learned, redag::ValidateOptions{.wcet_optional = true})))
      << to_string(redag::validate(learned));
  const redag::Dag &dag = learned.dags.at(0);
  const auto position = [&](const std::string &text) {
    for (std::uint32_t i = 0; i < dag.tasks.size(); ++i) {
      if (dag.tasks[i].name.find(text) != std::string::npos) return i;
    }
    ADD_FAILURE() << "no task " << text;
    return 0U;
  };
  EXPECT_THAT(dag.tasks[position("/b")].predecessors, ElementsAre(position("timer")));
  EXPECT_THAT(dag.tasks[position("/c")].predecessors, ElementsAre(position("/b")));
  EXPECT_EQ(dag.tasks[position("/c")].activation, redag::Activation::Data);
  EXPECT_GT(dag.tasks[position("/c")].wcet, 0);
  // The learned workload can be given to the next run, and names the same callbacks.
  options.workload = redag::validated(learned).value();
  options.learn = 0ms;
  ReDAGExecutor again(rclcpp::ExecutorOptions(), options);
  executor.remove_node(node);
  again.add_node(node);
  EXPECT_THAT(again.warnings(), ::testing::Not(::testing::Contains(HasSubstr("no callback matches"))));
}

// A node that is loaded later has its rates at once as well, and a timer the period that the program gives it.
TEST_P(ExecutorTest, LearnsFromTheThirdMessageOnWheneverItComes) {
  options.learn = 1h;
  ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
  auto timer = node->create_wall_timer(
      200ms, [] {}, new_group());
  executor.add_node(node);
  const Spinner spinner(executor);
  const auto period_of = [&](const std::string &name, redag::Callback::Kind kind) {
    for (const CallbackStats &stats : executor.stats()) {
      if (stats.id.kind == kind && stats.id.name.find(name) != std::string::npos) return stats.period;
    }
    return redag::Duration{0};
  };
  auto out = publisher("/late");
  auto subscription = subscribe("/late", [] {});
  ASSERT_TRUE(eventually([&] { return out->get_subscription_count() == 1; }));
  const auto is_learned = [&] {
    const redag::Duration period = period_of("/late", redag::Callback::Kind::Subscription);
    return period > 0 && period != options.default_period.count();
  };
  EXPECT_TRUE(eventually(is_learned, [&] {
    out->publish(Empty());
    std::this_thread::sleep_for(5ms);
  }));
  EXPECT_FALSE(executor.learning_done());
  std::int64_t before = 0;
  ASSERT_EQ(rcl_timer_exchange_period(timer->get_timer_handle().get(), 10'000'000, &before), RCL_RET_OK);
  EXPECT_TRUE(eventually([&] { return period_of("", redag::Callback::Kind::Timer) == 10'000'000; }));
}

// Requests come in bursts, which would make a long service more urgent than a control loop.
TEST_P(ExecutorTest, ABurstOfRequestsIsNoRate) {
  options.learn = 1h;
  ReDAGExecutor executor(options);
  std::atomic<int> served{0};
  auto service = node->create_service<test_msgs::srv::Empty>(
      "/plan",
      [&](test_msgs::srv::Empty::Request::ConstSharedPtr, test_msgs::srv::Empty::Response::SharedPtr) { ++served; });
  auto client = node->create_client<test_msgs::srv::Empty>("/plan");
  executor.add_node(node);
  const Spinner spinner(executor);
  ASSERT_TRUE(client->wait_for_service(kLimit));
  for (int i = 0; i < 6; ++i) client->async_send_request(std::make_shared<test_msgs::srv::Empty::Request>());
  ASSERT_TRUE(eventually([&] { return served == 6; }));
  std::this_thread::sleep_for(20ms);
  for (const CallbackStats &stats : executor.stats()) {
    if (stats.id.kind == redag::Callback::Kind::Service) EXPECT_EQ(stats.period, options.default_period.count());
  }
}

// If another process subscribes as well (a recorder, rviz), the middleware brings every message a second time. rclcpp
// ignores the copy, and learning must not count it.
// As on /tf: a slow timer of the executor and a fast program outside publish to one topic.
TEST_P(ExecutorTest, ATopicToWhichOthersPublishFollowsNoTimer) {
  options.learn = 500ms;
  ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
  const auto out = publisher("/both");
  const auto timer = node->create_wall_timer(
      100ms, [&] { out->publish(Empty()); }, new_group());
  const auto subscription = subscribe("/both", [] {});
  executor.add_node(node);
  const Spinner spinner(executor);
  const auto publish = [&] {
    out->publish(Empty());  // in no job of the executor
    std::this_thread::sleep_for(2ms);
  };
  ASSERT_TRUE(eventually([&] { return executor.learning_done(); }, publish));
  EXPECT_TRUE(eventually([&] {
    const std::vector<CallbackStats> all = executor.stats();
    return std::any_of(all.begin(), all.end(), [](const CallbackStats &stats) {
      return stats.id.name == "/both" && stats.period < 50'000'000;
    });
  }));
  for (const redag::Dag &dag : executor.learned().dags) {
    for (const redag::Task &task : dag.tasks) {
      if (task.name.find("both") == std::string::npos) continue;
      EXPECT_THAT(task.predecessors, ::testing::IsEmpty());
    }
  }
}

TEST_P(ExecutorTest, LearnsARateOnceWhereOthersSubscribeToo) {
  options.learn = 1s;
  ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
  std::atomic<int> called{0};
  auto subscription = subscribe("/image", [&] { ++called; });
  auto out = publisher("/image");
  auto recorder = std::make_shared<rclcpp::Node>("recorder");
  auto recorded = recorder->create_subscription<Empty>("/image", rclcpp::QoS(10), [](Empty::ConstSharedPtr) {});
  executor.add_node(node);
  ASSERT_TRUE(eventually([&] { return out->get_subscription_count() == 2; })) << "the window begins with spin()";
  const Spinner spinner(executor);
  // Publishes for as long as it learns, however slow the machine is.
  int sent = 0;
  ASSERT_TRUE(eventually([&] { return executor.learning_done(); },
                         [&] {
                           out->publish(Empty());
                           ++sent;
                           std::this_thread::sleep_for(20ms);
                           EXPECT_TRUE(eventually([&] { return called == sent; }));
                         }));
  CallbackStats image;
  const auto is_learned = [&] {
    for (const CallbackStats &stats : executor.stats()) {
      if (stats.id.name == "/image") image = stats;
    }
    return image.jobs.finished == static_cast<std::uint64_t>(sent) && image.period != options.default_period.count();
  };
  EXPECT_TRUE(eventually(is_learned)) << "finished " << image.jobs.finished << " of " << sent;
  EXPECT_EQ(called, sent);
  // No two messages are closer than 20 ms. The last copies may not have been taken when learning ends.
  EXPECT_GE(image.period, 15'000'000);
}

TEST_P(ExecutorTest, ItsTraceHoldsToTheModel) {
  options.workers = 2;
  options.trace_capacity = 1 << 16;
  options.workload = valid(R"(
name: traced
dags:
  - name: chain
    max_active: 2
    tasks:
      - {name: source, callback: {node: /node, timer: 2ms}}
      - {name: sink, after: [source], activation: data, callback: {node: /node, subscription: /sink}}
  - name: load
    tasks:
      - {name: load, callback: {node: /node, timer: 15ms}}
)");
  ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
  auto to_sink = publisher("/sink");
  const auto burn = [](std::chrono::microseconds time) {
    const auto end = steady_clock::now() + time;
    while (steady_clock::now() < end) redag::preemption_point();
  };
  auto source = node->create_wall_timer(
      2ms,
      [&] {
        burn(200us);
        to_sink->publish(Empty());
      },
      new_group());
  auto sink = subscribe("/sink", [&] { burn(300us); });
  auto load = node->create_wall_timer(
      15ms, [&] { burn(6ms); }, new_group());
  executor.add_node(node);
  std::vector<redag::JobEvent> events;
  Spinner spinner(executor);
  std::this_thread::sleep_for(500ms);
  spinner.stop();
  executor.drain_trace(events);
  const redag::trace::Trace trace = executor.as_trace(std::move(events));
  EXPECT_EQ(trace.info.lost_events, 0U);
  EXPECT_GT(trace.events.size(), 1000U);
  EXPECT_FALSE(has_errors(redag::validate(trace.info.workload))) << to_string(redag::validate(trace.info.workload));
  const auto report = redag::metrics::check_trace(trace, redag::metrics::rules_for(trace.info));
  EXPECT_TRUE(report.ok()) << report.to_string();
}

INSTANTIATE_TEST_SUITE_P(Modes, EqualRatesTest,
                         ::testing::Values(redag::PreemptionMode::None, redag::PreemptionMode::Cooperative,
                                           redag::PreemptionMode::Os),
                         [](const auto &mode) { return std::string(to_string(mode.param)); });
INSTANTIATE_TEST_SUITE_P(Modes, ExecutorTest,
                         ::testing::Values(redag::PreemptionMode::None, redag::PreemptionMode::Cooperative,
                                           redag::PreemptionMode::Os),
                         [](const auto &mode) { return std::string(to_string(mode.param)); });

}  // namespace
}  // namespace redag_rclcpp
