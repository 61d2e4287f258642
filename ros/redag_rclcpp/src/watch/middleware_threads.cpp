// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "watch/middleware_threads.hpp"

#include <sched.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>
#include <tuple>
#include <utility>

#include "redag/base/lock_guard.hpp"
#include "redag/base/mutex.hpp"
#include "redag/live/middleware_names.hpp"
#include "watch/start_routines.hpp"

namespace redag_rclcpp {
namespace {

namespace fs = std::filesystem;
namespace live = redag::live;

// libfastdds is Fast DDS 3.
constexpr std::array<std::string_view, 4> kLibraries{"libddsc.so", "libfastrtps.so", "libfastdds.so", "libzenohc.so"};

/// Located once, because the place is the same for all threads of a process. Tried again after an error: there may have
/// been too few threads for it.
redag::Result<StartRoutines> start_routines() {
  struct Located {
    redag::Mutex lock;
    std::optional<StartRoutines> routines REDAG_GUARDED_BY(lock);
  };
  static auto *const located = new Located;  // never destroyed: an executor may be a static object
  const redag::LockGuard guard(located->lock);
  if (!located->routines) {
    redag::Result<StartRoutines> routines = StartRoutines::locate();
    if (!routines) return routines;
    located->routines = *routines;
  }
  return *located->routines;
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

bool is_middleware_library(std::string_view path) {
  const std::string_view name = path.substr(path.rfind('/') + 1);
  return std::any_of(kLibraries.begin(), kLibraries.end(),
                     [&](std::string_view library) { return name.substr(0, library.size()) == library; });
}

MiddlewareThreads find_middleware_threads() {
  MiddlewareThreads found;
  const redag::Result<StartRoutines> routines = start_routines();
  if (!routines) found.by_names_because = routines.error().front().message;
  const auto is_middleware = [&](const MiddlewareThread &thread) {
    if (routines) return is_middleware_library(routines->library_of(thread.id));
    return live::is_middleware_thread_name(thread.name) &&
           (!live::is_cyclone_thread_name(thread.name) || blocks_signals(thread.id));
  };
  std::error_code error;
  for (const auto &entry : fs::directory_iterator("/proc/self/task", error)) {
    const std::string id = entry.path().filename();
    MiddlewareThread thread;
    if (std::from_chars(id.data(), id.data() + id.size(), thread.id).ec != std::errc()) continue;
    std::ifstream file(entry.path() / "comm");
    if (!std::getline(file, thread.name) || !is_middleware(thread)) continue;
    thread.delivers = !live::works_in_background(thread.name);
    Scheduling now;
    if (read_scheduling(thread.id, now) && now.is_realtime()) thread.priority = now.parameters.sched_priority;
    found.threads.push_back(std::move(thread));
  }
  std::sort(found.threads.begin(), found.threads.end(),
            [](const auto &a, const auto &b) { return std::tie(a.name, a.id) < std::tie(b.name, b.id); });
  return found;
}

void RaisedMiddleware::look() {
  found_ = find_middleware_threads();
  const redag::LockGuard guard(registry().lock);
  for (MiddlewareThread &thread : found_.threads) {
    if (priority_ == 0 || !thread.delivers) continue;
    Scheduling now;
    const std::uint64_t start = start_of(thread.id);
    if (start == 0 || !read_scheduling(thread.id, now)) continue;  // the thread has ended
    const auto mine = raised_.find(thread.id);
    if (mine != raised_.end() && mine->second == start) continue;  // another part of the program may have lowered it
    auto known = registry().threads.find(thread.id);
    if (known != registry().threads.end() && known->second.start != start) {
      registry().threads.erase(known);  // the entry belongs to an ended thread of the same id
      known = registry().threads.end();
    }
    if (!now.is_realtime() || now.parameters.sched_priority < priority_) {
      const sched_param wanted{priority_};
      if (sched_setscheduler(thread.id, SCHED_FIFO, &wanted) != 0) continue;  // its priority stays in found()
      if (start_of(thread.id) != start) {  // it ended meanwhile, and its id can be that of another process's thread
        (void)sched_setscheduler(thread.id, now.policy, &now.parameters);
        continue;
      }
      thread.priority = priority_;
      if (known == registry().threads.end()) {
        known = registry().threads.emplace(thread.id, Raised{now, priority_, start, 0}).first;
      }
      known->second.priority = priority_;
    }
    if (known == registry().threads.end()) continue;  // its own priority is high enough
    ++known->second.users;
    raised_[thread.id] = start;
  }
}

RaisedMiddleware::~RaisedMiddleware() {
  const redag::LockGuard guard(registry().lock);
  for (const auto &[thread, start] : raised_) {
    const auto known = registry().threads.find(thread);
    if (known == registry().threads.end() || known->second.start != start || --known->second.users > 0) continue;
    const Raised raised = known->second;
    registry().threads.erase(known);
    Scheduling now;
    if (start_of(thread) != start || !read_scheduling(thread, now)) continue;
    // Leaves a priority in place that another part of the program has set meanwhile.
    if (now.policy != SCHED_FIFO || now.parameters.sched_priority != raised.priority) continue;
    (void)sched_setscheduler(thread, raised.before.policy, &raised.before.parameters);
  }
}

}  // namespace redag_rclcpp
