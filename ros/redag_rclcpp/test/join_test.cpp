// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Joins, under every executor; and what a workload file adds under ReDAGExecutor.
#include "redag_rclcpp/join.hpp"

#include <gmock/gmock.h>

#include <mutex>
#include <utility>
#include <vector>

#include "diagnostic_msgs/msg/diagnostic_array.hpp"
#include "executor_types.hpp"
#include "parse.hpp"
#include "redag/runtime/blocking.hpp"
#include "spinning.hpp"
#include "std_msgs/msg/int32.hpp"
#include "std_msgs/msg/string.hpp"

namespace redag_rclcpp {
namespace {

using namespace std::chrono_literals;
using diagnostic_msgs::msg::DiagnosticArray;
using std_msgs::msg::Int32;
using std_msgs::msg::String;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Pair;

/// Values with which a join's function was called.
class Calls {
 public:
  void add(int a, int b) {
    const std::lock_guard guard(lock_);
    calls_.emplace_back(a, b);
  }
  std::vector<std::pair<int, int>> all() const {
    const std::lock_guard guard(lock_);
    return calls_;
  }

 private:
  mutable std::mutex lock_;
  std::vector<std::pair<int, int>> calls_;
};

template <class T>
class JoinTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!can_run<T>()) GTEST_SKIP() << "SCHED_FIFO is not to be had here";
    rclcpp::init(0, nullptr);
    node = std::make_shared<rclcpp::Node>("node", rclcpp::NodeOptions().use_intra_process_comms(true));
    executor = std::make_unique<T>();
  }
  void TearDown() override {
    spinner.reset();
    executor.reset();
    node.reset();
    if (rclcpp::ok()) rclcpp::shutdown();
  }
  void start() {
    executor->add_node(node);
    spinner = std::make_unique<Spinner<T>>(*executor);
  }
  template <class Message>
  typename rclcpp::Publisher<Message>::SharedPtr publisher(const std::string &topic) {
    auto made = node->template create_publisher<Message>(topic, 10);
    EXPECT_TRUE(eventually([&] { return made->get_subscription_count() == 1; }));
    return made;
  }
  static Int32 number(int value) {
    Int32 message;
    message.data = value;
    return message;
  }
  static DiagnosticArray stamped(int stamp, const std::string &text) {
    DiagnosticArray message;
    message.header.stamp.sec = stamp;
    message.header.frame_id = text;
    return message;
  }

  Calls calls;
  rclcpp::Node::SharedPtr node;
  std::unique_ptr<T> executor;
  std::unique_ptr<Spinner<T>> spinner;
};
TYPED_TEST_SUITE(JoinTest, AllTypes, TypeNames);

TYPED_TEST(JoinTest, OneMessageOfEachTopicMakesACall) {
  const auto joined = join<Int32, String>(
      *this->node, {"a", "b"}, 10,
      [&](Int32::ConstSharedPtr a, String::ConstSharedPtr b) { this->calls.add(a->data, std::stoi(b->data)); });
  const auto a = this->template publisher<Int32>("a");
  const auto b = this->template publisher<String>("b");
  this->start();
  String text;
  for (int n = 1; n <= 5; ++n) {
    a->publish(this->number(10 * n));
    a->publish(this->number(10 * n + 1));
    text.data = std::to_string(n);
    b->publish(text);
    ASSERT_TRUE(eventually([&] { return this->calls.all().size() == static_cast<std::size_t>(n); }));
    EXPECT_THAT(this->calls.all().back(), Pair(10 * n + 1, n)) << "the newest of each";
  }
  a->publish(this->number(0));
  std::this_thread::sleep_for(20ms);
  EXPECT_EQ(this->calls.all().size(), 5U) << "each message once";
}

TYPED_TEST(JoinTest, MessagesFromBeforeTheFirstSpinCount) {
  const auto joined =
      join<Int32, Int32>(*this->node, {"a", "b"}, 10,
                         [&](Int32::ConstSharedPtr a, Int32::ConstSharedPtr b) { this->calls.add(a->data, b->data); });
  this->template publisher<Int32>("a")->publish(this->number(1));
  this->template publisher<Int32>("b")->publish(this->number(2));
  this->start();
  ASSERT_TRUE(eventually([&] { return !this->calls.all().empty(); }));
  EXPECT_THAT(this->calls.all(), ElementsAre(Pair(1, 2)));
}

