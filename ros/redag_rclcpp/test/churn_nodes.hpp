// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Nodes, groups and entities for the churn test. They come and go at random, from several threads and from callbacks.
#pragma once

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "rclcpp/rclcpp.hpp"
#include "redag/engine/preemption_point.hpp"
#include "redag_rclcpp/executor.hpp"
#include "test_msgs/msg/strings.hpp"
#include "test_msgs/srv/empty.hpp"

namespace redag_rclcpp::churn {

using namespace std::chrono_literals;
using std::chrono::steady_clock;
using test_msgs::msg::Strings;
using EmptyService = test_msgs::srv::Empty;
using Random = std::mt19937_64;

inline constexpr std::size_t kNodesOfAThread = 3;
inline constexpr std::size_t kEntitiesOfANode = 12;

inline std::uint64_t below(Random &random, std::uint64_t end) { return random() % end; }

inline void burn(std::chrono::microseconds time) {
  for (const auto end = steady_clock::now() + time; steady_clock::now() < end;) redag::preemption_point();
}

/// A node and its entities, which its own callbacks change as well.
struct Patch {
  rclcpp::Node::SharedPtr node;
  std::mutex lock;  // guards the members below
  Random random;
  std::vector<rclcpp::CallbackGroup::SharedPtr> groups;
  std::vector<rclcpp::TimerBase::SharedPtr> timers;
  std::vector<rclcpp::SubscriptionBase::SharedPtr> subscriptions;
  std::vector<rclcpp::Publisher<Strings>::SharedPtr> publishers;
  std::vector<rclcpp::ServiceBase::SharedPtr> services;
  std::vector<rclcpp::Client<EmptyService>::SharedPtr> clients;
};

struct Counts {
  std::atomic<std::uint64_t> operations{0};
  std::atomic<std::uint64_t> callbacks{0};
  std::atomic<std::uint64_t> thrown{0};
  std::atomic<std::uint64_t> silent{0};  // calls of callbacks that nothing should call
};

/// Makes random changes.
class Churn {
 public:
  explicit Churn(Counts &counts) : counts_(counts) {
    for (std::uint64_t i = 0; i < kTopics; ++i) {
      publishers_.push_back(here_->create_publisher<Strings>(topic(i), rclcpp::QoS(10)));
    }
  }

  std::shared_ptr<Patch> make_patch(std::uint64_t seed) {
    auto patch = std::make_shared<Patch>();
    patch->random.seed(seed);
    Random &random = patch->random;
    // Without parameter events: a node that receives them uses its time source. Humble destroys the time source under a
    // node that is dropped, with any executor.
    const auto options = rclcpp::NodeOptions()
                             .use_intra_process_comms(below(random, 2) == 0)
                             .start_parameter_services(below(random, 8) == 0)
                             .start_parameter_event_publisher(false);
    patch->node = std::make_shared<rclcpp::Node>("patch" + std::to_string(next_++), options);
    {
      const std::lock_guard guard(lock_);
      nodes_.push_back(patch->node);
    }
    add_silent(*patch);
    const std::lock_guard guard(patch->lock);
    for (int i = 0; i < 5; ++i) add(patch);
    return patch;
  }

  // The following functions need the patch's lock.

  void add(const std::shared_ptr<Patch> &patch) {
    const std::size_t entities =
        patch->timers.size() + patch->subscriptions.size() + patch->services.size() + patch->clients.size();
    if (entities >= kEntitiesOfANode) return;
    switch (below(patch->random, 6)) {
      case 0:
      case 1: return add_timer(patch);
      case 2: return add_subscription(patch);
      case 3: return add_publisher(*patch);
      case 4: return add_service(*patch);
      default: patch->clients.push_back(patch->node->create_client<EmptyService>("~/work"));
    }
  }

  void take_away(Patch &patch) {
    switch (below(patch.random, 6)) {
      case 0: return drop(patch, patch.timers);
      case 1: return drop(patch, patch.subscriptions);
      case 2: return drop(patch, patch.publishers);
      case 3: return drop(patch, patch.services);
      case 4: return drop(patch, patch.clients);
      default: drop(patch, patch.groups);
    }
  }

