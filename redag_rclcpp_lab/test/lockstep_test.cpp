// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Replays in lockstep: the same order and outputs, however the middleware delays messages and callbacks take time.
// REDAG_REPLAYS=100 replays more often. REDAG_LOCKSTEP=0 replays without lockstep, and the test is expected to fail.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <iostream>
#include <memory>
#include <mutex>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "lockstep_player.hpp"
#include "rclcpp/rclcpp.hpp"
#include "recordings.hpp"
#include "redag_rclcpp/coroutine.hpp"
#include "redag_rclcpp/executor.hpp"
#include "std_msgs/msg/u_int64.hpp"
#include "std_srvs/srv/trigger.hpp"
#ifdef REDAG_ROSBAG2
#include "written_bag.hpp"
#endif

namespace redag_rclcpp::lab {
namespace {

using namespace std::chrono_literals;
using redag::kMillisecond;
using redag::kSecond;
using redag::Time;
using std_msgs::msg::UInt64;
using std_srvs::srv::Trigger;
using testing::HasSubstr;

/// What callbacks did: one line each, with the time of their node's clock, what they took and what they published.
class Record {
 public:
  void add(const rclcpp::Node &node, const std::string &what, std::uint64_t value = 0) {
    const std::lock_guard<std::mutex> guard(lock_);
    lines_.push_back(std::to_string((node.now().nanoseconds() - kStart) / kMillisecond) + " " + node.get_name() + " " +
                     what + " " + std::to_string(value));
  }
  [[nodiscard]] std::vector<std::string> lines() const {
    const std::lock_guard<std::mutex> guard(lock_);
    return lines_;
  }

 private:
  mutable std::mutex lock_;
  std::vector<std::string> lines_;
};

/// Nodes that react to the recording, to each other and to time. Their callbacks take times that nobody knows.
class Robot {
 public:
  explicit Robot(bool in_process = false) : in_process_(in_process) {
    fuse_ = node("fuse");
    plan_ = node("plan");
    control_ = node("control");
    for (const char *topic : {"/scan", "/odom", "/imu"}) {
      react(fuse_, topic, fuse_->create_publisher<UInt64>("/fused", 10));
    }
    react(plan_, "/fused", plan_->create_publisher<UInt64>("/path", 10));
    react(control_, "/path", nullptr);
    react(control_, "/odom", control_->create_publisher<UInt64>("/command", 10));
    tick(plan_, 50ms, plan_->create_publisher<UInt64>("/path", 10));
    tick(control_, 20ms, control_->create_publisher<UInt64>("/fused", 10));
    tick(fuse_, 20ms, nullptr);
    // A callback that awaits a service of another node, and then its node's clock.
    map_ = fuse_->create_service<Trigger>(
        "/map", [this](const std::shared_ptr<Trigger::Request>, const std::shared_ptr<Trigger::Response>) {
          record.add(*fuse_, "map");
        });
    client_ = plan_->create_client<Trigger>("/map");
    timers_.push_back(timer_of(plan_, 70ms, redag_rclcpp::coroutine([this]() -> redag::Coroutine {
                                 record.add(*plan_, "asks");
                                 (void)co_await redag_rclcpp::call(client_, std::make_shared<Trigger::Request>());
                                 record.add(*plan_, "is answered");
                                 co_await redag_rclcpp::sleep_for(plan_->get_clock(), rclcpp::Duration(20ms));
                                 record.add(*plan_, "has slept");
                               })));
  }

  void add_to(ReDAGExecutor &executor, bool in_order = true) {
    std::vector<rclcpp::Node::SharedPtr> nodes{fuse_, plan_, control_};
    if (!in_order) std::reverse(nodes.begin(), nodes.end());
    for (const auto &one : nodes) executor.add_node(one);
  }

