// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Nodes, groups and entities come and go, from several threads and from callbacks, while the executor is busy. Entities
// that stay must keep working, entities that go must be released, and no callback may run without cause. REDAG_SEED
// chooses the changes, REDAG_CHURN_SECONDS their duration for each mode.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <future>
#include <memory>
#include <string>
#include <thread>
#include <tuple>
#include <vector>

#include "churn_nodes.hpp"
#include "environment.hpp"
#include "process_tasks.hpp"
#include "spinning.hpp"

namespace redag_rclcpp {
namespace {

using namespace std::chrono_literals;
using churn::below;
using churn::Churn;
using churn::Counts;
using churn::EmptyService;
using churn::Gardener;
using churn::Random;
using std::chrono::steady_clock;
using test_msgs::msg::Strings;

constexpr int kThreads = 3;

enum class Driver { Spin, Pull, Restart };

/// The thread that spins the executor.
class Driving {
 public:
  Driving(ReDAGExecutor &executor, Driver driver, std::uint64_t seed)
      : executor_(executor), done_(std::async(std::launch::async, [this, driver, seed] { work(driver, seed); })) {}
  ~Driving() {
    if (done_.valid()) stop();
  }
  /// Ends the thread. False: a spin function did not return.
  bool stop() {
    stop_ = true;
    // Repeats cancel(), because a call between two spins is lost.
    for (const auto end = steady_clock::now() + kLimit; steady_clock::now() < end;) {
      executor_.cancel();
      if (done_.wait_for(10ms) == std::future_status::ready) {
        done_.get();
        return true;
      }
    }
    return false;
  }

 private:
  void work(Driver driver, std::uint64_t seed) {
    Random random(seed);
    while (!stop_) {
      switch (driver == Driver::Spin ? 0 : driver == Driver::Restart ? below(random, 4) : 1 + below(random, 3)) {
        case 0: executor_.spin(); break;
        case 1: executor_.spin_some(); break;
        case 2: executor_.spin_all(2ms); break;
        default: executor_.spin_once(std::chrono::milliseconds(below(random, 3)));
      }
    }
  }

  ReDAGExecutor &executor_;
  std::atomic<bool> stop_{false};
  std::future<void> done_;
};

/// A node that stays, and the counts of its work.
struct Steady {
  static constexpr std::chrono::nanoseconds kPeriod = 2ms;
  static constexpr std::size_t kDepth = 2000;

  Steady() {
    rclcpp::PublisherOptions here;
    here.use_intra_process_comm = rclcpp::IntraProcessSetting::Enable;
    rclcpp::SubscriptionOptions from_here;
    from_here.use_intra_process_comm = rclcpp::IntraProcessSetting::Enable;
    const rclcpp::QoS qos = rclcpp::QoS(kDepth).reliable();
    inner = node->create_publisher<Strings>("/steady_inner", qos, here);
    outer = node->create_publisher<Strings>("/steady_outer", qos);
    inner_subscription = node->create_subscription<Strings>(
        "/steady_inner", qos, [this](Strings::ConstSharedPtr) { ++inner_received; }, from_here);
    outer_subscription =
        node->create_subscription<Strings>("/steady_outer", qos, [this](Strings::ConstSharedPtr) { ++outer_received; });
    service = node->create_service<EmptyService>(
        "/steady", [](EmptyService::Request::SharedPtr, EmptyService::Response::SharedPtr) {});
    client = node->create_client<EmptyService>("/steady");
    timer = node->create_wall_timer(kPeriod, [this] {
      ++ticks;
      // On a busy machine the callbacks below this one fall behind. They get time, and no message is overwritten.
      if (sent - std::min(inner_received.load(), outer_received.load()) < kDepth / 2) {
        inner->publish(std::make_unique<Strings>());
        outer->publish(Strings());
        ++sent;
      }
      // Sends one request at a time: a service keeps ten, and at full load more would be overwritten.
      if (ticks % 4 == 0 && asked == answered && client->service_is_ready()) {
        ++asked;
        client->async_send_request(std::make_shared<EmptyService::Request>(),
                                   [this](rclcpp::Client<EmptyService>::SharedFuture) { ++answered; });
      }
    });
  }

  [[nodiscard]] bool goes_on() const {
    const std::uint64_t before[] = {ticks, inner_received, outer_received, answered};
    return eventually([&] {
      return ticks > before[0] && inner_received > before[1] && outer_received > before[2] && answered > before[3];
    });
  }

  [[nodiscard]] std::string counts() const {
    return fmt::format("{} ticks, {} sent, {} and {} received, {} asked, {} answered\n", ticks.load(), sent.load(),
                       inner_received.load(), outer_received.load(), asked.load(), answered.load());
  }

