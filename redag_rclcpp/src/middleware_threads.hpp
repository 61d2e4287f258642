// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Finds the middleware's own threads in this process by their names and signal mask, and raises them above the workers
// while an executor spins. Any thread may call these functions.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace redag_rclcpp {

struct MiddlewareThread {
  int id = 0;        // thread id of the kernel
  std::string name;  // for instance "recv"
};

/// True if threads that receive or deliver data have this name. Cyclone DDS: recv, recvMC, recvUC, dq.builtins,
/// dq.user, tev. Fast DDS since 2.11: dds.udp.7400, dds.tcp.1, dds.tcp_accept, dds.shm.7400, dds.ev.1, dds.asyn.1.1.
[[nodiscard]] bool is_middleware_thread_name(std::string_view name);

/// Threads with such a name. Cyclone DDS creates its threads with all signals blocked, which tells them from users'
/// threads of the same name.
[[nodiscard]] std::vector<MiddlewareThread> find_middleware_threads();

/// Gives these threads SCHED_FIFO `priority`, unless they have a higher one. The destructor restores the earlier
/// scheduling. If executors of one process overlap, the last one restores it.
class RaisedMiddleware {
 public:
  explicit RaisedMiddleware(int priority);
  ~RaisedMiddleware();
  RaisedMiddleware(const RaisedMiddleware &) = delete;
  RaisedMiddleware &operator=(const RaisedMiddleware &) = delete;

  /// Number of threads that were found.
  [[nodiscard]] std::size_t found() const { return found_; }
  /// Number of threads that the system refused to change.
  [[nodiscard]] std::size_t refused() const { return refused_; }

 private:
  std::vector<int> raised_;
  std::size_t found_ = 0;
  std::size_t refused_ = 0;
};

}  // namespace redag_rclcpp
