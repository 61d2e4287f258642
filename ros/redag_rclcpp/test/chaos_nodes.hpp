// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Nodes for the chaos test. Their callbacks misbehave at random, from a seed.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <future>
#include <memory>
#include <mutex>
#include <new>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "rclcpp/rclcpp.hpp"
#include "redag/base/lock_guard.hpp"
#include "redag/base/pi_mutex.hpp"
#include "redag/derived/rng.hpp"
#include "redag/engine/preemption_point.hpp"
#include "redag_rclcpp/executor.hpp"
#include "rosgraph_msgs/msg/clock.hpp"
#include "test_msgs/msg/strings.hpp"
#include "test_msgs/srv/empty.hpp"

namespace redag_rclcpp::chaos {

using EmptyService = test_msgs::srv::Empty;
using redag::Duration;
using redag::Rng;
using rosgraph_msgs::msg::Clock;
using std::chrono::nanoseconds;
using test_msgs::msg::Strings;

inline constexpr Duration kWcet = 30 * redag::kMicrosecond;

enum class Fault : std::uint8_t {
  None,
  Throws,
  ThrowsNoException,
  RunsOutOfMemory,
  Sleeps,
  Overruns,
  Locks,
  WaitsForAnAnswer,
  Recurses,
  Asks,
  Floods,
  StopsItsTimer,
  LosesItsTimer,
  LosesItsSubscription,
  LosesItsNode,
  LeavesTheExecutor,
  AddsAnEntity,
  AddsANode,
  MovesTime,
  Cancels,
};
inline constexpr std::array kFaultNames = {"callbacks without a fault",
                                           "callbacks that throw",
                                           "callbacks that throw what is no exception",
                                           "callbacks that throw bad_alloc",
                                           "callbacks that sleep",
                                           "callbacks that run 100 times their wcet",
                                           "callbacks that share a lock",
                                           "callbacks that wait for a service's answer",
                                           "callbacks that spin their own executor",
                                           "callbacks that ask the executor",
                                           "callbacks that publish bursts",
                                           "callbacks that cancel or reset a timer",
                                           "callbacks that destroy a timer of their node",
                                           "callbacks that destroy a subscription of their node",
                                           "callbacks that destroy their node",
                                           "callbacks that take their node from the executor",
                                           "callbacks that add a timer or subscription, in a group of its own or not",
                                           "callbacks that add a node",
                                           "callbacks that let ROS time jump",
                                           "callbacks that cancel"};
inline constexpr std::size_t kFaults = kFaultNames.size();

/// Counts of an episode, on which it is judged.
struct Record {
  std::array<std::atomic<std::uint64_t>, kFaults> faults{};
  std::atomic<std::uint64_t> thrown{0};
  std::atomic<std::uint64_t> overlaps{0};            // overlapping callbacks of one exclusive group
  std::atomic<std::uint64_t> spun_in_a_callback{0};  // spins in a callback that were not refused
};

/// A node and its entities, which its own callbacks change as well. Callbacks hold it while they run: the node may be
/// destroyed within one of them.
struct Troublemaker {
  struct Group {
    rclcpp::CallbackGroup::SharedPtr group;
    bool exclusive = true;
    std::shared_ptr<std::atomic<int>> inside = std::make_shared<std::atomic<int>>(0);
  };
  rclcpp::Node::SharedPtr node;
  std::mutex lock;  // guards the members below
  std::vector<Group> groups;
  std::vector<rclcpp::TimerBase::SharedPtr> timers;
  std::vector<rclcpp::SubscriptionBase::SharedPtr> subscriptions;
  std::vector<rclcpp::Publisher<Strings>::SharedPtr> publishers;
  rclcpp::ServiceBase::SharedPtr service;
  rclcpp::Client<EmptyService>::SharedPtr client;
};

/// The nodes of one episode. Any thread may call it.
class Troublemakers {
 public:
  Troublemakers(ReDAGExecutor &executor, Record &record, std::uint64_t seed, double fault_rate)
      : executor_(executor), record_(record), seed_(seed), fault_rate_(fault_rate) {
    clock_publisher_ = here_->create_publisher<Clock>("/clock", rclcpp::ClockQoS());
  }

  /// Creates a node and adds it to the executor.
  void add_node() {
    const std::uint64_t number = next_node_.fetch_add(1);
    if (number >= kMostNodes) return;
    Rng dice = Rng::stream(seed_, kNodeStream, number);
    auto made = std::make_shared<Troublemaker>();
    auto options = node_options().use_clock_thread(dice.uniform01() < 0.5);
    const bool simulated_time = dice.uniform01() < 0.5;
    if (simulated_time) options.parameter_overrides({{"use_sim_time", true}});
    made->node = std::make_shared<rclcpp::Node>("trouble" + std::to_string(number), options);
    if (simulated_time && !options.use_clock_thread()) {
      const std::lock_guard guard(lock_);
      hear_clock_.push_back(made->node);
    }
    {
      const std::lock_guard guard(made->lock);
      made->publishers.push_back(made->node->create_publisher<Strings>(topic(dice), rclcpp::QoS(10)));
      made->service = made->node->create_service<EmptyService>(
          "~/work", [](EmptyService::Request::SharedPtr, EmptyService::Response::SharedPtr) {});
      made->client = made->node->create_client<EmptyService>("~/work");
      for (auto entities = dice.uniform(2, 5); entities > 0; --entities) add_entity(made, dice);
    }
    {
      const std::lock_guard guard(lock_);
      nodes_.push_back(made);
    }
    executor_.add_node(made->node);
  }