  rclcpp::Node::SharedPtr node = std::make_shared<rclcpp::Node>("steady");
  std::atomic<std::uint64_t> ticks{0}, sent{0}, inner_received{0}, outer_received{0}, asked{0}, answered{0};
  rclcpp::Publisher<Strings>::SharedPtr inner, outer;
  rclcpp::SubscriptionBase::SharedPtr inner_subscription, outer_subscription;
  rclcpp::ServiceBase::SharedPtr service;
  rclcpp::Client<EmptyService>::SharedPtr client;
  rclcpp::TimerBase::SharedPtr timer;
};

using Parameters = std::tuple<redag::PreemptionMode, Driver>;

class ChurnTest : public ::testing::TestWithParam<Parameters> {
 protected:
  void SetUp() override {
    if (std::get<0>(GetParam()) == redag::PreemptionMode::Os && redag::runtime::probe_priority_band().top_job == 0) {
      GTEST_SKIP() << "SCHED_FIFO is not to be had here";
    }
    rclcpp::init(0, nullptr);
    steady = std::make_unique<Steady>();
  }
  void TearDown() override {
    steady.reset();
    if (rclcpp::ok()) rclcpp::shutdown();
  }

  std::unique_ptr<ReDAGExecutor> make_executor() {
    ReDAGOptions options;
    options.preemption = std::get<0>(GetParam());
    options.workers = 2;
    options.on_exception = [](const ExceptionInfo &) { return OnException::Continue; };
    return std::make_unique<ReDAGExecutor>(options);
  }

  static std::chrono::milliseconds duration() {
    const std::chrono::milliseconds all(1000 * from_environment("REDAG_CHURN_SECONDS", 5));
    return std::get<1>(GetParam()) == Driver::Spin ? all * 3 / 5 : all / 5;
  }

  /// Lets everything but the steady node come and go.
  void churn(ReDAGExecutor &executor, std::chrono::milliseconds time) {
    const std::uint64_t seed = from_environment("REDAG_SEED", 20240607);
    Counts counts;
    Churn churn(counts);
    executor.add_node(steady->node);
    Driving driving(executor, std::get<1>(GetParam()), seed);
    {
      std::vector<std::unique_ptr<Gardener>> gardeners;
      for (int i = 1; i <= kThreads; ++i) {
        gardeners.push_back(std::make_unique<Gardener>(executor, churn, counts, seed + static_cast<std::uint64_t>(i)));
      }
      // On a busy machine it can take longer until one of their callbacks runs.
      const auto end = steady_clock::now() + time;
      while (steady_clock::now() < end || (counts.callbacks == 0 && steady_clock::now() < end + kLimit)) {
        std::this_thread::sleep_for(50ms);
        if (std::get<1>(GetParam()) == Driver::Restart) executor.cancel();
        ASSERT_TRUE(steady->goes_on()) << steady->counts() << counts_of(executor.stats());
      }
    }
    if (std::get<1>(GetParam()) == Driver::Restart) {
      ASSERT_TRUE(driving.stop());
      Driving last(executor, Driver::Spin, seed);
      settle(executor, churn, counts);
      ASSERT_TRUE(last.stop());
    } else {
      settle(executor, churn, counts);
      ASSERT_TRUE(driving.stop());
    }
    check_jobs(executor);
    executor.remove_node(steady->node);
    EXPECT_TRUE(executor.stats().empty());
    std::printf("%lu operations, %lu callbacks, %lu threw, %lu ticks\n", counts.operations.load(),
                counts.callbacks.load(), counts.thrown.load(), steady->ticks.load());
  }

  /// Waits until nothing is in progress. Every node but the steady one was dropped before.
  void settle(ReDAGExecutor &executor, Churn &churn, Counts &counts) {
    EXPECT_TRUE(steady->goes_on()) << steady->counts() << counts_of(executor.stats());
    EXPECT_TRUE(eventually([&] { return churn.living() == 0; })) << churn.living() << " nodes are still held";
    EXPECT_EQ(counts.silent, 0);
    EXPECT_GT(counts.callbacks, 0);
    steady->timer->cancel();
    std::this_thread::sleep_for(100ms);  // a release may have been under way
    EXPECT_TRUE(eventually([&] {
      return steady->inner_received >= steady->sent && steady->outer_received >= steady->sent;
    })) << steady->counts()
        << counts_of(executor.stats());
    EXPECT_TRUE(eventually([&] { return steady->answered >= steady->asked; })) << steady->counts();
    // The executor forgets dropped nodes at the next change.
    EXPECT_TRUE(eventually([&] {
      steady->node->create_wall_timer(1h, [] {});
      const auto stats = executor.stats();
      return std::all_of(stats.begin(), stats.end(), [](const CallbackStats &s) { return s.id.node == "/steady"; });
    }));
    // Waits for ready jobs: those left when spinning ends would remain in flight.
    EXPECT_TRUE(eventually([&] {
      const auto stats = executor.stats();
      return std::all_of(stats.begin(), stats.end(), [](const CallbackStats &s) { return s.jobs.in_flight() == 0; });
    }));
  }