  void use(Patch &patch) {
    if (!patch.timers.empty()) {
      auto &timer = *patch.timers[below(patch.random, patch.timers.size())];
      below(patch.random, 2) == 0 ? timer.cancel() : timer.reset();
    }
    const auto &publishers = patch.publishers.empty() || below(patch.random, 2) == 0 ? publishers_ : patch.publishers;
    auto &publisher = *publishers[below(patch.random, publishers.size())];
    for (int i = 0; i < 3; ++i) publisher.publish(std::make_unique<Strings>());
    if (!patch.clients.empty()) {
      auto &client = *patch.clients[below(patch.random, patch.clients.size())];
      client.async_send_request(std::make_shared<EmptyService::Request>(),
                                [this](rclcpp::Client<EmptyService>::SharedFuture) { ++counts_.callbacks; });
    }
  }

  /// Number of nodes that still have an owner.
  [[nodiscard]] std::size_t living() {
    const std::lock_guard guard(lock_);
    return static_cast<std::size_t>(std::count_if(nodes_.begin(), nodes_.end(), [](auto &n) { return !n.expired(); }));
  }

 private:
  static constexpr std::uint64_t kTopics = 3;

  static std::string topic(std::uint64_t index) { return "/churn" + std::to_string(index); }
  static std::string topic(Patch &patch) { return topic(below(patch.random, kTopics)); }
  static rclcpp::QoS depth(Patch &patch) { return rclcpp::QoS(1 + below(patch.random, 10)); }

  template <class Entities>
  static void drop(Patch &patch, Entities &entities) {
    if (!entities.empty()) {
      entities.erase(entities.begin() + static_cast<std::ptrdiff_t>(below(patch.random, entities.size())));
    }
  }

  rclcpp::CallbackGroup::SharedPtr group(Patch &patch) {
    const std::uint64_t choice = below(patch.random, 4);
    if (choice == 0) return nullptr;
    if (choice == 1 || patch.groups.empty()) {
      patch.groups.push_back(patch.node->create_callback_group(below(patch.random, 2) == 0
                                                                   ? rclcpp::CallbackGroupType::MutuallyExclusive
                                                                   : rclcpp::CallbackGroupType::Reentrant));
    }
    return patch.groups[below(patch.random, patch.groups.size())];
  }

  void add_timer(const std::shared_ptr<Patch> &patch) {
    // One timer in eight computes for longer than its period. It is less urgent than the node that stays: two of them
    // take both workers, for as long as their nodes live.
    const bool overloads = below(patch->random, 8) == 0;
    const std::chrono::milliseconds period((overloads ? 5 : 2) + below(patch->random, 20));
    const std::chrono::microseconds longest = overloads ? period * 3 / 2 : 200us;
    std::weak_ptr<Patch> weak = patch;
    patch->timers.push_back(patch->node->create_wall_timer(
        period, [this, weak, longest] { run(weak, longest); }, group(*patch)));
  }

  void add_subscription(const std::shared_ptr<Patch> &patch) {
    rclcpp::SubscriptionOptions options;
    options.callback_group = group(*patch);
    patch->subscriptions.push_back(patch->node->create_subscription<Strings>(
        topic(*patch), depth(*patch),
        [this, weak = std::weak_ptr<Patch>(patch)](Strings::ConstSharedPtr) { run(weak, 100us); }, options));
  }

  // Publishers of a patch do not use intra-process communication. rclcpp, up to Rolling at least, deadlocks when such a
  // publisher is destroyed while a subscription gets a message from elsewhere.
  // IntraProcessManager::matches_any_publishers then holds the last reference, and the publisher's destructor wants the
  // lock that is held there. The publishers within the process, publishers_, are never destroyed.
  void add_publisher(Patch &patch) {
    rclcpp::PublisherOptions options;
    options.use_intra_process_comm = rclcpp::IntraProcessSetting::Disable;
    patch.publishers.push_back(patch.node->create_publisher<Strings>(topic(patch), depth(patch), options));
  }

  void add_service(Patch &patch) {
    patch.services.push_back(patch.node->create_service<EmptyService>(
        "~/work",
        [this](EmptyService::Request::SharedPtr, EmptyService::Response::SharedPtr) { ++counts_.callbacks; }));
  }

  /// Adds callbacks that nothing ever calls. If arrivals of a former task with the same id reached them, they would
  /// run.
  void add_silent(Patch &patch) {
    patch.services.push_back(patch.node->create_service<EmptyService>(
        "~/silent", [this](EmptyService::Request::SharedPtr, EmptyService::Response::SharedPtr) { ++counts_.silent; }));
    patch.timers.push_back(patch.node->create_wall_timer(1h, [this] { ++counts_.silent; }));
    patch.subscriptions.push_back(patch.node->create_subscription<Strings>(
        "/silent", rclcpp::QoS(1), [this](Strings::ConstSharedPtr) { ++counts_.silent; }));
  }

