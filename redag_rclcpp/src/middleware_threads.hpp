// The middleware's own threads in this process: found by the names that it gives them.
#pragma once

#include <string>
#include <vector>

namespace redag_rclcpp {

struct MiddlewareThread {
  int id = 0;        // of the kernel
  std::string name;  // "recv"
};

/// Threads that receive and deliver data: Cyclone DDS' (recv, recvMC, recvUC, tev, dq.*), Fast DDS' since 2.11 (dds.*).
[[nodiscard]] std::vector<MiddlewareThread> find_middleware_threads();

/// Gives them SCHED_FIFO `priority`, unless they have a higher one. Returns those the system refused to change.
[[nodiscard]] std::vector<MiddlewareThread> raise_middleware_threads(int priority);

}  // namespace redag_rclcpp
