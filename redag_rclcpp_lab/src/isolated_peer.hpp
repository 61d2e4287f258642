// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The CallbackIsolatedExecutor as a peer (github.com/autowarefoundation/callback_isolated_executor). It has a thread
// for each callback group. Its thread configurator, a process, sets the priorities of these threads as a file says.
#pragma once

#include <cstddef>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "child_process.hpp"
#include "rclcpp/rclcpp.hpp"
#include "redag/base/result.hpp"
#include "redag/base/time.hpp"

namespace redag_rclcpp::lab {

/// Its name among the executors.
inline constexpr const char *kIsolated = "cie";

/// Error: this build lacks it; the text says what it needs.
[[nodiscard]] redag::Result<void> check_isolated();

/// Requires check_isolated(). Its cancel() does not end spin(); rclcpp::shutdown() does.
[[nodiscard]] std::unique_ptr<rclcpp::Executor> make_isolated();

/// What the file for the thread configurator says of a node's callback groups, except its default group.
struct IsolatedNode {
  int priority = 0;                       // of SCHED_FIFO
  std::vector<redag::Duration> timers{};  // periods of the timers, which need not exist yet
};

/// The thread configurator with a file that it reads, for the callback groups of the nodes of one process.
class ThreadConfigurator {
 public:
  /// `settings`: by the nodes' full names. Requires check_isolated(), and that all subscriptions exist. Throws
  /// std::runtime_error if the program cannot be started.
  ThreadConfigurator(const std::vector<rclcpp::Node::SharedPtr> &nodes,
                     const std::map<std::string, IsolatedNode> &settings);
  ~ThreadConfigurator();
  ThreadConfigurator(const ThreadConfigurator &) = delete;
  ThreadConfigurator &operator=(const ThreadConfigurator &) = delete;

  /// Waits until the configurators of `processes` processes listen. A thread that begins earlier would not be heard.
  [[nodiscard]] redag::Result<void> wait_until_they_listen(std::size_t processes, redag::Duration timeout) const;

  /// Waits until threads of this process have the priorities of the file. Error: some have not at `deadline` (on
  /// timer_clock_now()).
  [[nodiscard]] redag::Result<void> wait_for_priorities(redag::Time deadline) const;

 private:
  std::string folder_;
  std::vector<rclcpp::Node::SharedPtr> nodes_;
  std::vector<int> expected_;  // priorities, ascending
  std::unique_ptr<ChildProcess> process_;
};

}  // namespace redag_rclcpp::lab