  void run(const std::weak_ptr<Patch> &weak, std::chrono::microseconds longest) {
    ++counts_.callbacks;
    const auto patch = weak.lock();  // perhaps the last owner of the node
    if (!patch) return;
    burn(longest);
    const std::unique_lock guard(patch->lock, std::try_to_lock);
    if (!guard) return;
    switch (below(patch->random, 64)) {
      case 0: return add(patch);
      case 1: return take_away(*patch);
      case 2: ++counts_.thrown; throw std::runtime_error("as callbacks do");
      default: use(*patch);
    }
  }

  Counts &counts_;
  const rclcpp::Node::SharedPtr here_ = std::make_shared<rclcpp::Node>(
      "here", rclcpp::NodeOptions().use_intra_process_comms(true).start_parameter_services(false));
  std::vector<rclcpp::Publisher<Strings>::SharedPtr> publishers_;
  std::atomic<std::uint64_t> next_{0};
  std::mutex lock_;
  std::vector<std::weak_ptr<rclcpp::Node>> nodes_;
};

/// A thread that changes the executor's nodes until it is stopped, and then drops all of them.
class Gardener {
 public:
  Gardener(ReDAGExecutor &executor, Churn &churn, Counts &counts, std::uint64_t seed)
      : executor_(executor), churn_(churn), counts_(counts), random_(seed), thread_([this] { work(); }) {}
  ~Gardener() {
    stop_ = true;
    thread_.join();
  }

 private:
  struct Bed {
    std::shared_ptr<Patch> patch;
    std::vector<rclcpp::CallbackGroup::SharedPtr> manual;  // groups that were added without their node
  };

  void work() {
    while (!stop_) {
      step();
      ++counts_.operations;
      std::this_thread::sleep_for(std::chrono::microseconds(below(random_, 500)));
    }
    while (!beds_.empty()) dig_up();
  }

  void step() {
    const std::uint64_t choice = below(random_, 32);
    if (beds_.empty() || (choice < 2 && beds_.size() < kNodesOfAThread)) return plant();
    if (choice < 4) return dig_up();
    Bed &bed = beds_[below(random_, beds_.size())];
    if (choice < 5) {
      executor_.remove_node(bed.patch->node);
      executor_.add_node(bed.patch->node);
      return;
    }
    if (choice < 7) return change_manual(bed);
    if (choice < 8) return look();
    const std::lock_guard guard(bed.patch->lock);
    if (choice < 16) return churn_.add(bed.patch);
    if (choice < 22) return churn_.take_away(*bed.patch);
    churn_.use(*bed.patch);
  }

  void plant() {
    beds_.push_back(Bed{churn_.make_patch(random_()), {}});
    executor_.add_node(beds_.back().patch->node);
  }

  void dig_up() {
    const std::size_t position = below(random_, beds_.size());
    const Bed bed = beds_[position];
    beds_.erase(beds_.begin() + static_cast<std::ptrdiff_t>(position));
    // Otherwise the node is dropped without being removed.
    if (below(random_, 2) == 0) executor_.remove_node(bed.patch->node);
  }

  void change_manual(Bed &bed) {
    if (!bed.manual.empty()) {
      const auto group = bed.manual.back();
      bed.manual.pop_back();
      if (below(random_, 2) == 0) executor_.remove_callback_group(group);
      return;
    }
    const auto group = bed.patch->node->create_callback_group(rclcpp::CallbackGroupType::MutuallyExclusive, false);
    bed.manual.push_back(group);
    const std::lock_guard guard(bed.patch->lock);
    bed.patch->timers.push_back(bed.patch->node->create_wall_timer(
        3ms, [counts = &counts_] { ++counts->callbacks; }, group));
    executor_.add_callback_group(group, bed.patch->node->get_node_base_interface());
  }

  void look() {
    for (const CallbackStats &stats : executor_.stats()) {
      EXPECT_LE(stats.jobs.finished + stats.jobs.skipped + stats.jobs.aborted, stats.jobs.released) << stats.task;
      EXPECT_FALSE(stats.id.node.empty()) << stats.task;
    }
    (void)executor_.learned();
    (void)executor_.warnings();
  }

  ReDAGExecutor &executor_;
  Churn &churn_;
  Counts &counts_;
  Random random_;
  std::vector<Bed> beds_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace redag_rclcpp::churn
