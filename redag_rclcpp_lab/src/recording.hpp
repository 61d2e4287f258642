// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Recorded messages, in the order of their times. Not thread-safe.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "rclcpp/serialized_message.hpp"
#include "redag/base/result.hpp"
#include "redag/base/time.hpp"

namespace redag_rclcpp::lab {

struct RecordedTopic {
  std::string name;
  std::string type;      // "std_msgs/msg/String"
  bool latched = false;  // transient local
};

struct RecordedMessage {
  redag::Time time = 0;   // nanoseconds since 1970, when it was recorded
  std::size_t topic = 0;  // index in Recording::topics()
  rclcpp::SerializedMessage data;
};

class Recording {
 public:
  virtual ~Recording() = default;
  [[nodiscard]] virtual const std::vector<RecordedTopic> &topics() const = 0;
  /// Reads the next message. False: there are no more.
  [[nodiscard]] virtual redag::Result<bool> next(RecordedMessage &message) = 0;
  /// Goes back to the first message.
  [[nodiscard]] virtual redag::Result<void> rewind() = 0;
};

}  // namespace redag_rclcpp::lab