  rclcpp::Node::SharedPtr node(const std::string &name) {
    return std::make_shared<rclcpp::Node>(
        name, rclcpp::NodeOptions().use_intra_process_comms(in_process_).parameter_overrides({{"use_sim_time", true}}));
  }
  void react(const rclcpp::Node::SharedPtr &to, const std::string &topic,
             const rclcpp::Publisher<UInt64>::SharedPtr &publisher) {
    subscriptions_.push_back(
        to->create_subscription<UInt64>(topic, 10, [this, to, topic, publisher](const UInt64 &message) {
          record.add(*to, topic, message.data);
          dawdle();
          send(publisher, 3 * message.data + 1);
        }));
  }
  /// As rclcpp::Node::create_timer(), which Humble lacks.
  template <class Function>
  static rclcpp::TimerBase::SharedPtr timer_of(const rclcpp::Node::SharedPtr &node, std::chrono::milliseconds period,
                                               Function function) {
    return rclcpp::create_timer(node, node->get_clock(), rclcpp::Duration(period), std::move(function));
  }
  void tick(const rclcpp::Node::SharedPtr &to, std::chrono::milliseconds period,
            const rclcpp::Publisher<UInt64>::SharedPtr &publisher) {
    timers_.push_back(timer_of(to, period, [this, to, period, publisher] {
      record.add(*to, "timer", static_cast<std::uint64_t>(period.count()));
      dawdle();
      send(publisher, ++sum_);
    }));
  }

  Record record;

 private:
  void send(const rclcpp::Publisher<UInt64>::SharedPtr &publisher, std::uint64_t value) {
    if (publisher == nullptr) return;
    UInt64 message;
    message.data = sum_ = 31 * sum_ + value;
    publisher->publish(message);
  }
  void dawdle() {
    const std::lock_guard<std::mutex> guard(random_lock_);
    std::this_thread::sleep_for(std::chrono::microseconds(std::uniform_int_distribution(0, 200)(random_)));
  }

  const bool in_process_;
  rclcpp::Node::SharedPtr fuse_, plan_, control_;
  std::vector<rclcpp::SubscriptionBase::SharedPtr> subscriptions_;
  std::vector<rclcpp::TimerBase::SharedPtr> timers_;
  rclcpp::Service<Trigger>::SharedPtr map_;
  rclcpp::Client<Trigger>::SharedPtr client_;
  std::atomic<std::uint64_t> sum_{0};  // of everything so far: a difference stays
  std::mutex random_lock_;
  std::minstd_rand random_{std::random_device{}()};
};

/// Keeps a processor busy, with pauses.
class Load {
 public:
  Load()
      : thread_([this] {
          std::minstd_rand random{std::random_device{}()};
          while (!done_) {
            const auto end = std::chrono::steady_clock::now() + std::chrono::microseconds(random() % 5000);
            while (std::chrono::steady_clock::now() < end) {
            }
            std::this_thread::sleep_for(std::chrono::microseconds(random() % 3000));
          }
        }) {}
  ~Load() {
    done_ = true;
    thread_.join();
  }

 private:
  std::atomic<bool> done_{false};
  std::thread thread_;
};

class Spinner {
 public:
  explicit Spinner(ReDAGExecutor &executor) : executor_(executor), thread_([&] { executor.spin(); }) {
    while (!executor.is_spinning()) std::this_thread::sleep_for(1ms);
  }
  ~Spinner() {
    executor_.cancel();
    thread_.join();
  }

 private:
  ReDAGExecutor &executor_;
  std::thread thread_;
};

class Lockstep : public testing::Test {
 protected:
  void SetUp() override { rclcpp::init(0, nullptr); }
  void TearDown() override { rclcpp::shutdown(); }