  /// Drops a node, with or without removing it from the executor first.
  void remove_one(Rng &dice) {
    std::shared_ptr<Troublemaker> gone;
    {
      const std::lock_guard guard(lock_);
      if (nodes_.empty()) return;
      const auto position = dice.uniform(0, std::ssize(nodes_) - 1);
      gone = nodes_[static_cast<std::size_t>(position)];
      nodes_.erase(nodes_.begin() + position);
    }
    if (dice.uniform01() < 0.5) leave(*gone);
  }

  /// Publishes a time on /clock: within an hour of the start, before the last published time or after it.
  void move_time(Rng &dice) {
    Clock message;
    const Duration time = kClockStart + dice.uniform(0, 3600) * redag::kSecond + dice.uniform(0, redag::kSecond - 1);
    message.clock.sec = static_cast<std::int32_t>(time / redag::kSecond);
    message.clock.nanosec = static_cast<std::uint32_t>(time % redag::kSecond);
    clock_publisher_->publish(message);
  }

  void clear() {
    std::vector<std::shared_ptr<Troublemaker>> gone;
    const std::lock_guard guard(lock_);
    gone.swap(nodes_);
  }

  [[nodiscard]] std::uint64_t calls() const { return next_call_; }
  [[nodiscard]] std::size_t nodes_made() const { return std::min<std::size_t>(next_node_, kMostNodes); }

  /// Few entities per node, to allow many nodes.
  static rclcpp::NodeOptions node_options() {
    return rclcpp::NodeOptions().enable_rosout(false).start_parameter_services(false).start_parameter_event_publisher(
        false);
  }

 private:
  static constexpr std::uint64_t kMostNodes = 16;
  static constexpr std::size_t kMostEntities = 8;
  static constexpr std::uint64_t kNodeStream = 1;
  static constexpr std::uint64_t kCallStream = 2;
  static constexpr Duration kClockStart = 1'000'000 * redag::kSecond;

  static std::string topic(Rng &dice) { return "/trouble" + std::to_string(dice.uniform(0, 2)); }

  // The caller holds the lock of `of`.
  Troublemaker::Group group(Troublemaker &of, Rng &dice) {
    if (of.groups.empty() || (of.groups.size() < 3 && dice.uniform01() < 0.4)) {
      Troublemaker::Group made;
      made.exclusive = dice.uniform01() < 0.7;
      made.group = of.node->create_callback_group(made.exclusive ? rclcpp::CallbackGroupType::MutuallyExclusive
                                                                 : rclcpp::CallbackGroupType::Reentrant);
      of.groups.push_back(made);
    }
    return of.groups[static_cast<std::size_t>(dice.uniform(0, std::ssize(of.groups) - 1))];
  }

  // The caller holds the lock of `to`.
  void add_entity(const std::shared_ptr<Troublemaker> &to, Rng &dice) {
    if (to->timers.size() + to->subscriptions.size() >= kMostEntities) return;
    const Troublemaker::Group in = group(*to, dice);
    const auto call = [this, weak = std::weak_ptr(to), exclusive = in.exclusive, inside = in.inside] {
      const auto self = weak.lock();  // perhaps the last owner of the node
      if (self) enter(self, exclusive, *inside);
    };
    const nanoseconds period(dice.uniform(1, 8) * redag::kMillisecond);
    switch (dice.uniform(0, 3)) {
      case 0:
      case 1: to->timers.push_back(to->node->create_wall_timer(period, call, in.group)); break;
      case 2:
        // A lambda of its own: rclcpp would keep a reference to a variable.
        to->timers.push_back(rclcpp::create_timer(
            to->node, to->node->get_clock(), rclcpp::Duration(period), [call] { call(); }, in.group));
        break;
      default: {
        rclcpp::SubscriptionOptions options;
        options.callback_group = in.group;
        to->subscriptions.push_back(to->node->create_subscription<Strings>(
            topic(dice), rclcpp::QoS(static_cast<std::size_t>(dice.uniform(1, 10))),
            [call](Strings::ConstSharedPtr) { call(); }, options));
      }
    }
  }

  void enter(const std::shared_ptr<Troublemaker> &self, bool exclusive, std::atomic<int> &inside) {
    struct Inside {
      explicit Inside(std::atomic<int> &of) : count(of), before(of.fetch_add(1)) {}
      ~Inside() { count.fetch_sub(1); }
      std::atomic<int> &count;
      int before;
    } const entered(inside);
    if (exclusive && entered.before != 0) ++record_.overlaps;
    misbehave(self);
  }

