// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A callback with one message of each of several topics, for any executor:
//
//   fusion_ = redag_rclcpp::join<Image, PointCloud2>(
//       *this, {"camera", "lidar"}, rclcpp::SensorDataQoS(),
//       [](Image::ConstSharedPtr image, PointCloud2::ConstSharedPtr cloud) { ... });
//
// join() calls it when each topic has a message that it has not had yet, with the newest of each. join_exact() calls it
// for each set of messages whose header stamps are equal. Older messages are dropped. For ReDAGExecutor it is one
// callback, a waitable of its node. With `after: [camera, lidar]` in a workload file, its job also waits until these
// callbacks have completed. (message_filters call within the subscription whose message comes last.)
//
// Threads: the executor calls the function, never twice at once in a mutually exclusive group. Messages come through
// the middleware, also within a process. Keep what join() returns: its destruction ends the calls.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "rclcpp/rclcpp.hpp"
#include "redag/base/mutex.hpp"
#include "redag/base/pi_mutex.hpp"
#include "redag/base/thread_annotations.hpp"
#include "redag_rclcpp/any_waitable.hpp"

namespace redag_rclcpp {

/// The part of a join that does not depend on the types of its messages.
class JoinBase : public AnyWaitable {
 public:
  JoinBase(const JoinBase &) = delete;
  JoinBase &operator=(const JoinBase &) = delete;

  [[nodiscard]] std::size_t get_number_of_ready_subscriptions() override { return inputs_.size(); }
  void set_on_ready_callback(std::function<void(std::size_t, int)> callback) override;
  void clear_on_ready_callback() override;
  void fill(rcl_wait_set_t &set) override;
  bool is_ready_in(const rcl_wait_set_t & /*set*/) override { return take(); }
  void run(const std::shared_ptr<void> & /*data*/) override;

 protected:
  JoinBase() = default;
  ~JoinBase() override = default;
  void add_input(const rclcpp::SubscriptionBase::SharedPtr &subscription) { inputs_.push_back({subscription}); }

 private:
  struct Input {
    rclcpp::SubscriptionBase::SharedPtr subscription;
    bool arrived = false;  // a message may have come since the last take()
    bool kept = false;     // has a message that was taken and not used; by the last take()
  };

  // The derived class keeps the messages. All are called under lock_.

  /// Takes all messages from the subscription.
  virtual void take_from(std::size_t input) = 0;
  [[nodiscard]] virtual bool keeps_message_of(std::size_t input) const = 0;
  [[nodiscard]] virtual bool has_set() const = 0;
  /// Removes a set, and returns the call of the user's function with it. Requires has_set().
  [[nodiscard]] virtual std::function<void()> use_set() = 0;

  [[nodiscard]] bool take();
  void arrived(std::size_t input);
  void tell_if_complete() REDAG_REQUIRES(hook_lock_);
  void note_kept() REDAG_REQUIRES(hook_lock_);

  redag::Mutex lock_;  // of the messages
  std::vector<Input> inputs_;
  // Guards `arrived`, `kept` and what follows. Taken after lock_, and by the middleware's threads.
  redag::PiMutex hook_lock_;
  bool told_ = false;  // on_ready_ was called, and take() has not begun since
  std::function<void(std::size_t, int)> on_ready_;
};

namespace detail {

template <class Message>
std::int64_t stamp_of(const Message &message) {
  return std::int64_t{message.header.stamp.sec} * 1'000'000'000 + message.header.stamp.nanosec;
}

template <bool kExact, class... Messages>
class Join final : public JoinBase {
 public:
  using Function = std::function<void(std::shared_ptr<const Messages>...)>;
  using Topics = std::array<std::string, sizeof...(Messages)>;

  Join(rclcpp::Node &node, const Topics &topics, const rclcpp::QoS &qos, Function function)
      : function_(std::move(function)), most_(kExact ? messages_of(qos) : 1) {
    // No executor serves these subscriptions: the join takes their messages itself.
    rclcpp::SubscriptionOptions options;
    options.callback_group = group_ = node.create_callback_group(rclcpp::CallbackGroupType::MutuallyExclusive, false);
    options.use_intra_process_comm = rclcpp::IntraProcessSetting::Disable;
    const auto subscribe = [&]<class Message>(Kept<Message> &kept, const std::string &topic) {
      kept.subscription = node.create_subscription<Message>(
          topic, qos, [](std::shared_ptr<const Message>) {}, options);
      add_input(kept.subscription);
    };
    for_each_index([&]<std::size_t... kIndex>(std::index_sequence<kIndex...>) {
      (subscribe(std::get<kIndex>(kept_), topics[kIndex]), ...);
    });
  }
  ~Join() override { clear_on_ready_callback(); }

 private:
  template <class Message>
  struct Kept {
    typename rclcpp::Subscription<Message>::SharedPtr subscription;
    std::deque<std::shared_ptr<const Message>> messages;