  static ReDAGOptions options() {
    ReDAGOptions options;
    options.workers = 3;  // overridden, as everything else that would make a difference
    options.lockstep = true;
    return options;
  }
  static PlayOptions play(std::uint64_t shuffle = 0) {
    PlayOptions options;
    options.rate = 0;
    options.shuffle = shuffle;
    options.say = [](const std::string &text) { std::cerr << text << "\n"; };
    return options;
  }
  static rclcpp::Node::SharedPtr player_node() { return std::make_shared<rclcpp::Node>("play_lockstep"); }
};

std::uint64_t number_of(const char *variable, std::uint64_t otherwise) {
  const char *const text = std::getenv(variable);
  return text == nullptr ? otherwise : std::strtoull(text, nullptr, 10);
}

class LockstepReplays : public Lockstep, public testing::WithParamInterface<bool> {};

TEST_P(LockstepReplays, HaveTheSameOrderAndOutputs) {
  const bool in_lockstep = number_of("REDAG_LOCKSTEP", 1) != 0;
  const std::uint64_t replays = number_of("REDAG_REPLAYS", 5);
  const Load load;
  std::vector<std::string> first;
  std::uint64_t hash = 0;
  std::uint64_t differ = 0;
  std::uint64_t instants = 0;
  redag::Duration took = 0;
  redag::Duration recorded = 0;
  for (std::uint64_t i = 0; i < replays; ++i) {
    Robot robot(GetParam());
    ReDAGOptions options = this->options();
    options.lockstep = in_lockstep;
    ReDAGExecutor executor(options);
    robot.add_to(executor, i % 2 == 0);
    const Spinner spinner(executor);
    PlayOptions how = play(i);
    if (!in_lockstep) {
      how.executors = 0;
      how.rate = 1;
    }
    RandomRecording recording(60);
    LockstepPlayer player(player_node(), how);
    const auto result = player.play(recording);
    ASSERT_TRUE(result) << to_string(result.error());
    if (!in_lockstep) std::this_thread::sleep_for(500ms);
    const std::vector<std::string> lines = robot.record.lines();
    took += result->took;
    recorded += result->recorded;
    instants += result->instants;
    std::uint64_t order = 0;
    if (in_lockstep) {
      ASSERT_EQ(result->executors.size(), 1U);
      const lockstep::Report &report = result->executors.begin()->second.report;
      EXPECT_THAT(report.outside, testing::IsEmpty());
      EXPECT_GT(report.jobs, 300U);
      order = report.order;
    }
    if (i == 0) {
      first = lines;
      hash = order;
      continue;
    }
    EXPECT_EQ(order, hash);
    if (lines != first) {
      const std::size_t shorter = std::min(lines.size(), first.size());
      const auto [a, b] =
          std::mismatch(lines.begin(), lines.begin() + static_cast<std::ptrdiff_t>(shorter), first.begin());
      ++differ;
      std::cerr << "replay " << i << " differs at callback " << a - lines.begin() << " of " << lines.size() << ", "
                << first.size() << ": " << (a == lines.end() ? "-" : *a) << " | " << (b == first.end() ? "-" : *b)
                << "\n";
    }
  }
  EXPECT_EQ(differ, 0U) << "of " << replays << " replays";
  std::cout << replays << " replays, " << differ << " differ from the first; " << first.size() << " callbacks, "
            << instants << " instants; " << static_cast<double>(recorded) / static_cast<double>(took)
            << " x real time\n";
}

INSTANTIATE_TEST_SUITE_P(Transport, LockstepReplays, testing::Bool(),
                         [](const auto &given) { return given.param ? "InProcess" : "Middleware"; });

#ifdef REDAG_ROSBAG2
// The program plays a bag to an executor of another process, which stays for all replays.
TEST_F(Lockstep, AProgramReplaysABag) {
  const std::uint64_t replays = number_of("REDAG_REPLAYS", 3);
  const Load load;
  RandomRecording recording(60);
  const WrittenBag bag(recording);
  Robot robot;
  ReDAGExecutor executor(options());
  robot.add_to(executor);
  const Spinner spinner(executor);
  std::string first;
  std::uint64_t differ = 0;
  // In the first replay the clocks begin at 0, and timers of the robot have no grid yet.
  for (std::uint64_t i = 0; i <= replays; ++i) {
    const std::string command = std::string(PLAYER) + " " + bag.folder().string() + " --log " +
                                (bag.folder() / "log").string() + (i % 2 == 0 ? "" : " --shuffle 5") + " > " +
                                (bag.folder() / "out").string() + " 2>&1";
    ASSERT_EQ(std::system(command.c_str()), 0) << bag.read("out");
    if (i == 0) continue;
    if (i == 1) {
      first = bag.read("log");
      EXPECT_THAT(bag.read("out"), HasSubstr("of the recording in"));
    }
    if (bag.read("log") != first) ++differ;
  }
  EXPECT_GT(first.size(), 1000U);
  EXPECT_EQ(differ, 0U);
  std::cout << replays << " replays, " << differ << " differ; " << bag.read("out");
}
#endif

// Each callback sees the time of its instant, also where the clock jumps back.
TEST_F(Lockstep, ClocksShowTheInstantAndJumpBack) {
  Robot robot;
  ReDAGExecutor executor(options());
  robot.add_to(executor);
  const Spinner spinner(executor);
  PlayOptions how = play();
  how.repeat = 3;  // before the first instant the clocks show 0
  RandomRecording recording(30);
  LockstepPlayer player(player_node(), how);
  const auto result = player.play(recording);
  ASSERT_TRUE(result) << to_string(result.error());
  std::vector<int> ticks;
  for (const std::string &line : robot.record.lines()) {
    if (line.find("control timer 20") != std::string::npos) ticks.push_back(std::stoi(line));
  }
  std::vector<std::vector<int>> rounds;
  for (const int tick : ticks) {
    if (rounds.empty() || tick < rounds.back().back()) rounds.emplace_back();
    rounds.back().push_back(tick);
  }
  ASSERT_EQ(rounds.size(), 3U);
  EXPECT_GT(rounds[1].size(), 4U);
  EXPECT_EQ(rounds[1], rounds[2]);
}

TEST_F(Lockstep, WhatComesFromOutsideIsReported) {
  Robot robot;
  const auto wall = robot.node("wall");
  const auto timer = wall->create_wall_timer(1ms, [] {});
  robot.react(wall, "/stranger", nullptr);
  ReDAGExecutor executor(options());
  robot.add_to(executor);
  executor.add_node(wall);
  const Spinner spinner(executor);
  PlayOptions how = play();
  how.rate = 1;
  RandomRecording recording(20);
  const auto node = player_node();
  const auto stranger = node->create_publisher<UInt64>("/stranger", 10);
  std::uint64_t sent = 0;
  LockstepPlayer player(node, how, [&](Time, const PlayResult &) {
    if (sent++ == 3) stranger->publish(UInt64());
  });
  const auto result = player.play(recording);
  ASSERT_TRUE(result) << to_string(result.error());
  const auto &outside = result->executors.begin()->second.report.outside;
  EXPECT_EQ(outside.count("/wall timer 1 ms (0)"), 1U);
  ASSERT_EQ(outside.count("/wall subscription /stranger"), 1U);
  EXPECT_EQ(outside.at("/wall subscription /stranger"), 1U);
  EXPECT_EQ(outside.size(), 2U);
}

TEST_F(Lockstep, TwoExecutorsGoTogether) {
  std::string first;
  for (std::uint64_t i = 0; i < 3; ++i) {
    Robot robot;
    Record of_other;
    const auto other = robot.node("other");
    const auto subscription = other->create_subscription<UInt64>(
        "/imu", 10, [&](const UInt64 &message) { of_other.add(*other, "/imu", message.data); });
    const auto timer = Robot::timer_of(other, 30ms, [&] { of_other.add(*other, "timer"); });
    ReDAGExecutor one(options());
    ReDAGExecutor two(options());
    robot.add_to(one);
    two.add_node(other);
    const Spinner spins_one(one);
    const Spinner spins_two(two);
    PlayOptions how = play(i);
    how.executors = 2;
    RandomRecording recording(40);
    LockstepPlayer player(player_node(), how);
    const auto result = player.play(recording);
    ASSERT_TRUE(result) << to_string(result.error());
    EXPECT_EQ(result->executors.size(), 2U);
    for (const auto &[name, follower] : result->executors) EXPECT_THAT(follower.report.outside, testing::IsEmpty());
    std::string all;
    for (const Record *record : {&robot.record, &of_other}) {
      for (const std::string &line : record->lines()) all += line + "\n";
    }
    EXPECT_THAT(all, HasSubstr("other /imu"));
    if (i == 0) first = all;
    EXPECT_EQ(all, first);
  }
}

/// One instant with a message on each of these topics.
class OneInstant final : public Recording {
 public:
  explicit OneInstant(std::vector<std::string> names) {
    for (std::string &name : names) topics_.push_back({std::move(name), "std_msgs/msg/UInt64"});
  }
  [[nodiscard]] const std::vector<RecordedTopic> &topics() const override { return topics_; }
  [[nodiscard]] redag::Result<bool> next(RecordedMessage &message) override {
    if (at_ == topics_.size()) return false;
    message.time = kStart;
    message.topic = at_++;
    const UInt64 content;
    rclcpp::Serialization<UInt64>().serialize_message(&content, &message.data);
    return true;
  }
  [[nodiscard]] redag::Result<void> rewind() override {
    at_ = 0;
    return {};
  }