  void misbehave(const std::shared_ptr<Troublemaker> &self) {
    Rng dice = Rng::stream(seed_, kCallStream, next_call_.fetch_add(1));
    const Fault fault = dice.uniform01() < fault_rate_
                            ? static_cast<Fault>(dice.uniform(1, static_cast<std::int64_t>(kFaults) - 1))
                            : Fault::None;
    ++record_.faults[static_cast<std::size_t>(fault)];
    switch (fault) {
      case Fault::None: burn(dice.uniform(0, kWcet), true); break;
      case Fault::Throws: ++record_.thrown; throw std::runtime_error("a fault");
      case Fault::ThrowsNoException: ++record_.thrown; throw 7;
      case Fault::RunsOutOfMemory: ++record_.thrown; throw std::bad_alloc();
      case Fault::Sleeps: std::this_thread::sleep_for(nanoseconds(dice.uniform(1, redag::kMillisecond))); break;
      case Fault::Overruns: burn(100 * kWcet, dice.uniform01() < 0.5); break;
      case Fault::Locks: {
        const redag::LockGuard guard(shared_);  // a preempted callback may hold it
        burn(kWcet, false);
        break;
      }
      case Fault::Recurses: recurse(dice); break;
      case Fault::Asks:
        (void)executor_.stats();
        (void)executor_.learned();
        (void)executor_.warnings();
        break;
      case Fault::AddsANode: add_node(); break;
      case Fault::MovesTime: move_time(dice); break;
      case Fault::Cancels: executor_.cancel(); break;
      case Fault::LeavesTheExecutor: leave(*self); break;
      case Fault::LosesItsNode: {
        const std::lock_guard guard(lock_);
        std::erase(nodes_, self);
        break;
      }
      default: change(self, fault, dice);
    }
  }

  // Executes the faults that need the node's lock. A callback only tries to lock: on top of the lock's holder
  // (cooperative) it would wait for ever.
  void change(const std::shared_ptr<Troublemaker> &self, Fault fault, Rng &dice) {
    std::future<EmptyService::Response::SharedPtr> answer;
    // Declared before the guard: destroyed without the lock, which the destruction may need.
    std::vector<std::shared_ptr<void>> gone;
    {
      const std::unique_lock guard(self->lock, std::try_to_lock);
      if (!guard) return;
      switch (fault) {
        case Fault::Floods:
          for (int i = 0; i < 20; ++i) self->publishers.front()->publish(Strings());
          break;
        case Fault::WaitsForAnAnswer:
          answer = self->client->async_send_request(std::make_shared<EmptyService::Request>()).future;
          break;
        case Fault::StopsItsTimer:
          for (const auto &timer : self->timers) dice.uniform01() < 0.5 ? timer->cancel() : timer->reset();
          break;
        case Fault::LosesItsTimer: lose_last(self->timers, gone); break;
        case Fault::LosesItsSubscription: lose_last(self->subscriptions, gone); break;
        case Fault::AddsAnEntity: add_entity(self, dice); break;
        default: break;
      }
    }
    if (answer.valid()) (void)answer.wait_for(std::chrono::milliseconds(1));
  }

  template <class Entities>
  static void lose_last(Entities &entities, std::vector<std::shared_ptr<void>> &gone) {
    if (entities.empty()) return;
    gone.push_back(std::move(entities.back()));
    entities.pop_back();
  }

  void recurse(Rng &dice) {
    try {
      switch (dice.uniform(0, 3)) {
        case 0: executor_.spin(); break;
        case 1: executor_.spin_some(); break;
        case 2: executor_.spin_all(nanoseconds(1)); break;
        default: executor_.spin_once(nanoseconds(1));
      }
      ++record_.spun_in_a_callback;
    } catch (const std::runtime_error &) {
    }
  }

  // Removes the node from the executor. The executor throws if the node was removed before.
  void leave(Troublemaker &node) {
    try {
      executor_.remove_node(node.node);
    } catch (const std::runtime_error &) {
    }
  }

  static void burn(Duration processor_time, bool with_points) {
    for (const Duration until = redag::job_cpu_time() + processor_time; redag::job_cpu_time() < until;) {
      if (with_points) redag::preemption_point();
    }
  }

  ReDAGExecutor &executor_;
  Record &record_;
  std::uint64_t seed_;
  double fault_rate_;
  const rclcpp::Node::SharedPtr here_ = std::make_shared<rclcpp::Node>("here", node_options());
  rclcpp::Publisher<Clock>::SharedPtr clock_publisher_;
  std::atomic<std::uint64_t> next_node_{0};
  std::atomic<std::uint64_t> next_call_{0};
  redag::PiMutex shared_;
  std::mutex lock_;
  std::vector<std::shared_ptr<Troublemaker>> nodes_;
  // These nodes live until the executor is gone. Their /clock callback runs in the executor and uses members of the
  // node, because rclcpp's TimeSource captures a plain pointer. It would do so even if the node were destroyed
  // meanwhile.
  std::vector<rclcpp::Node::SharedPtr> hear_clock_;
};

}  // namespace redag_rclcpp::chaos