    // Position of the message with this stamp.
    [[nodiscard]] std::optional<std::size_t> find(std::int64_t stamp) const {
      const auto found = std::find_if(messages.begin(), messages.end(),
                                      [&](const auto &message) { return stamp_of(*message) == stamp; });
      if (found == messages.end()) return std::nullopt;
      return static_cast<std::size_t>(found - messages.begin());
    }
    // Removes the message at `position`, and all before it.
    std::shared_ptr<const Message> use(std::size_t position) {
      const auto end = messages.begin() + static_cast<std::ptrdiff_t>(position);
      std::shared_ptr<const Message> message = *end;
      messages.erase(messages.begin(), end + 1);
      return message;
    }
  };

  // A topic that has gone silent must not fill the memory with messages of the others.
  static std::size_t messages_of(const rclcpp::QoS &qos) {
    constexpr std::size_t kMost = 1000;
    return qos.history() == rclcpp::HistoryPolicy::KeepLast ? std::max<std::size_t>(qos.depth(), 1) : kMost;
  }

  template <class Call>
  static decltype(auto) for_each_index(Call call) {
    return call(std::index_sequence_for<Messages...>());
  }

  void take_from(std::size_t input) override {
    std::size_t at = 0;
    const auto take = [&]<class Message>(Kept<Message> &kept) {
      if (at++ != input) return;
      rclcpp::MessageInfo info;
      for (;;) {
        auto message = std::make_shared<Message>();
        if (!kept.subscription->take(*message, info)) break;
        kept.messages.push_back(std::move(message));
        if (kept.messages.size() > most_) kept.messages.pop_front();
      }
    };
    std::apply([&](auto &...kept) { (take(kept), ...); }, kept_);
  }

  [[nodiscard]] bool keeps_message_of(std::size_t input) const override {
    return std::apply([&](const auto &...kept) { return !std::array{kept.messages.empty()...}[input]; }, kept_);
  }

  // The positions of the messages of the oldest set.
  [[nodiscard]] std::optional<std::array<std::size_t, sizeof...(Messages)>> first_set() const {
    const auto has_all = [](const auto &...kept) { return (!kept.messages.empty() && ...); };
    if (!std::apply(has_all, kept_)) return std::nullopt;
    if constexpr (!kExact) {
      return std::array<std::size_t, sizeof...(Messages)>{};  // one of each is kept
    } else {
      for (const auto &message : std::get<0>(kept_).messages) {
        const std::int64_t stamp = stamp_of(*message);
        const auto positions = std::apply([&](const auto &...kept) { return std::array{kept.find(stamp)...}; }, kept_);
        if (std::find(positions.begin(), positions.end(), std::nullopt) != positions.end()) continue;
        std::array<std::size_t, sizeof...(Messages)> set{};
        std::transform(positions.begin(), positions.end(), set.begin(), [](const auto &position) { return *position; });
        return set;
      }
      return std::nullopt;
    }
  }

  [[nodiscard]] bool has_set() const override { return first_set().has_value(); }

  [[nodiscard]] std::function<void()> use_set() override {
    return for_each_index([&]<std::size_t... kIndex>(std::index_sequence<kIndex...>)->std::function<void()> {
      const auto set = *first_set();
      auto messages = std::make_tuple(std::get<kIndex>(kept_).use(set[kIndex])...);
      return [this, messages = std::move(messages)] { std::apply(function_, messages); };
    });
  }

  const Function function_;
  const std::size_t most_;  // messages that are kept of each topic
  rclcpp::CallbackGroup::SharedPtr group_;
  std::tuple<Kept<Messages>...> kept_;
};

template <bool kExact, class... Messages>
std::shared_ptr<JoinBase> add_join(rclcpp::Node &node, const typename Join<kExact, Messages...>::Topics &topics,
                                   const rclcpp::QoS &qos, typename Join<kExact, Messages...>::Function function,
                                   const rclcpp::CallbackGroup::SharedPtr &group) {
  const auto join = std::make_shared<Join<kExact, Messages...>>(node, topics, qos, std::move(function));
  node.get_node_waitables_interface()->add_waitable(join, group);
  return join;
}

}  // namespace detail

/// Calls `function` with the newest message of each topic, each message at most once. `group`: null for the node's
/// default group. Throws what create_subscription() throws.
template <class... Messages>
[[nodiscard]] std::shared_ptr<JoinBase> join(rclcpp::Node &node,
                                             const typename detail::Join<false, Messages...>::Topics &topics,
                                             const rclcpp::QoS &qos,
                                             typename detail::Join<false, Messages...>::Function function,
                                             const rclcpp::CallbackGroup::SharedPtr &group = nullptr) {
  return detail::add_join<false, Messages...>(node, topics, qos, std::move(function), group);
}

/// Calls `function` with messages whose header stamps are equal, the oldest set first. Keeps as many messages of each
/// topic as `qos` keeps, and at most 1000.
template <class... Messages>
[[nodiscard]] std::shared_ptr<JoinBase> join_exact(rclcpp::Node &node,
                                                   const typename detail::Join<true, Messages...>::Topics &topics,
                                                   const rclcpp::QoS &qos,
                                                   typename detail::Join<true, Messages...>::Function function,
                                                   const rclcpp::CallbackGroup::SharedPtr &group = nullptr) {
  return detail::add_join<true, Messages...>(node, topics, qos, std::move(function), group);
}

}  // namespace redag_rclcpp