TYPED_TEST(JoinTest, ExactStampsMeet) {
  const auto joined = join_exact<DiagnosticArray, DiagnosticArray>(
      *this->node, {"a", "b"}, 10, [&](DiagnosticArray::ConstSharedPtr a, DiagnosticArray::ConstSharedPtr b) {
        EXPECT_EQ(a->header.frame_id, "a");
        EXPECT_EQ(b->header.frame_id, "b");
        this->calls.add(a->header.stamp.sec, b->header.stamp.sec);
      });
  const auto a = this->template publisher<DiagnosticArray>("a");
  const auto b = this->template publisher<DiagnosticArray>("b");
  this->start();
  for (const int stamp : {1, 2, 3, 5}) a->publish(this->stamped(stamp, "a"));
  for (const int stamp : {2, 4, 5}) b->publish(this->stamped(stamp, "b"));
  ASSERT_TRUE(eventually([&] { return this->calls.all().size() == 2; }));
  a->publish(this->stamped(4, "a"));  // too late: a later set was used
  b->publish(this->stamped(6, "b"));
  a->publish(this->stamped(6, "a"));
  ASSERT_TRUE(eventually([&] { return this->calls.all().size() == 3; }));
  EXPECT_THAT(this->calls.all(), ElementsAre(Pair(2, 2), Pair(5, 5), Pair(6, 6)));
}

TYPED_TEST(JoinTest, ItsEndEndsTheCalls) {
  auto joined = join<Int32, Int32>(*this->node, {"a", "b"}, 10, [&](Int32::ConstSharedPtr a, Int32::ConstSharedPtr b) {
    this->calls.add(a->data, b->data);
  });
  const auto a = this->template publisher<Int32>("a");
  const auto b = this->template publisher<Int32>("b");
  this->start();
  a->publish(this->number(1));
  this->spinner.reset();
  joined.reset();
  this->spinner = std::make_unique<Spinner<TypeParam>>(*this->executor);
  b->publish(this->number(1));
  std::this_thread::sleep_for(20ms);
  EXPECT_THAT(this->calls.all(), IsEmpty());
}

// Both messages are there; the job waits for the end of both callbacks that sent them.
TEST(JoinWithPredecessors, BeginsWhenAllHaveCompleted) {
  rclcpp::init(0, nullptr);
  {
    const auto node = std::make_shared<rclcpp::Node>("node");
    std::atomic<int> busy{0};
    std::atomic<int> calls{0};
    std::atomic<int> early{0};
    const auto camera_out = node->create_publisher<Int32>("camera", 10);
    const auto lidar_out = node->create_publisher<Int32>("lidar", 10);
    const auto source = [&](const rclcpp::Publisher<Int32>::SharedPtr &out, std::chrono::milliseconds length) {
      return [&busy, out, length] {
        ++busy;
        out->publish(Int32());
        use_processor(length);
        --busy;
      };
    };
    std::vector<rclcpp::CallbackGroup::SharedPtr> groups;
    for (int i = 0; i < 3; ++i)
      groups.push_back(node->create_callback_group(rclcpp::CallbackGroupType::MutuallyExclusive));
    const auto camera = node->create_wall_timer(30ms, source(camera_out, 2ms), groups[0]);
    const auto lidar = node->create_wall_timer(30ms, source(lidar_out, 4ms), groups[1]);
    const auto joined = join<Int32, Int32>(
        *node, {"camera", "lidar"}, 10,
        [&](Int32::ConstSharedPtr, Int32::ConstSharedPtr) {
          if (busy > 0) ++early;
          ++calls;
        },
        groups[2]);
    ReDAGOptions options;
    options.workers = 3;
    options.workload = valid(R"(
name: join
platform: {workers: 3}
dags:
  - name: d
    tasks:
      - {name: camera, callback: {node: /node, timer: {index: 0, period: 30ms}}}
      - {name: lidar, callback: {node: /node, timer: {index: 1, period: 30ms}}}
      - {name: fusion, after: [camera, lidar], callback: {node: /node, waitable: any}}
)");
    ReDAGExecutor executor(options);
    executor.add_node(node);
    const Spinner<ReDAGExecutor> spinner(executor);
    EXPECT_TRUE(eventually([&] { return calls >= 10; }));
    EXPECT_EQ(early, 0);
  }
  rclcpp::shutdown();
}

}  // namespace
}  // namespace redag_rclcpp
