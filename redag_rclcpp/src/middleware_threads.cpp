#include "middleware_threads.hpp"

#include <sched.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <string_view>

namespace redag_rclcpp {
namespace {

// Prefixes. Cyclone DDS: ddsrt thread names in q_init.c, q_thread.c; dq.* deliver what recv* received, tev sends
// acknowledgements. Fast DDS: dds.udp, dds.shm, dds.ev, dds.asyn.
constexpr std::array<std::string_view, 4> kPrefixes{"recv", "dq.", "tev", "dds."};

}  // namespace

std::vector<MiddlewareThread> find_middleware_threads() {
  std::vector<MiddlewareThread> found;
  std::error_code error;
  for (const auto &entry : std::filesystem::directory_iterator("/proc/self/task", error)) {
    const std::string id = entry.path().filename();
    std::ifstream file(entry.path() / "comm");
    MiddlewareThread thread;
    std::getline(file, thread.name);
    const auto named = [&](std::string_view prefix) { return thread.name.compare(0, prefix.size(), prefix) == 0; };
    if (std::none_of(kPrefixes.begin(), kPrefixes.end(), named)) continue;
    if (std::from_chars(id.data(), id.data() + id.size(), thread.id).ec != std::errc()) continue;
    found.push_back(std::move(thread));
  }
  return found;
}

std::vector<MiddlewareThread> raise_middleware_threads(int priority) {
  std::vector<MiddlewareThread> refused;
  for (const MiddlewareThread &thread : find_middleware_threads()) {
    sched_param now{};
    const int policy = sched_getscheduler(thread.id);
    const bool realtime = policy == SCHED_FIFO || policy == SCHED_RR;
    if (realtime && sched_getparam(thread.id, &now) == 0 && now.sched_priority >= priority) continue;
    const sched_param wanted{priority};
    if (sched_setscheduler(thread.id, SCHED_FIFO, &wanted) != 0) refused.push_back(thread);
  }
  return refused;
}

}  // namespace redag_rclcpp
