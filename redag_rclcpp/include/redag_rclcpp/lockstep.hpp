// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What a player and the executors in lockstep say to each other (docs/ros2.md, "Replay in lockstep"). Both topics have
// messages of std_msgs/String with JSON. Values only; any thread may call the functions.
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "rclcpp/qos.hpp"
#include "redag/base/result.hpp"
#include "redag/base/time.hpp"

namespace redag_rclcpp::lockstep {

inline constexpr const char *kOrderTopic = "/redag/lockstep/order";    // from the player
inline constexpr const char *kReportTopic = "/redag/lockstep/report";  // from the executors

/// Nothing may be lost.
inline rclcpp::QoS qos() { return rclcpp::QoS(rclcpp::KeepLast(1000)).reliable(); }

/// What the player says.
struct Order {
  enum class Kind : std::uint8_t {
    Begin,    // repeated until all executors are ready
    Instant,  // what was published until now is to be handled
    End,
  };
  Kind kind = Kind::Begin;
  std::string session;        // different for each run of a player
  std::string player;         // name of the player's node
  std::uint64_t instant = 0;  // from 1; 0: Begin
  redag::Time time = 0;       // that /clock shows from now on
  /// Messages since the session began, by topic. Begin: every topic of the player. Instant: those with new messages.
  std::map<std::string, std::uint64_t> published{};
};

/// What an executor answers.
struct Report {
  enum class Kind : std::uint8_t {
    Connecting,  // a subscription does not have the player yet; `text` says which
    Ready,       // for the first, or next, instant
    Done,        // with the instant
    Busy,        // a sign of life: `text` says what it waits for, or executes
    Failed,      // the instant cannot be handled; `text` says why, and what helps
  };
  Kind kind = Kind::Connecting;
  std::string session;
  std::string executor;       // unique name
  std::uint64_t instant = 0;  // that it speaks of
  std::uint64_t jobs = 0;     // since the session began
  std::uint64_t order = 0;    // hash of their names, in the order in which they ran
  std::string text{};
  /// Why a repetition can differ: what came from outside the recording. Each once; empty: nothing did.
  std::map<std::string, std::uint64_t> outside{};
  /// Number of subscriptions, by topic of the player.
  std::map<std::string, std::uint64_t> subscriptions{};
};

[[nodiscard]] std::string to_text(const Order &order);
[[nodiscard]] std::string to_text(const Report &report);
[[nodiscard]] redag::Result<Order> parse_order(const std::string &text);
[[nodiscard]] redag::Result<Report> parse_report(const std::string &text);

}  // namespace redag_rclcpp::lockstep
