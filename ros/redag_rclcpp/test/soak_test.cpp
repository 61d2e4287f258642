// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Measures what an idle executor costs, and which memory and threads it keeps in the long run. REDAG_SOAK_SECONDS is
// the length of the busy part (10), REDAG_SOAK_WORKERS the number of workers (2), REDAG_SOAK_LOAD the share of them
// that is used (0). REDAG_SOAK_EXECUTOR=multi_threaded runs rclcpp's executor instead, for comparison.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "process_tasks.hpp"
#include "rclcpp/rclcpp.hpp"
#include "redag_rclcpp/executor.hpp"
#include "spinning.hpp"
#include "test_msgs/msg/strings.hpp"
#include "test_msgs/srv/empty.hpp"

namespace redag_rclcpp {
namespace {

using namespace std::chrono_literals;
using std::chrono::steady_clock;
using test_msgs::msg::Strings;
using EmptyService = test_msgs::srv::Empty;

std::size_t resident_kib() {
  std::ifstream statm("/proc/self/statm");
  std::size_t total = 0;
  std::size_t resident = 0;
  statm >> total >> resident;
  return resident * static_cast<std::size_t>(sysconf(_SC_PAGESIZE)) / 1024;
}

std::size_t open_files() {
  std::error_code ignored;
  const std::filesystem::directory_iterator files("/proc/self/fd", ignored);
  return static_cast<std::size_t>(std::distance(begin(files), end(files)));
}

double number_from(const char *variable, double otherwise) {
  const char *text = std::getenv(variable);
  return text == nullptr ? otherwise : std::atof(text);
}

/// Wake-ups of the executor's threads and of the spinning thread.
std::uint64_t wake_ups(int spinning_thread) {
  std::uint64_t all = 0;
  for (const auto &[id, task] : process_tasks()) {
    if (id == spinning_thread || task.name.rfind("redag", 0) == 0) all += task.switches;
  }
  return all;
}

class SoakTest : public ::testing::Test {
 protected:
  void SetUp() override { rclcpp::init(0, nullptr); }
  void TearDown() override { rclcpp::shutdown(); }
};

class IdleTest : public SoakTest, public ::testing::WithParamInterface<redag::PreemptionMode> {};

TEST_P(IdleTest, NothingWakesTheExecutor) {
  if (GetParam() == redag::PreemptionMode::Os && redag::runtime::probe_priority_band().top_job == 0) {
    GTEST_SKIP() << "SCHED_FIFO is not to be had here";
  }
  auto node = std::make_shared<rclcpp::Node>("idle");
  std::atomic<int> received{0};
  auto subscription =
      node->create_subscription<Strings>("/idle", rclcpp::QoS(10), [&](Strings::ConstSharedPtr) { ++received; });
  auto publisher = node->create_publisher<Strings>("/idle", rclcpp::QoS(10));
  auto service = node->create_service<EmptyService>(
      "~/service", [](EmptyService::Request::SharedPtr, EmptyService::Response::SharedPtr) {});
  ReDAGOptions options;
  options.preemption = GetParam();
  options.workers = 2;
  ReDAGExecutor executor(options);
  executor.add_node(node);
  const Spinner spinner(executor);
  // Shows that the executor works, and waits until its start is over.
  ASSERT_TRUE(eventually([&] {
    publisher->publish(Strings());
    std::this_thread::sleep_for(10ms);
    return received > 0;
  }));
  std::this_thread::sleep_for(500ms);
  const std::uint64_t before = wake_ups(spinner.thread_id());
  EXPECT_GT(before, 0);
  std::this_thread::sleep_for(2s);
  const std::uint64_t woken = wake_ups(spinner.thread_id()) - before;
  std::printf("%lu wake-ups in 2 s\n", woken);
  EXPECT_LE(woken, 2);
}

INSTANTIATE_TEST_SUITE_P(Modes, IdleTest,
                         ::testing::Values(redag::PreemptionMode::None, redag::PreemptionMode::Cooperative,
                                           redag::PreemptionMode::Os),
                         [](const auto &test) { return std::string(to_string(test.param)); });

/// A chain of three callbacks, a service that is called, and nodes that come and go.
class Graph {
 public:
  explicit Graph(rclcpp::Executor &executor) : executor_(executor) {
    first_ = node_->create_publisher<Strings>("/first", rclcpp::QoS(10));
    second_ = node_->create_publisher<Strings>("/second", rclcpp::QoS(10));
    filter_ = node_->create_subscription<Strings>(
        "/first", rclcpp::QoS(10), [this](Strings::ConstSharedPtr message) { second_->publish(*message); });
    sink_ = node_->create_subscription<Strings>("/second", rclcpp::QoS(10),
                                                [this](Strings::ConstSharedPtr) { ++received; });
    service_ = node_->create_service<EmptyService>(
        "~/service", [](EmptyService::Request::SharedPtr, EmptyService::Response::SharedPtr) {});
    client_ = node_->create_client<EmptyService>("~/service");
    timer_ = node_->create_wall_timer(20ms, [this] {
      first_->publish(Strings());
      if (++ticks_ % 5 == 0) {
        client_->async_send_request(std::make_shared<EmptyService::Request>(),
                                    [this](rclcpp::Client<EmptyService>::SharedFuture) { ++answered; });
      }
    });
    executor_.add_node(node_);
  }

