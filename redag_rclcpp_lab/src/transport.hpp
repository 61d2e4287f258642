// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Measures how long messages take from one process to a callback of ReDAGExecutor in another: `transport` of a link in
// a robot file (docs/robot.md).
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/base/time.hpp"

namespace redag_rclcpp::lab {

struct TransportOptions {
  std::vector<std::size_t> sizes = {64, 65'536, 1'048'576};  // of messages, multiples of 8 bytes from kLeastMessage
  redag::Duration period = 10 * redag::kMillisecond;
  redag::Duration duration = 10 * redag::kSecond;  // of each size
  bool reliable = true;
  redag::Duration patience = 20 * redag::kSecond;  // until both processes have found each other
  std::function<bool()> stop{};                    // asked before each message
};

/// A message begins with its number and the time when it was published.
inline constexpr std::size_t kLeastMessage = 16;

/// From the call of publish() to the first instruction of the callback.
struct TransportFigures {
  std::size_t bytes = 0;
  std::uint64_t sent = 0;
  std::vector<redag::Duration> latencies;  // of the messages that arrived, ascending
};

/// Forks: the child receives with ReDAGExecutor, and the parent publishes. Must be called before rclcpp::init() and
/// while the process has one thread; initialises rclcpp in both, and shuts it down. Errors: no publisher or
/// subscription found the other in time; the child ended early.
[[nodiscard]] redag::Result<std::vector<TransportFigures>> measure_transport(const TransportOptions &options);

/// The latency that a share of the messages does not exceed. Requires some.
[[nodiscard]] redag::Duration quantile(const TransportFigures &figures, double share);

/// What a robot file can state: the largest latency times `margin`, rounded up to microseconds. A measured maximum is
/// no bound. Requires some latencies.
[[nodiscard]] redag::Duration stated_transport(const TransportFigures &figures, double margin);

/// A table for people, with what to write for each size.
[[nodiscard]] std::string describe(const std::vector<TransportFigures> &figures, double margin);

/// A document `redag.transport/1`.
[[nodiscard]] std::string to_json(const std::vector<TransportFigures> &figures, const TransportOptions &options,
                                  double margin);

}  // namespace redag_rclcpp::lab
