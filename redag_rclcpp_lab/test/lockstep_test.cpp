// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Replays in lockstep: the same order and outputs, however the middleware delays messages and callbacks take time.
// REDAG_REPLAYS=100 replays more often. REDAG_LOCKSTEP=0 replays without lockstep, and the test is expected to fail.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sqlite3.h>

#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <memory>
#include <mutex>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "bag_recording.hpp"
#include "lockstep_player.hpp"
#include "rclcpp/rclcpp.hpp"
#include "rclcpp/serialization.hpp"
#include "redag_rclcpp/coroutine.hpp"
#include "redag_rclcpp/executor.hpp"
#include "std_msgs/msg/u_int64.hpp"
#include "std_srvs/srv/trigger.hpp"

namespace redag_rclcpp::lab {
namespace {

using namespace std::chrono_literals;
using redag::kMillisecond;
using redag::kSecond;
using redag::Time;
using std_msgs::msg::UInt64;
using std_srvs::srv::Trigger;
using testing::HasSubstr;

constexpr Time kStart = 1'700'000'000 * kSecond;

/// Messages at random times, several at the same one; always the same.
class RandomRecording final : public Recording {
 public:
  explicit RandomRecording(std::uint64_t instants) {
    for (const char *topic : {"/scan", "/odom", "/imu"}) topics_.push_back({topic, "std_msgs/msg/UInt64"});
    redag::Rng random(7);
    Time time = kStart;
    for (std::uint64_t i = 0; i < instants; ++i, time += random.uniform(1, 8) * kMillisecond) {
      for (std::int64_t n = random.uniform(1, 5); n > 0; --n) {
        UInt64 message;
        message.data = 10 * i + static_cast<std::uint64_t>(n);
        RecordedMessage recorded;
        recorded.time = time;
        recorded.topic = static_cast<std::size_t>(random.uniform(0, 2));
        rclcpp::Serialization<UInt64>().serialize_message(&message, &recorded.data);
        messages_.push_back(std::move(recorded));
      }
    }
  }
  [[nodiscard]] const std::vector<RecordedTopic> &topics() const override { return topics_; }
  [[nodiscard]] redag::Result<bool> next(RecordedMessage &message) override {
    if (at_ == messages_.size()) return false;
    message = messages_[at_++];
    return true;
  }
  [[nodiscard]] redag::Result<void> rewind() override {
    at_ = 0;
    return {};
  }

 private:
  std::vector<RecordedTopic> topics_;
  std::vector<RecordedMessage> messages_;
  std::size_t at_ = 0;
};

/// Writes a recording as rosbag2 does, to a folder of its own.
class WrittenBag {
 public:
  explicit WrittenBag(RandomRecording recording) {
    std::string name = (std::filesystem::temp_directory_path() / "redag_bag_XXXXXX").string();
    folder_ = mkdtemp(name.data());
    EXPECT_EQ(sqlite3_open((folder_ / "bag_0.db3").c_str(), &database_), SQLITE_OK);
    execute(
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT, "
        "offered_qos_profiles TEXT);"
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB);"
        "INSERT INTO topics VALUES(9, '/clock', 'rosgraph_msgs/msg/Clock', 'cdr', '');");
    int id = 0;
    for (const RecordedTopic &topic : recording.topics()) {
      ++id;
      execute("INSERT INTO topics VALUES(" + std::to_string(id) + ", '" + topic.name + "', '" + topic.type +
              "', 'cdr', '- history: keep_last\n  durability: " + (id == 1 ? "transient_local" : "volatile") + "\n');");
    }
    execute("BEGIN");
    sqlite3_stmt *insert = nullptr;
    sqlite3_prepare_v2(database_, "INSERT INTO messages(topic_id, timestamp, data) VALUES(?, ?, ?)", -1, &insert,
                       nullptr);
    RecordedMessage message;
    while (*recording.next(message)) {
      const rcl_serialized_message_t &data = message.data.get_rcl_serialized_message();
      sqlite3_bind_int64(insert, 1, static_cast<std::int64_t>(message.topic) + 1);
      sqlite3_bind_int64(insert, 2, message.time);
      sqlite3_bind_blob(insert, 3, data.buffer, static_cast<int>(data.buffer_length), SQLITE_TRANSIENT);
      EXPECT_EQ(sqlite3_step(insert), SQLITE_DONE);
      sqlite3_reset(insert);
    }
    sqlite3_finalize(insert);
    execute("COMMIT");
    sqlite3_close(database_);
  }
  ~WrittenBag() { std::filesystem::remove_all(folder_); }

  [[nodiscard]] const std::filesystem::path &folder() const { return folder_; }
  void write(const char *name, const std::string &text) const { std::ofstream(folder_ / name) << text; }
  [[nodiscard]] std::string read(const char *name) const {
    std::ifstream file(folder_ / name);
    return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  }