  /// Adds a node and drops one. Every other one is dropped without being removed.
  void churn() {
    auto node = std::make_shared<rclcpp::Node>("guest" + std::to_string(guests_++),
                                               rclcpp::NodeOptions().start_parameter_event_publisher(false));
    auto group = node->create_callback_group(rclcpp::CallbackGroupType::MutuallyExclusive);
    rclcpp::SubscriptionOptions options;
    options.callback_group = group;
    auto subscription = node->create_subscription<Strings>(
        "/second", rclcpp::QoS(10), [](Strings::ConstSharedPtr) {}, options);
    auto timer = node->create_wall_timer(
        20ms, [] {}, group);
    executor_.add_node(node);
    std::this_thread::sleep_for(60ms);
    if (guests_ % 2 == 0) executor_.remove_node(node);
  }

  std::atomic<std::uint64_t> received{0};
  std::atomic<std::uint64_t> answered{0};

 private:
  rclcpp::Executor &executor_;
  rclcpp::Node::SharedPtr node_ = std::make_shared<rclcpp::Node>("soak");
  rclcpp::Publisher<Strings>::SharedPtr first_, second_;
  rclcpp::SubscriptionBase::SharedPtr filter_, sink_;
  rclcpp::ServiceBase::SharedPtr service_;
  rclcpp::Client<EmptyService>::SharedPtr client_;
  rclcpp::TimerBase::SharedPtr timer_;
  std::uint64_t ticks_ = 0;
  std::uint64_t guests_ = 0;
};

/// Two timers for each worker, which use `load` of it. A quarter of the load has short periods, the rest are long jobs.
class Load {
 public:
  Load(rclcpp::Executor &executor, std::size_t workers, double load) {
    for (std::size_t i = 0; i < workers && load > 0; ++i) {
      add(5ms, load / 4, i == 0);
      add(50ms, load * 3 / 4, false);
    }
    executor.add_node(node_);
  }

  /// The 99th percentile, in microseconds, of the first short timer's responses since the last call; 0 without
  /// responses.
  double take_p99() {
    const std::lock_guard lock(mutex_);
    if (responses_.empty()) return 0;
    const auto p99 = responses_.begin() + static_cast<std::ptrdiff_t>(responses_.size() * 99 / 100);
    std::nth_element(responses_.begin(), p99, responses_.end());
    const double value = *p99;
    responses_.clear();
    return value;
  }

 private:
  using microseconds = std::chrono::duration<double, std::micro>;