  /// What became of each callback's jobs.
  static std::string counts_of(const std::vector<CallbackStats> &stats) {
    std::string text;
    for (const CallbackStats &s : stats) {
      text += fmt::format("{}: {} released, {} finished, {} skipped, {} aborted\n", s.task, s.jobs.released,
                          s.jobs.finished, s.jobs.skipped, s.jobs.aborted);
    }
    return text;
  }

  /// At rest no job is in flight, and the executor's counts match those of the callbacks.
  void check_jobs(ReDAGExecutor &executor) {
    std::uint64_t inner = 0;
    std::uint64_t ticks = 0;
    for (const CallbackStats &stats : executor.stats()) {
      SCOPED_TRACE(stats.task);
      const auto &jobs = stats.jobs;
      EXPECT_EQ(jobs.in_flight(), 0U);
      if (stats.id.name == "/steady_inner") inner = jobs.released;
      if (stats.period == Steady::kPeriod.count()) ticks = jobs.finished;
    }
    EXPECT_EQ(inner, steady->sent);
    EXPECT_EQ(ticks, steady->ticks);
  }

  std::unique_ptr<Steady> steady;
};

TEST_P(ChurnTest, WhatStaysGoesOnAndWhatGoesIsLetGoOf) {
  // A first round starts the threads that the middleware creates on demand.
  {
    const auto executor = make_executor();
    churn(*executor, 200ms);
  }
  if (HasFatalFailure()) return;
  steady = nullptr;
  steady = std::make_unique<Steady>();
  const std::size_t threads = process_tasks().size();
  {
    const auto executor = make_executor();
    churn(*executor, duration());
  }
  if (HasFatalFailure()) return;
  EXPECT_TRUE(eventually([&] { return process_tasks().size() <= threads; }))
      << process_tasks().size() << " threads, " << threads << " before";

  // The steady node is unchanged, and another executor can use it.
  const auto second = make_executor();
  second->add_node(steady->node);
  Driving driving(*second, Driver::Spin, 0);
  steady->timer->reset();
  EXPECT_TRUE(steady->goes_on());
  EXPECT_TRUE(driving.stop());
}

class DroppedTest : public ::testing::Test {
 protected:
  void SetUp() override { rclcpp::init(0, nullptr); }
  void TearDown() override { rclcpp::shutdown(); }
};

TEST_F(DroppedTest, ANodeThatLostAGroupCanBeRemovedAndAddedAgain) {
  ReDAGExecutor executor;
  auto node = std::make_shared<rclcpp::Node>("node");
  {
    auto group = node->create_callback_group(rclcpp::CallbackGroupType::MutuallyExclusive);
    auto timer = node->create_wall_timer(
        1ms, [] {}, group);
    executor.add_node(node);
  }
  EXPECT_NO_THROW(executor.remove_node(node));
  EXPECT_NO_THROW(executor.add_node(node));
}

TEST_F(DroppedTest, ANodeOfTheSameNameCountsItsTimersAnew) {
  ReDAGExecutor executor;
  for (int round = 0; round < 2; ++round) {
    auto node = std::make_shared<rclcpp::Node>("node");
    auto timer = node->create_wall_timer(1h, [] {});
    executor.add_node(node);
    std::vector<std::uint32_t> timers;
    for (const CallbackStats &stats : executor.stats()) {
      if (stats.id.kind == redag::Callback::Kind::Timer) timers.push_back(stats.id.index);
    }
    EXPECT_EQ(timers, std::vector<std::uint32_t>{0}) << "round " << round;
  }
}

std::string name_of(const ::testing::TestParamInfo<Parameters> &test) {
  const auto [mode, driver] = test.param;
  constexpr const char *kNames[] = {"spin", "pull", "restart"};
  return std::string(to_string(mode)) + "_" + kNames[static_cast<int>(driver)];
}

constexpr auto kModes = {redag::PreemptionMode::None, redag::PreemptionMode::Cooperative, redag::PreemptionMode::Os};
constexpr auto kDrivers = {Driver::Spin, Driver::Pull, Driver::Restart};
INSTANTIATE_TEST_SUITE_P(Modes, ChurnTest,
                         ::testing::Combine(::testing::ValuesIn(kModes), ::testing::ValuesIn(kDrivers)), name_of);

}  // namespace
}  // namespace redag_rclcpp
