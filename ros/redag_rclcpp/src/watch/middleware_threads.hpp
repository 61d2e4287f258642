// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Finds the middleware's own threads in this process by the library that started them, and raises them above the
// workers while an executor spins. Any thread may call these functions.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace redag_rclcpp {

struct MiddlewareThread {
  int id = 0;            // thread id of the kernel
  std::string name;      // for instance "recv"; the program's own, if the middleware does not name its threads
  bool delivers = true;  // false: a thread for work in the background, such as "gc"
  int priority = 0;      // SCHED_FIFO or SCHED_RR priority; 0: none
};

struct MiddlewareThreads {
  std::vector<MiddlewareThread> threads;  // by name, then by id
  // Why threads were recognised by their names, which tell only those of Cyclone DDS and Fast DDS. Empty: by libraries.
  std::string by_names_because;
};

/// True for the file of a library that starts the threads of Cyclone DDS, Fast DDS, or Zenoh: "/opt/lib/libddsc.so.0".
[[nodiscard]] bool is_middleware_library(std::string_view path);

/// Threads that such a library started. Where the system does not tell, threads with such a name; Cyclone DDS blocks
/// all signals in its threads, which tells them from users' threads of the same name.
[[nodiscard]] MiddlewareThreads find_middleware_threads();

/// Gives the threads that deliver SCHED_FIFO `priority`, unless they have a higher one. The destructor restores the
/// earlier scheduling. If executors of one process overlap, the last one restores it. Used by one thread at a time.
class RaisedMiddleware {
 public:
  /// `priority` 0: only looks.
  explicit RaisedMiddleware(int priority) : priority_(priority) { look(); }
  ~RaisedMiddleware();
  RaisedMiddleware(const RaisedMiddleware &) = delete;
  RaisedMiddleware &operator=(const RaisedMiddleware &) = delete;

  /// Looks again, because the middleware creates threads when it needs them. Raises those that are new.
  void look();

  [[nodiscard]] int priority() const { return priority_; }
  /// What the last look found.
  [[nodiscard]] const MiddlewareThreads &found() const { return found_; }

 private:
  const int priority_;
  MiddlewareThreads found_;
  std::map<int, std::uint64_t> raised_;  // ids and start times of the threads that this object keeps raised
};

}  // namespace redag_rclcpp
