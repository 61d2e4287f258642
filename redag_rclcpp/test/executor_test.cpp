// What our executor does beyond rclcpp's: order, bounds, learning, exceptions, figures, traces.
#include "redag_rclcpp/executor.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <functional>
#include <future>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "executor_types.hpp"
#include "rclcpp/rclcpp.hpp"
#include "redag/live/reader.hpp"
#include "redag/live/writer.hpp"
#include "redag/metrics/trace_checker.hpp"
#include "redag/model/validate.hpp"
#include "redag/model/workload_yaml.hpp"
#include "redag/runtime/clock.hpp"
#include "redag/runtime/preemption_point.hpp"
#include "spinning.hpp"
#include "test_msgs/msg/basic_types.hpp"
#include "test_msgs/msg/empty.hpp"
#include "test_msgs/srv/empty.hpp"

namespace redag_rclcpp {
namespace {

using namespace std::chrono_literals;
using std::chrono::steady_clock;
using test_msgs::msg::BasicTypes;
using test_msgs::msg::Empty;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class ExecutorTest : public ::testing::TestWithParam<redag::PreemptionMode> {
 protected:
  void SetUp() override {
    if (GetParam() == redag::PreemptionMode::Os && redag::runtime::probe_priority_band().top_job == 0) {
      GTEST_SKIP() << "SCHED_FIFO is not to be had here";
    }
    rclcpp::init(0, nullptr);
    node = std::make_shared<rclcpp::Node>("node", rclcpp::NodeOptions().use_intra_process_comms(true));
    options.preemption = GetParam();
    options.workers = 1;
  }
  void TearDown() override {
    node.reset();
    if (rclcpp::ok()) rclcpp::shutdown();
  }

  rclcpp::CallbackGroup::SharedPtr new_group() {
    return groups.emplace_back(node->create_callback_group(rclcpp::CallbackGroupType::MutuallyExclusive));
  }
  rclcpp::Subscription<Empty>::SharedPtr subscribe(const std::string &topic, std::function<void()> body) {
    rclcpp::SubscriptionOptions subscription;
    subscription.callback_group = new_group();
    return node->create_subscription<Empty>(
        topic, rclcpp::QoS(10), [body](Empty::ConstSharedPtr) { body(); }, subscription);
  }
  rclcpp::Publisher<Empty>::SharedPtr publisher(const std::string &topic) {
    return node->create_publisher<Empty>(topic, rclcpp::QoS(10));
  }
  redag::Workload parse(const std::string &text) {
    auto workload = redag::parse_workload(text, "test.yaml", redag::LoadOptions{.wcet_optional = true});
    EXPECT_TRUE(workload) << to_string(workload.error());
    return workload->workload;
  }

  rclcpp::Node::SharedPtr node;
  std::vector<rclcpp::CallbackGroup::SharedPtr> groups;
  ReDAGOptions options;
};

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
  options.workload = parse(kThreeRates);
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

TEST_P(ExecutorTest, WorkersTakeTheHighestRateFirst) {
  options.workload = parse(kThreeRates);
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
  options.workload = parse(R"(
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
  options.live = true;
  options.workload = parse(R"(
name: seen
dags:
  - name: control
    max_active: 3
    tasks: [{name: tick, period: 10ms, deadline: 8ms, callback: {node: /node, timer: 10ms}}]
)");
  const std::string path = redag::live::page_path(redag::live::kFolder, ::getpid(), 0);
  {
    ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
    executor.set_live_bounds({{"control.tick", 3 * redag::kMillisecond}});
    auto timer = node->create_wall_timer(10ms, [] {});
    executor.add_node(node);
    Spinner spinner(executor);
    std::optional<redag::live::Frame> frame;
    EXPECT_TRUE(eventually([&] {
      const auto page = redag::live::read_page(path);
      if (!page || page->frame.tasks.empty() || page->frame.tasks[0].figures.finished == 0) return false;
      frame = page->frame;
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
  options.live = false;
  const ReDAGExecutor hidden(rclcpp::ExecutorOptions(), options);
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

// Also after cancel(), which clears rclcpp's own flag long before spin() returns; and the cancel() still counts.
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
  // The long run spans ten points of the grid at least; the last of them ran, late or not.
  EXPECT_GE(stats.jobs.skipped, 8U);
  EXPECT_GE(stats.misses, 9U);
}

TEST_P(ExecutorTest, OverwrittenMessagesAreCounted) {
  ReDAGExecutor executor(rclcpp::ExecutorOptions(), options);
  std::atomic<int> count{0};
  rclcpp::SubscriptionOptions subscription_options;
  auto subscription = node->create_subscription<Empty>("/x", rclcpp::QoS(3), [&](Empty::ConstSharedPtr) { ++count; });
  executor.add_node(node);
  auto to_x = node->create_publisher<Empty>("/x", rclcpp::QoS(3));
  for (int i = 0; i < 10; ++i) to_x->publish(Empty());
  executor.spin_all(kLimit);
  EXPECT_EQ(count, 3);
  CallbackStats stats;
  for (const CallbackStats &s : executor.stats()) {
    if (s.id.name == "/x") stats = s;
  }
  EXPECT_EQ(stats.jobs.released, 10U);
  EXPECT_EQ(stats.jobs.finished, 3U);
  EXPECT_EQ(stats.jobs.skipped, 7U);
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

// What is left of it, here the handle, still gets messages. (What the test is about AddressSanitizer sees.)
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
    ours->create_wall_timer(1h, [] {});  // second round: what is gone was noticed
  }
  const auto stats = executor.stats();
  EXPECT_TRUE(std::none_of(stats.begin(), stats.end(), [](const auto &s) { return s.id.name == "/gone"; }));
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
  // What was learned can be given to the next run, and names the same callbacks.
  options.workload = learned;
  options.learn = 0ms;
  ReDAGExecutor again(rclcpp::ExecutorOptions(), options);
  executor.remove_node(node);
  again.add_node(node);
  EXPECT_THAT(again.warnings(), ::testing::Not(::testing::Contains(HasSubstr("no callback matches"))));
}

// ---- budgets and criticality ----

void use_processor(redag::Duration duration) {
  const redag::Time end = redag::runtime::thread_cpu_now() + duration;
  while (redag::runtime::thread_cpu_now() < end) {
  }
}

/// A subscription of numbered messages, in a group of its own.
struct Numbers {
  Numbers(const rclcpp::Node::SharedPtr &node, const std::string &topic, bool in_process,
          redag::Duration execution = 0) {
    rclcpp::SubscriptionOptions options;
    rclcpp::PublisherOptions publishing;
    options.callback_group = group = node->create_callback_group(rclcpp::CallbackGroupType::MutuallyExclusive);
    options.use_intra_process_comm = publishing.use_intra_process_comm =
        in_process ? rclcpp::IntraProcessSetting::Enable : rclcpp::IntraProcessSetting::Disable;
    subscription = node->create_subscription<BasicTypes>(
        topic, rclcpp::QoS(10),
        [this, execution](BasicTypes::ConstSharedPtr message) {
          received.push_back(message->int32_value);
          use_processor(execution);
        },
        options);
    publisher = node->create_publisher<BasicTypes>(topic, rclcpp::QoS(10), publishing);
  }
  void publish(int number) {
    auto message = std::make_unique<BasicTypes>();
    message->int32_value = number;
    publisher->publish(std::move(message));
  }

  std::vector<int> received;
  rclcpp::CallbackGroup::SharedPtr group;
  rclcpp::Subscription<BasicTypes>::SharedPtr subscription;
  rclcpp::Publisher<BasicTypes>::SharedPtr publisher;
};

redag::sched::Accounting jobs_of(const ReDAGExecutor &executor, const std::string &task) {
  for (const CallbackStats &stats : executor.stats()) {
    if (stats.task == task) return stats.jobs;
  }
  ADD_FAILURE() << "no task " << task;
  return {};
}

TEST_P(ExecutorTest, AfterASkippedReleaseTheNextMessageIsTaken) {
  options.workload = parse(R"(
name: budgets
dags:
  - name: d
    tasks:
      - {name: a, period: 10ms, wcet: 1ms, budget: 1ms, on_budget: skip_next,
         callback: {node: /node, subscription: /numbers}}
)");
  for (const bool in_process : {true, false}) {
    SCOPED_TRACE(in_process);
    ReDAGExecutor executor(options);
    Numbers numbers(node, "/numbers", in_process, 2 * redag::kMillisecond);
    executor.add_node(node);
    for (int i = 1; i <= 5; ++i) {
      numbers.publish(i);
      executor.spin_some();
    }
    EXPECT_THAT(numbers.received, ElementsAre(1, 3, 5));
    EXPECT_EQ(jobs_of(executor, "d.a").skipped, 2u);
    executor.remove_node(node);
  }
}

TEST_P(ExecutorTest, AMessageBeyondMaxPendingIsDroppedAndTheNextOneTaken) {
  options.workload = parse(R"(
name: admission
dags:
  - name: d
    max_pending: 1
    tasks:
      - {name: a, period: 10ms, callback: {node: /node, subscription: /a}}
      - {name: b, period: 20ms, callback: {node: /node, subscription: /b}}
)");
  ReDAGExecutor executor(options);
  Numbers a(node, "/a", true);
  Numbers b(node, "/b", true);
  executor.add_node(node);
  a.publish(1);
  b.publish(1);
  executor.spin_some();
  b.publish(2);
  executor.spin_some();
  EXPECT_THAT(a.received, ElementsAre(1));
  EXPECT_THAT(b.received, ElementsAre(2));
  EXPECT_EQ(jobs_of(executor, "d.b").skipped, 1u);
}

constexpr const char *kTwoCriticalities = R"(
name: criticality
dags:
  - name: high
    criticality: high
    tasks:
      - {name: control, period: 10ms, wcet: 5ms, wcet_low: 1ms, callback: {node: /node, subscription: /control}}
  - name: low
    tasks:
      - {name: map, period: 100ms, wcet: 5ms, callback: {node: /node, subscription: /map}}
      - {name: ask, period: 100ms, wcet: 5ms, callback: {node: /node, service: /ask}}
)";

TEST_P(ExecutorTest, HighModeDropsMessagesOfLowerCriticalityUntilItEnds) {
  options.workload = parse(kTwoCriticalities);
  for (const bool in_process : {true, false}) {
    SCOPED_TRACE(in_process);
    ReDAGExecutor executor(options);
    Numbers control(node, "/control", in_process, 2 * redag::kMillisecond);
    Numbers map(node, "/map", in_process);
    executor.add_node(node);
    for (int i = 1; i <= 3; ++i) {
      if (i == 2) control.publish(i);  // HI mode begins and, as nothing else is there to do, ends
      map.publish(i);
      executor.spin_some();
    }
    EXPECT_THAT(control.received, ElementsAre(2));
    EXPECT_THAT(map.received, ElementsAre(1, 3));
    EXPECT_EQ(jobs_of(executor, "low.map").skipped, 1u);
    executor.remove_node(node);
  }
}

TEST_P(ExecutorTest, HighModeDelaysRequestsAndDropsNone) {
  options.workload = parse(kTwoCriticalities);
  ReDAGExecutor executor(options);
  Numbers control(node, "/control", true, 2 * redag::kMillisecond);
  int asked = 0;
  const auto service = node->create_service<test_msgs::srv::Empty>(
      "/ask", [&](test_msgs::srv::Empty::Request::SharedPtr, test_msgs::srv::Empty::Response::SharedPtr) { ++asked; });
  const auto client = node->create_client<test_msgs::srv::Empty>("/ask");
  executor.add_node(node);
  ASSERT_TRUE(client->wait_for_service(10s));
  control.publish(1);
  auto answer = client->async_send_request(std::make_shared<test_msgs::srv::Empty::Request>());
  ASSERT_TRUE(eventually([&] { return jobs_of(executor, "low.ask").skipped > 0; },
                         [&] {
                           if (asked > 0) control.publish(1);
                           executor.spin_some();
                         }));
  EXPECT_EQ(executor.spin_until_future_complete(answer, 10s), rclcpp::FutureReturnCode::SUCCESS);
  EXPECT_EQ(asked, 1);
}

TEST_P(ExecutorTest, LowerCriticalityGoesOnAfterHighModeOnWorkers) {
  options.workload = parse(kTwoCriticalities);
  ReDAGExecutor executor(options);
  Numbers control(node, "/control", false, 2 * redag::kMillisecond);
  Numbers map(node, "/map", false);
  executor.add_node(node);
  std::uint64_t sent = 0;
  std::uint64_t rounds = 0;
  const auto all_ended = [&] {
    const auto controls = jobs_of(executor, "high.control");
    const auto maps = jobs_of(executor, "low.map");
    // Aborted: where the queue is full, a message can be overwritten and its successor taken before that is told.
    return controls.finished + controls.skipped == rounds && maps.finished + maps.skipped + maps.aborted == sent;
  };
  {
    Spinner spinner(executor);
    ASSERT_TRUE(eventually([&] { return rounds >= 20 && jobs_of(executor, "low.map").skipped > 0; },
                           [&] {
                             control.publish(0);
                             ++rounds;
                             for (int i = 0; i < 3; ++i) map.publish(static_cast<int>(++sent));
                             std::this_thread::sleep_for(5ms);
                           }));
    ASSERT_TRUE(eventually(all_ended));
    // HI mode goes on as long as anything else is in progress, such as the node's own callbacks.
    const std::uint64_t before = jobs_of(executor, "low.map").finished;
    ASSERT_TRUE(eventually([&] { return jobs_of(executor, "low.map").finished > before; },
                           [&] {
                             map.publish(1'000'000);
                             ++sent;
                             std::this_thread::sleep_for(5ms);
                           }));
    ASSERT_TRUE(eventually(all_ended));
  }
  EXPECT_EQ(map.received.back(), 1'000'000);
}

TEST_P(ExecutorTest, ItsTraceHoldsToTheModel) {
  options.workers = 2;
  options.trace_capacity = 1 << 16;
  options.workload = parse(R"(
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

INSTANTIATE_TEST_SUITE_P(Modes, ExecutorTest,
                         ::testing::Values(redag::PreemptionMode::None, redag::PreemptionMode::Cooperative,
                                           redag::PreemptionMode::Os),
                         [](const auto &mode) { return std::string(to_string(mode.param)); });

}  // namespace
}  // namespace redag_rclcpp
