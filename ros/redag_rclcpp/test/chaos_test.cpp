// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Chaos: callbacks throw, block, overrun, spin their own executor, destroy the objects they belong to, cancel, and let
// ROS time jump, while nodes come and go. Nothing may crash or hang. Every exception must be reported, exclusive groups
// must not overlap, and afterwards the executor must serve a new node. REDAG_SEED is the seed of the first episode,
// REDAG_CHAOS_EPISODES the number of episodes for each mode.
#include <gtest/gtest.h>

#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <mutex>
#include <string>
#include <thread>

#include "chaos_nodes.hpp"
#include "environment.hpp"
#include "spinning.hpp"

namespace redag_rclcpp::chaos {
namespace {

using namespace std::chrono_literals;
using redag::PreemptionMode;
using std::chrono::steady_clock;

/// Ends the process with a message unless it is destroyed in time. A hanging test has no other end.
class Watchdog {
 public:
  explicit Watchdog(std::string what)
      : thread_([this, what = std::move(what)] {
          std::unique_lock guard(lock_);
          if (over_.wait_for(guard, 3 * kLimit, [this] { return done_; })) return;
          std::fprintf(stderr, "it hangs: %s\n", what.c_str());
          std::abort();
        }) {}
  ~Watchdog() {
    {
      const std::lock_guard guard(lock_);
      done_ = true;
    }
    over_.notify_one();
    thread_.join();
  }
  Watchdog(const Watchdog &) = delete;
  Watchdog &operator=(const Watchdog &) = delete;

 private:
  std::mutex lock_;
  std::condition_variable over_;
  bool done_ = false;
  std::thread thread_;
};

constexpr auto kLongestStorm = 2s;

/// How the executor reports exceptions of callbacks.
enum class Told { ToAHandlerThatContinues, ToAHandlerThatStops, BySpinning };

/// A thread that spins again whenever a spin has ended.
class Driving {
 public:
  Driving(ReDAGExecutor &executor, std::uint64_t seed) : executor_(executor), thread_([this, seed] { work(seed); }) {}
  ~Driving() { stop(); }

  void stop() {
    stop_ = true;
    // Repeats cancel(), because a call between two spins is lost.
    while (!ended_) {
      executor_.cancel();
      std::this_thread::sleep_for(1ms);
    }
    if (thread_.joinable()) thread_.join();
  }
  [[nodiscard]] std::uint64_t rethrown() const { return rethrown_; }

 private:
  void work(std::uint64_t seed) {
    Rng dice(seed);
    while (!stop_) {
      try {
        switch (dice.uniform(0, 9)) {
          case 0: executor_.spin_some(); break;
          case 1: executor_.spin_all(1ms); break;
          case 2: executor_.spin_once(1ms); break;
          default: executor_.spin();
        }
      } catch (...) {
        ++rethrown_;
      }
    }
    ended_ = true;
  }

  ReDAGExecutor &executor_;
  std::atomic<bool> stop_{false};
  std::atomic<bool> ended_{false};
  std::atomic<std::uint64_t> rethrown_{0};
  std::thread thread_;
};

class Episode {
 public:
  Episode(PreemptionMode mode, std::uint64_t seed) : seed_(seed), rng_(seed) {
    told_ = static_cast<Told>(rng_.uniform(0, 2));
    ReDAGOptions options;
    options.preemption = mode;
    options.workers = static_cast<std::uint32_t>(rng_.uniform(1, 3));
    options.threads = options.workers + static_cast<std::uint32_t>(rng_.uniform(0, 4));
    if (rng_.uniform01() < 0.3) options.learn = 10ms;
    if (told_ != Told::BySpinning) {
      options.on_exception = [this](const ExceptionInfo &) {
        ++handled_;
        return told_ == Told::ToAHandlerThatContinues ? OnException::Continue : OnException::Stop;
      };
    }
    executor_ = std::make_unique<ReDAGExecutor>(options);
    nodes_ = std::make_unique<Troublemakers>(*executor_, record_, seed, 0.5 * rng_.uniform01());
  }

  void go(std::map<std::string, std::uint64_t> &survived) {
    for (auto nodes = rng_.uniform(1, 3); nodes > 0; --nodes) nodes_->add_node();
    Driving driving(*executor_, seed_ + 1);
    storm();
    if (rng_.uniform01() < 0.5) nodes_->clear();  // otherwise the old nodes stay beside the new one
    EXPECT_TRUE(serves_a_new_node()) << "after the storm";
    nodes_->clear();
    driving.stop();
    judge(driving.rethrown());
    executor_.reset();
    survived["episodes"] += 1;
    survived["exceptions told"] += told_ == Told::BySpinning ? driving.rethrown() : handled_.load();
    survived["nodes"] += nodes_->nodes_made();
    for (std::size_t i = 0; i < kFaults; ++i) survived[kFaultNames[i]] += record_.faults[i];
  }

