// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// LockstepPlayer publishes a recording and /clock, one instant after the other: the next one when all executors in
// lockstep have handled the last. Use it from one thread, which also runs the node's callbacks.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "rclcpp/executors/single_threaded_executor.hpp"
#include "rclcpp/generic_publisher.hpp"
#include "rclcpp/node.hpp"
#include "recording.hpp"
#include "redag/base/result.hpp"
#include "redag/base/rng.hpp"
#include "redag/base/time.hpp"
#include "redag_rclcpp/lockstep.hpp"
#include "rosgraph_msgs/msg/clock.hpp"
#include "std_msgs/msg/string.hpp"
#include "std_srvs/srv/set_bool.hpp"

namespace redag_rclcpp::lab {

struct PlayOptions {
  std::uint32_t executors = 1;                      // that follow; 0: waits for nobody, as `ros2 bag play --clock`
  double rate = 1;                                  // recorded time per time; 0: as fast as the executors
  redag::Duration tick = 10 * redag::kMillisecond;  // the longest step of /clock, and the shortest of timers
  redag::Duration patience = 10 * redag::kSecond;   // with an executor that gives no sign of life
  std::uint32_t repeat = 1;                         // the clock jumps back in between
  bool paused = false;                              // at the beginning
  /// Not 0: publishes the parts of an instant in random order, with random pauses. The results must be the same.
  std::uint64_t shuffle = 0;
  std::function<bool()> stop = [] { return false; };  // true: the end
  std::function<void(const std::string &)> say = [](const std::string &) {};
};

/// An executor that follows, by its last report.
struct Follower {
  lockstep::Report report;
  redag::Time heard = 0;  // CLOCK_MONOTONIC
};

struct PlayResult {
  std::uint64_t instants = 0;
  std::uint64_t messages = 0;
  redag::Duration recorded = 0;  // time that /clock has passed
  redag::Duration took = 0;      // without pauses
  bool stopped = false;          // before the end of the recording
  std::map<std::string, Follower> executors{};
};

class LockstepPlayer {
 public:
  /// `on_instant` is called after each instant.
  LockstepPlayer(rclcpp::Node::SharedPtr node, PlayOptions options,
                 std::function<void(redag::Time, const PlayResult &)> on_instant = {});
  ~LockstepPlayer();

  /// Plays the recording to its end. Errors say which executor failed, why, and what helps.
  [[nodiscard]] redag::Result<PlayResult> play(Recording &recording);

  /// True if play() failed because of the recording, and not of an executor.
  [[nodiscard]] bool is_recording_bad() const { return is_recording_bad_; }

 private:
  using Report = lockstep::Report;
  struct Topic {
    std::string name;
    rclcpp::GenericPublisher::SharedPtr publisher;
    std::uint64_t published = 0;
  };

  [[nodiscard]] redag::Result<void> advertise(const Recording &recording);
  [[nodiscard]] redag::Result<void> connect();
  [[nodiscard]] redag::Result<void> play_once(Recording &recording);
  [[nodiscard]] redag::Result<bool> read(Recording &recording, RecordedMessage &message);
  [[nodiscard]] redag::Result<void> step(redag::Time time, std::vector<RecordedMessage> &messages);
  [[nodiscard]] redag::Result<void> await_end_of_instant();
  [[nodiscard]] redag::Result<void> check(std::uint32_t &done);
  [[nodiscard]] bool pace(redag::Time time);
  [[nodiscard]] std::string unmatched() const;
  void hear(const std::string &text);
  void announce(lockstep::Order::Kind kind);
  void publish_in_order(redag::Time time, std::vector<RecordedMessage> &messages);

  const rclcpp::Node::SharedPtr node_;
  const PlayOptions options_;
  const std::function<void(redag::Time, const PlayResult &)> on_instant_;
  rclcpp::executors::SingleThreadedExecutor spinner_;
  rclcpp::Publisher<std_msgs::msg::String>::SharedPtr orders_;
  rclcpp::Subscription<std_msgs::msg::String>::SharedPtr reports_;
  rclcpp::Publisher<rosgraph_msgs::msg::Clock>::SharedPtr clock_;
  rclcpp::Service<std_srvs::srv::SetBool>::SharedPtr pause_;
  std::vector<Topic> topics_;
  lockstep::Order order_;
  PlayResult result_;
  redag::Rng random_;
  bool paused_ = false;
  bool is_recording_bad_ = false;
  bool complete_ = false;              // all executors are known; others come too late
  redag::Time begun_ = redag::kNever;  // CLOCK_MONOTONIC; when the recording's first instant was due
  redag::Time first_ = 0;              // that instant's time
};

}  // namespace redag_rclcpp::lab
