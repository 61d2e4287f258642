// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "middleware_threads.hpp"

#include <sched.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <utility>

#include "redag/base/lock_guard.hpp"
#include "redag/base/mutex.hpp"

namespace redag_rclcpp {
namespace {

namespace fs = std::filesystem;

// Names in Cyclone DDS: q_init.c, q_radmin.c, q_xevent.c. dq.* deliver what recv* received; tev sends acknowledgements.
constexpr std::array<std::string_view, 6> kCyclone{"recv", "recvMC", "recvUC", "dq.builtins", "dq.user", "tev"};
// Names in Fast DDS: UDPChannelResource.cpp, TCPTransportInterface.cpp, SharedMemChannelResource.hpp,
// RTPSParticipantImpl.cpp, FlowControllerImpl.hpp. Numbers follow, separated by dots.
constexpr std::array<std::string_view, 5> kFastNumbered{"dds.udp.", "dds.tcp.", "dds.shm.", "dds.ev.", "dds.asyn."};
constexpr std::string_view kFastAccepts = "dds.tcp_accept";

bool is_cyclone(std::string_view name) { return std::find(kCyclone.begin(), kCyclone.end(), name) != kCyclone.end(); }

bool is_fast(std::string_view name) {
  if (name == kFastAccepts) return true;
  return std::any_of(kFastNumbered.begin(), kFastNumbered.end(), [&](std::string_view prefix) {
    const bool begins = name.size() > prefix.size() && name.substr(0, prefix.size()) == prefix;
    return begins && name.find_first_not_of("0123456789.", prefix.size()) == std::string_view::npos;
  });
}

fs::path folder_of(int thread) { return fs::path("/proc/self/task") / std::to_string(thread); }

/// True if the thread blocks the signals that end or disturb a process.
bool blocks_signals(int thread) {
  std::ifstream file(folder_of(thread) / "status");
  for (std::string line; std::getline(file, line);) {
    constexpr std::string_view kKey = "SigBlk:";
    if (line.compare(0, kKey.size(), kKey) != 0) continue;
    std::uint64_t blocked = 0;
    std::istringstream(line.substr(kKey.size())) >> std::hex >> blocked;
    constexpr std::array kSignals{SIGHUP, SIGINT, SIGQUIT, SIGUSR1, SIGUSR2, SIGPIPE, SIGALRM, SIGTERM, SIGCHLD};
    return std::all_of(kSignals.begin(), kSignals.end(), [&](int s) { return (blocked >> (s - 1) & 1) != 0; });
  }
  return false;
}

/// Start time of the thread in the kernel's ticks, which tells threads with the same id apart. 0: the thread does not
/// exist.
std::uint64_t start_of(int thread) {
  constexpr int kStartField = 22;  // man 5 proc
  std::ifstream file(folder_of(thread) / "stat");
  std::string text;
  std::getline(file, text);
  const std::size_t name_end = text.rfind(')');  // the name may contain parentheses
  if (name_end == std::string::npos) return 0;
  std::istringstream fields(text.substr(name_end + 1));
  std::string field;
  for (int i = 3; i <= kStartField; ++i) fields >> field;
  std::uint64_t start = 0;
  std::from_chars(field.data(), field.data() + field.size(), start);
  return start;
}

struct Scheduling {
  int policy = SCHED_OTHER;
  sched_param parameters{};

  [[nodiscard]] bool is_realtime() const { return policy == SCHED_FIFO || policy == SCHED_RR; }
};

bool read_scheduling(int thread, Scheduling &scheduling) {
  scheduling.policy = sched_getscheduler(thread);
  return scheduling.policy >= 0 && sched_getparam(thread, &scheduling.parameters) == 0;
}

/// A thread that executors have raised.
struct Raised {
  Scheduling before;
  int priority = 0;  // priority that the thread was given
  std::uint64_t start = 0;
  std::uint32_t users = 0;
};

struct Registry {
  redag::Mutex lock;
  std::map<int, Raised> threads REDAG_GUARDED_BY(lock);
};

Registry &registry() {
  static auto *const registry = new Registry;  // never destroyed: an executor may be a static object
  return *registry;
}

}  // namespace

bool is_middleware_thread_name(std::string_view name) { return is_cyclone(name) || is_fast(name); }

std::vector<MiddlewareThread> find_middleware_threads() {
  std::vector<MiddlewareThread> found;
  std::error_code error;
  for (const auto &entry : fs::directory_iterator("/proc/self/task", error)) {
    const std::string id = entry.path().filename();
    MiddlewareThread thread;
    if (std::from_chars(id.data(), id.data() + id.size(), thread.id).ec != std::errc()) continue;
    std::ifstream file(entry.path() / "comm");
    std::getline(file, thread.name);
    if (is_fast(thread.name) || (is_cyclone(thread.name) && blocks_signals(thread.id))) {
      found.push_back(std::move(thread));
    }
  }
  return found;
}

RaisedMiddleware::RaisedMiddleware(int priority) {
  const std::vector<MiddlewareThread> threads = find_middleware_threads();
  found_ = threads.size();
  const redag::LockGuard guard(registry().lock);
  for (const MiddlewareThread &thread : threads) {
    Scheduling now;
    const std::uint64_t start = start_of(thread.id);
    if (start == 0 || !read_scheduling(thread.id, now)) continue;  // the thread has ended
    auto known = registry().threads.find(thread.id);
    if (known != registry().threads.end() && known->second.start != start) {
      registry().threads.erase(known);  // the entry belongs to an ended thread of the same id
      known = registry().threads.end();
    }
    if (!now.is_realtime() || now.parameters.sched_priority < priority) {
      const sched_param wanted{priority};
      if (sched_setscheduler(thread.id, SCHED_FIFO, &wanted) != 0) {
        ++refused_;
        continue;
      }
      if (known == registry().threads.end()) {
        known = registry().threads.emplace(thread.id, Raised{now, priority, start, 0}).first;
      }
      known->second.priority = priority;
    }
    if (known == registry().threads.end()) continue;  // its own priority is high enough
    ++known->second.users;
    raised_.push_back(thread.id);
  }
}

RaisedMiddleware::~RaisedMiddleware() {
  const redag::LockGuard guard(registry().lock);
  for (const int thread : raised_) {
    const auto known = registry().threads.find(thread);
    if (known == registry().threads.end() || --known->second.users > 0) continue;
    const Raised raised = known->second;
    registry().threads.erase(known);
    Scheduling now;
    if (start_of(thread) != raised.start || !read_scheduling(thread, now)) continue;
    // Leaves a priority in place that another part of the program has set meanwhile.
    if (now.policy != SCHED_FIFO || now.parameters.sched_priority != raised.priority) continue;
    (void)sched_setscheduler(thread, raised.before.policy, &raised.before.parameters);
  }
}

}  // namespace redag_rclcpp