 private:
  void storm() {
    const auto calls = static_cast<std::uint64_t>(rng_.uniform(20, 300));
    // Nodes may have gone: the remaining callbacks can be too few to reach `calls`.
    const auto end = steady_clock::now() + kLongestStorm;
    while (nodes_->calls() < calls && steady_clock::now() < end) {
      switch (rng_.uniform(0, 9)) {
        case 0: nodes_->add_node(); break;
        case 1: nodes_->remove_one(rng_); break;
        case 2: executor_->cancel(); break;
        case 3: (void)executor_->stats(); break;
        case 4:
        case 5: nodes_->move_time(rng_); break;
        default: std::this_thread::sleep_for(nanoseconds(rng_.uniform(1, 2 * redag::kMillisecond)));
      }
    }
  }

  bool serves_a_new_node() {
    const auto node = std::make_shared<rclcpp::Node>("fresh", Troublemakers::node_options());
    const auto publisher = node->create_publisher<Strings>("/fresh", rclcpp::QoS(10));
    std::atomic<int> received{0};
    std::atomic<int> ticks{0};
    const auto subscription =
        node->create_subscription<Strings>("/fresh", rclcpp::QoS(10), [&](Strings::ConstSharedPtr) { ++received; });
    const auto timer = node->create_wall_timer(2ms, [&] {
      ++ticks;
      publisher->publish(Strings());
    });
    executor_->add_node(node);
    const bool served = eventually([&] { return ticks >= 3 && received >= 3; });
    timer->cancel();
    executor_->remove_node(node);
    // The counters are destroyed on return: waits until no callback of this node can run any more.
    EXPECT_TRUE(eventually([&] { return timer.use_count() == 1 && subscription.use_count() == 1; }));
    return served;
  }

  void judge(std::uint64_t rethrown) {
    EXPECT_EQ(record_.overlaps, 0U) << "exclusive groups overlapped";
    EXPECT_EQ(record_.spun_in_a_callback, 0U) << "spinning in a callback was not refused";
    switch (told_) {
      case Told::ToAHandlerThatContinues:
        EXPECT_EQ(handled_, record_.thrown);
        EXPECT_EQ(rethrown, 0U);
        break;
      case Told::ToAHandlerThatStops: EXPECT_EQ(handled_, record_.thrown); [[fallthrough]];
      case Told::BySpinning:  // a spin throws the first exception only
        EXPECT_LE(rethrown, record_.thrown);
        EXPECT_EQ(rethrown == 0, record_.thrown == 0);
    }
  }

  std::uint64_t seed_;
  Rng rng_;
  Told told_ = Told::BySpinning;
  Record record_;
  std::atomic<std::uint64_t> handled_{0};
  std::unique_ptr<ReDAGExecutor> executor_;
  std::unique_ptr<Troublemakers> nodes_;  // declared after the executor: its callbacks are destroyed first
};

class ChaosTest : public ::testing::TestWithParam<PreemptionMode> {
 protected:
  void SetUp() override {
    if (GetParam() == PreemptionMode::Os && redag::runtime::probe_priority_band().top_job == 0) {
      GTEST_SKIP() << "SCHED_FIFO is not to be had here";
    }
    rclcpp::init(0, nullptr);
  }
  void TearDown() override {
    if (rclcpp::ok()) rclcpp::shutdown();
  }
};

TEST_P(ChaosTest, NothingBreaksAndItGoesOn) {
  const std::uint64_t first = from_environment("REDAG_SEED", 1);
  const std::uint64_t episodes = from_environment("REDAG_CHAOS_EPISODES", 5);
  std::map<std::string, std::uint64_t> survived;
  // The middleware's participant goes with its last node: another one for each episode would take most of the time.
  const rclcpp::Node stays("stays", Troublemakers::node_options());
  for (std::uint64_t seed = first; seed < first + episodes && !HasFailure(); ++seed) {
    const std::string what = std::string(to_string(GetParam())) + ", REDAG_SEED=" + std::to_string(seed);
    SCOPED_TRACE(what);
    const Watchdog watchdog(what);
    Episode(GetParam(), seed).go(survived);
  }
  for (const auto &[what, count] : survived) std::printf("%lu %s\n", count, what.c_str());
}

INSTANTIATE_TEST_SUITE_P(Modes, ChaosTest,
                         ::testing::Values(PreemptionMode::None, PreemptionMode::Cooperative, PreemptionMode::Os),
                         [](const auto &test) { return std::string(to_string(test.param)); });

}  // namespace
}  // namespace redag_rclcpp::chaos