  void add(std::chrono::nanoseconds period, double share, bool is_measured) {
    groups_.push_back(node_->create_callback_group(rclcpp::CallbackGroupType::MutuallyExclusive));
    const auto slot = timers_.size();
    timers_.push_back(node_->create_wall_timer(
        period,
        [this, slot, period, work = share * std::chrono::duration<double>(period).count(), is_measured] {
          for (const double begin = processor_time(); processor_time() < begin + work;) {
          }
          if (!is_measured) return;
          const microseconds response = period - timers_[slot]->time_until_trigger();
          const std::lock_guard lock(mutex_);
          responses_.push_back(response.count());
        },
        groups_.back()));
  }

  static double processor_time() {
    timespec time{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
    return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
  }

  rclcpp::Node::SharedPtr node_ = std::make_shared<rclcpp::Node>("load");
  std::vector<rclcpp::CallbackGroup::SharedPtr> groups_;  // the node does not keep its groups alive
  std::vector<rclcpp::TimerBase::SharedPtr> timers_;
  std::mutex mutex_;
  std::vector<double> responses_;
};

/// Least-squares slope, per minute.
double slope(const std::vector<double> &minutes, const std::vector<double> &values, std::size_t from) {
  const auto n = static_cast<double>(values.size() - from);
  double x = 0;
  double y = 0;
  double xx = 0;
  double xy = 0;
  for (std::size_t i = from; i < values.size(); ++i) {
    x += minutes[i] / n;
    y += values[i] / n;
    xx += minutes[i] * minutes[i] / n;
    xy += minutes[i] * values[i] / n;
  }
  return xx > x * x ? (xy - x * y) / (xx - x * x) : 0;
}

TEST_F(SoakTest, ABusyGraphGoesOnAndThreadsDoNotPileUp) {
  const std::chrono::seconds time(static_cast<int>(number_from("REDAG_SOAK_SECONDS", 10)));
  const auto workers = static_cast<std::uint32_t>(number_from("REDAG_SOAK_WORKERS", 2));
  const char *kind = std::getenv("REDAG_SOAK_EXECUTOR");
  std::unique_ptr<rclcpp::Executor> executor;
  if (kind != nullptr && std::string(kind) == "multi_threaded") {
    executor = std::make_unique<rclcpp::executors::MultiThreadedExecutor>(rclcpp::ExecutorOptions(), workers);
  } else {
    executor = std::make_unique<ReDAGExecutor>(ReDAGOptions{.workers = workers});
  }
  Graph graph(*executor);
  Load load(*executor, workers, number_from("REDAG_SOAK_LOAD", 0));
  const Spinner spinner(*executor);
  graph.churn();
  ASSERT_TRUE(eventually([&] { return graph.received > 0 && graph.answered > 0; }));

  const std::size_t threads = process_tasks().size();
  const std::size_t files = open_files();
  std::vector<double> minutes;
  std::vector<double> resident;
  const auto begin = steady_clock::now();
  for (auto next = begin; next < begin + time;) {
    const std::uint64_t before[] = {graph.received, graph.answered};
    next += 1s;
    while (steady_clock::now() < next) {
      graph.churn();
      std::this_thread::sleep_for(200ms);
    }
    ASSERT_TRUE(eventually([&] { return graph.received > before[0] && graph.answered > before[1]; }));
    minutes.push_back(std::chrono::duration<double>(steady_clock::now() - begin).count() / 60);
    resident.push_back(static_cast<double>(resident_kib()));
    if (resident.size() % 60 == 0) {
      std::printf("%5.1f min: %.0f KiB, %zu threads, %zu files, %lu wake-ups, p99 of 5 ms timer %.0f us\n",
                  minutes.back(), resident.back(), process_tasks().size(), open_files(), wake_ups(spinner.thread_id()),
                  load.take_p99());
      std::fflush(stdout);
    }
  }
  EXPECT_LE(process_tasks().size(), threads);
  EXPECT_LE(open_files(), files);
  std::printf("%.0f KiB at first, %.0f KiB at last; in the second half %+.1f KiB a minute\n", resident.front(),
              resident.back(), slope(minutes, resident, resident.size() / 2));
}

}  // namespace
}  // namespace redag_rclcpp
