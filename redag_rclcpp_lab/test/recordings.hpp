// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A recording of random messages for tests.
#pragma once

#include <utility>
#include <vector>

#include "rclcpp/serialization.hpp"
#include "recording.hpp"
#include "redag/base/rng.hpp"
#include "std_msgs/msg/u_int64.hpp"

namespace redag_rclcpp::lab {

inline constexpr redag::Time kStart = 1'700'000'000 * redag::kSecond;

/// Messages at random times, several at the same one; always the same.
class RandomRecording final : public Recording {
 public:
  explicit RandomRecording(std::uint64_t instants) {
    for (const char *topic : {"/scan", "/odom", "/imu"}) topics_.push_back({topic, "std_msgs/msg/UInt64"});
    redag::Rng random(7);
    redag::Time time = kStart;
    for (std::uint64_t i = 0; i < instants; ++i, time += random.uniform(1, 8) * redag::kMillisecond) {
      for (std::int64_t n = random.uniform(1, 5); n > 0; --n) {
        std_msgs::msg::UInt64 message;
        message.data = 10 * i + static_cast<std::uint64_t>(n);
        RecordedMessage recorded;
        recorded.time = time;
        recorded.topic = static_cast<std::size_t>(random.uniform(0, 2));
        rclcpp::Serialization<std_msgs::msg::UInt64>().serialize_message(&message, &recorded.data);
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

}  // namespace redag_rclcpp::lab