 private:
  std::vector<RecordedTopic> topics_;
  std::size_t at_ = 0;
};

// All callbacks have one priority, and the oldest data go first. The first message that "one" publishes is as old as
// its own data. The second one has the turn of its publication, which comes after what the instant began with.
TEST_F(Lockstep, WhatAJobPublishesHasTheTurnOfThatJob) {
  Robot robot;
  const auto one = robot.node("one");
  const auto other = robot.node("other");
  const auto then = robot.node("then");
  Record record;
  const auto publisher = one->create_publisher<UInt64>("/then", 10);
  const auto first = one->create_subscription<UInt64>("/first", 10, [&](const UInt64 &) {
    record.add(*one, "/first");
    for (std::uint64_t i = 1; i <= 2; ++i) {
      UInt64 message;
      message.data = i;
      publisher->publish(message);
    }
  });
  const auto second =
      other->create_subscription<UInt64>("/second", 10, [&](const UInt64 &) { record.add(*other, "/second"); });
  const auto published = then->create_subscription<UInt64>(
      "/then", 10, [&](const UInt64 &message) { record.add(*then, "/then", message.data); });
  ReDAGExecutor executor(options());
  for (const auto &node : {one, other, then}) executor.add_node(node);
  const Spinner spinner(executor);
  OneInstant recording({"/first", "/second"});
  LockstepPlayer player(player_node(), play());
  const auto result = player.play(recording);
  ASSERT_TRUE(result) << to_string(result.error());
  EXPECT_THAT(record.lines(),
              testing::ElementsAre("0 one /first 0", "0 then /then 1", "0 other /second 0", "0 then /then 2"));
}

TEST_F(Lockstep, ASubscriptionMadeByACallbackGetsTheNextMessages) {
  Robot robot;
  const auto late = robot.node("late");
  int calls = 0;
  const auto timer = Robot::timer_of(late, 30ms, [&] {
    if (++calls == 3) robot.react(late, "/imu", nullptr);
  });
  ReDAGExecutor executor(options());
  robot.add_to(executor);
  executor.add_node(late);
  const Spinner spinner(executor);
  RandomRecording recording(60);
  LockstepPlayer player(player_node(), play(3));
  const auto result = player.play(recording);
  ASSERT_TRUE(result) << to_string(result.error());
  std::vector<std::string> by_fuse;
  std::vector<std::string> by_late;
  for (const std::string &line : robot.record.lines()) {
    if (line.find("fuse /imu") != std::string::npos) by_fuse.push_back(line.substr(line.rfind(' ')));
    if (line.find("late /imu") != std::string::npos) by_late.push_back(line.substr(line.rfind(' ')));
  }
  ASSERT_GT(by_late.size(), 5U);
  ASSERT_GT(by_fuse.size(), by_late.size());
  EXPECT_EQ(std::vector<std::string>(by_fuse.end() - static_cast<std::ptrdiff_t>(by_late.size()), by_fuse.end()),
            by_late);
  EXPECT_THAT(result->executors.begin()->second.report.outside, testing::IsEmpty());
}

TEST_F(Lockstep, AnExecutorThatStopsEndsTheReplay) {
  Robot robot;
  ReDAGExecutor executor(options());
  robot.add_to(executor);
  const Spinner spinner(executor);
  RandomRecording recording(60);
  std::uint64_t instants = 0;
  LockstepPlayer player(player_node(), play(), [&](Time, const PlayResult &) {
    if (++instants == 10) executor.cancel();
  });
  const auto result = player.play(recording);
  ASSERT_FALSE(result);
  EXPECT_THAT(to_string(result.error()), HasSubstr("the executor was stopped"));
}

TEST_F(Lockstep, AnExecutorThatIsSilentIsNamed) {
  const auto node = player_node();
  // Answers once, and never again.
  const auto reports = node->create_publisher<std_msgs::msg::String>(lockstep::kReportTopic, lockstep::qos());
  const auto orders = node->create_subscription<std_msgs::msg::String>(
      lockstep::kOrderTopic, lockstep::qos(), [&](const std_msgs::msg::String &message) {
        const auto order = lockstep::parse_order(message.data);
        ASSERT_TRUE(order);
        if (order->kind != lockstep::Order::Kind::Begin) return;
        lockstep::Report report;
        report.kind = lockstep::Report::Kind::Ready;
        report.session = order->session;
        report.executor = "mute";
        std_msgs::msg::String answer;
        answer.data = to_text(report);
        reports->publish(answer);
      });
  PlayOptions how = play();
  how.patience = 200 * kMillisecond;
  RandomRecording recording(5);
  LockstepPlayer player(node, how);
  const auto result = player.play(recording);
  ASSERT_FALSE(result);
  EXPECT_THAT(to_string(result.error()), HasSubstr("executor mute has given no sign of life for 200ms in instant 1"));
}

// A player that was killed says no end. What has waited for it runs then.
TEST_F(Lockstep, NothingWaitsForAPlayerThatHasGone) {
  Robot robot;
  ReDAGExecutor executor(options());
  robot.add_to(executor);
  const Spinner spinner(executor);
  const auto node = player_node();
  bool ready = false;
  const auto reports = node->create_subscription<std_msgs::msg::String>(
      lockstep::kReportTopic, lockstep::qos(), [&](const std_msgs::msg::String &message) {
        ready = ready || lockstep::parse_report(message.data)->kind == lockstep::Report::Kind::Ready;
      });
  auto orders = node->create_publisher<std_msgs::msg::String>(lockstep::kOrderTopic, lockstep::qos());
  const auto scans = node->create_publisher<UInt64>("/scan", 10);
  std_msgs::msg::String begin;
  begin.data = to_text(lockstep::Order{.session = "s", .player = node->get_name(), .published = {{"/scan", 0}}});
  rclcpp::executors::SingleThreadedExecutor spinner_of_node;
  spinner_of_node.add_node(node);
  while (!ready) {
    orders->publish(begin);
    spinner_of_node.spin_once(50ms);
  }
  scans->publish(UInt64());
  std::this_thread::sleep_for(50ms);
  EXPECT_THAT(robot.record.lines(), testing::IsEmpty());
  orders.reset();
  while (robot.record.lines().empty()) std::this_thread::sleep_for(1ms);
  EXPECT_THAT(robot.record.lines().front(), HasSubstr("/scan 0"));
}

TEST_F(Lockstep, MoreExecutorsThanExpectedAreRefused) {
  ReDAGExecutor one(options());
  ReDAGExecutor other(options());
  const Spinner spins_one(one);
  const Spinner spins_other(other);
  PlayOptions how = play();
  how.executors = 1;
  std::this_thread::sleep_for(300ms);  // until the player has found both
  const auto node = player_node();
  RandomRecording recording(5);
  LockstepPlayer player(node, how);
  while (node->count_subscribers(lockstep::kOrderTopic) < 2) std::this_thread::sleep_for(1ms);
  const auto result = player.play(recording);
  ASSERT_FALSE(result);
  EXPECT_THAT(to_string(result.error()), HasSubstr("2 executors are in lockstep, and --executors says 1"));
}

}  // namespace
}  // namespace redag_rclcpp::lab