 private:
  void execute(const std::string &text) {
    EXPECT_EQ(sqlite3_exec(database_, text.c_str(), nullptr, nullptr, nullptr), SQLITE_OK) << sqlite3_errmsg(database_);
  }
  std::filesystem::path folder_;
  sqlite3 *database_ = nullptr;
};

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
    timers_.push_back(plan_->create_timer(70ms, redag_rclcpp::coroutine([this]() -> redag::Coroutine {
      record.add(*plan_, "asks");
      (void)co_await redag_rclcpp::call(client_, std::make_shared<Trigger::Request>());
      record.add(*plan_, "is answered");
      co_await redag_rclcpp::sleep_for(plan_->get_clock(), rclcpp::Duration(20ms));
      record.add(*plan_, "has slept");
    })));
  }

  void add_to(ReDAGExecutor &executor) {
    for (const auto &one : {fuse_, plan_, control_}) executor.add_node(one);
  }

  rclcpp::Node::SharedPtr node(const std::string &name) {
    return std::make_shared<rclcpp::Node>(name, rclcpp::NodeOptions()
                                                    .use_intra_process_comms(in_process_)
                                                    .parameter_overrides({{"use_sim_time", true}}));
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
  void tick(const rclcpp::Node::SharedPtr &to, std::chrono::milliseconds period,
            const rclcpp::Publisher<UInt64>::SharedPtr &publisher) {
    timers_.push_back(to->create_timer(period, [this, to, period, publisher] {
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
  Load() : thread_([this] {
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
    robot.add_to(executor);
    const Spinner spinner(executor);
    PlayOptions how = play(i);
    if (!in_lockstep) {
      how.executors = 0;
      how.rate = 1;
      std::this_thread::sleep_for(500ms);
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
      const auto [a, b] = std::mismatch(lines.begin(), lines.begin() + static_cast<std::ptrdiff_t>(shorter), first.begin());
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

// The program plays a bag to an executor of another process, which stays for all replays.
TEST_F(Lockstep, AProgramReplaysABag) {
  const std::uint64_t replays = number_of("REDAG_REPLAYS", 3);
  const Load load;
  const WrittenBag bag(RandomRecording(60));
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

TEST(LockstepBag, IsReadOrRefused) {
  const WrittenBag bag(RandomRecording(5));
  const auto whole = open_bag(bag.folder().string(), {});
  ASSERT_TRUE(whole) << to_string(whole.error());
  ASSERT_EQ((*whole)->topics().size(), 3U);  // without /clock
  for (const RecordedTopic &topic : (*whole)->topics()) EXPECT_EQ(topic.latched, topic.name == "/scan");
  RandomRecording expected(5);
  RecordedMessage one;
  RecordedMessage other;
  while (*expected.next(one)) {
    ASSERT_TRUE(*(*whole)->next(other));
    EXPECT_EQ(one.time, other.time);
    EXPECT_EQ(expected.topics()[one.topic].name, (*whole)->topics()[other.topic].name);
    EXPECT_EQ(one.data.size(), other.data.size());
  }
  EXPECT_FALSE(*(*whole)->next(other));
  ASSERT_TRUE((*whole)->rewind());
  EXPECT_TRUE(*(*whole)->next(other));

  EXPECT_EQ((*open_bag((bag.folder() / "bag_0.db3").string(), {"/imu"}))->topics().size(), 1U);
  const auto refusal = [](const std::string &path, const std::set<std::string> &topics = {}) {
    const auto opened = open_bag(path, topics);
    return opened ? std::string("opened") : to_string(opened.error());
  };
  EXPECT_THAT(refusal(bag.folder().string(), {"/map"}), HasSubstr("has no topic '/map'"));
  EXPECT_THAT(refusal("/nowhere"), HasSubstr("there is no bag '/nowhere'"));
  bag.write("metadata.yaml", "rosbag2_bagfile_information:\n  compression_mode: FILE\n");
  EXPECT_THAT(refusal(bag.folder().string()), HasSubstr("is compressed"));
  bag.write("metadata.yaml", "");
  bag.write("bag_1.db3", "this is no database, but long enough to be looked at as one");
  EXPECT_THAT(refusal(bag.folder().string()), HasSubstr("bag_1.db3: cannot read"));
  std::filesystem::remove(bag.folder() / "bag_0.db3");
  std::filesystem::remove(bag.folder() / "bag_1.db3");
  EXPECT_THAT(refusal(bag.folder().string()), HasSubstr("ros2 bag convert"));
}

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
    const auto timer = other->create_timer(30ms, [&] { of_other.add(*other, "timer"); });
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

TEST_F(Lockstep, ASubscriptionMadeByACallbackGetsTheNextMessages) {
  Robot robot;
  const auto late = robot.node("late");
  int calls = 0;
  const auto timer = late->create_timer(30ms, [&] {
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

TEST(LockstepMessages, AreReadAsTheyWereWritten) {
  const lockstep::Order order{.kind = lockstep::Order::Kind::Instant, .session = "s", .player = "p", .instant = 3,
                              .time = 5, .published = {{"/a", 2}}};
  const auto read = lockstep::parse_order(to_text(order));
  ASSERT_TRUE(read);
  EXPECT_EQ(to_text(*read), to_text(order));
  lockstep::Report report{.kind = lockstep::Report::Kind::Busy, .session = "s", .executor = "e", .instant = 3,
                          .jobs = 4, .order = ~0ULL, .text = "t", .outside = {{"x", 1}}, .subscriptions = {{"/a", 2}}};
  const auto read_report = lockstep::parse_report(to_text(report));
  ASSERT_TRUE(read_report);
  EXPECT_EQ(to_text(*read_report), to_text(report));
  EXPECT_THAT(to_string(lockstep::parse_order("{\"kind\": \"leap\"}").error()), HasSubstr("'kind' is 'leap'"));
  EXPECT_FALSE(lockstep::parse_report("nonsense"));
}

}  // namespace
}  // namespace redag_rclcpp::lab
