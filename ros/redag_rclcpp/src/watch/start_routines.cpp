// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "watch/start_routines.hpp"

#include <dlfcn.h>
#include <pthread.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <optional>
#include <semaphore>
#include <system_error>
#include <thread>

#include "redag/base/blocked_signals.hpp"
#include "watch/own_memory.hpp"

// Names do not tell the middleware's threads: older Fast DDS does not name them, and users' threads may have any name.
// glibc keeps a thread's start routine in its descriptor, at a place that no header states. Two threads whose routine
// is known show the distance from the list of robust mutexes, whose address the kernel tells.
namespace redag_rclcpp {
namespace {

/// The two neighbours in a thread's descriptor that pthread_create() received.
struct Start {
  std::uintptr_t routine = 0;
  std::uintptr_t argument = 0;
};

int this_thread() { return static_cast<int>(::syscall(SYS_gettid)); }

/// Address of the list of robust mutexes, which lies in the thread's descriptor and which the kernel knows. 0: none.
std::uintptr_t robust_list_of(int thread) noexcept {
  std::uintptr_t head = 0;
  std::size_t size = 0;
  return ::syscall(SYS_get_robust_list, thread, &head, &size) == 0 ? head : 0;
}

std::optional<Start> start_at(std::uintptr_t address) noexcept {
  Start start;
  static_assert(sizeof(start) == 2 * sizeof(void *));
  if (read_own_memory(address, &start, sizeof(start)) != static_cast<ssize_t>(sizeof(start))) return std::nullopt;
  return start;
}

std::string library_at(std::uintptr_t address) {
  Dl_info info{};
  const bool known = dladdr(reinterpret_cast<void *>(address), &info) != 0 && info.dli_fname != nullptr;
  return known ? info.dli_fname : "";
}

/// A thread that waits until this object is destroyed.
class Waiting {
 public:
  Waiting() = default;
  Waiting(const Waiting &) = delete;
  Waiting &operator=(const Waiting &) = delete;

  /// What a thread has to run.
  void wait() {
    id_ = this_thread();
    begun_.release();
    end_.acquire();
  }
  [[nodiscard]] int id() {
    begun_.acquire();
    begun_.release();
    return id_;
  }
  void end() { end_.release(); }

 private:
  std::binary_semaphore begun_{0};
  std::binary_semaphore end_{0};
  int id_ = 0;
};

void *run_first(void *waiting) {
  static_cast<Waiting *>(waiting)->wait();
  return nullptr;
}

void *run_second(void *waiting) {
  static_cast<Waiting *>(waiting)->wait();
  return waiting;  // another function than run_first, so that a linker cannot fold the two
}

/// Calls `look` with the number of a thread that runs `routine`, and what such a thread received. False: there can be
/// no thread.
template <class Look>
bool with_thread(void *(*routine)(void *), const Look &look) {
  Waiting waiting;
  pthread_t thread{};
  if (pthread_create(&thread, nullptr, routine, &waiting) != 0) return false;
  look(waiting.id(), Start{reinterpret_cast<std::uintptr_t>(routine), reinterpret_cast<std::uintptr_t>(&waiting)});
  waiting.end();
  pthread_join(thread, nullptr);
  return true;
}

/// Distance from the list of robust mutexes to `start`. Nothing: it is not there, or more than once.
std::optional<std::size_t> find(const Start &start, std::uintptr_t list) {
  std::array<std::uintptr_t, 256> words{};  // 2 KiB; a descriptor of glibc has 2.3 KiB, and the list lies in its first
  if (list == 0) return std::nullopt;
  const ssize_t bytes = read_own_memory(list, words.data(), sizeof(words));
  std::optional<std::size_t> found;
  for (std::size_t i = 0; static_cast<ssize_t>((i + 2) * sizeof(words[0])) <= bytes; ++i) {
    if (words[i] != start.routine || words[i + 1] != start.argument) continue;
    if (found) return std::nullopt;
    found = i * sizeof(words[0]);
  }
  return found;
}

}  // namespace

redag::Result<StartRoutines> StartRoutines::locate() {
  const redag::BlockedSignals blocked;  // the new threads must not run the program's signal handlers
  std::optional<std::size_t> distance;
  bool agrees = false;
  const bool created =
      with_thread(run_first, [&](int id, const Start &start) { distance = find(start, robust_list_of(id)); }) &&
      with_thread(run_second, [&](int id, const Start &start) {
        agrees = distance && find(start, robust_list_of(id)) == distance;
      });
  if (!created) return redag::make_error("no thread can be created");
  if (!agrees) {
    return redag::make_error("the C library does not keep a thread's start routine where it can be found");
  }
  StartRoutines routines;
  routines.distance_ = *distance;

  // libstdc++ starts each std::thread with one function of its own. Its argument is an object whose class, and thus its
  // table of virtual functions, belongs to the library that created the thread.
  Waiting waiting;
  std::thread native;
  try {
    native = std::thread([&waiting] { waiting.wait(); });
  } catch (const std::system_error &) {
    return redag::make_error("no thread can be created");
  }
  const int id = waiting.id();
  const std::optional<Start> start = start_at(robust_list_of(id) + *distance);
  if (start) routines.of_std_thread_ = start->routine;
  const bool is_own = routines.library_of(id) == library_at(reinterpret_cast<std::uintptr_t>(&run_first));
  waiting.end();
  native.join();
  if (!is_own) return redag::make_error("the C++ library does not tell which library created a thread");
  return routines;
}

std::string StartRoutines::library_of(int thread) const {
  const std::uintptr_t list = robust_list_of(thread);
  if (list == 0) return {};
  const std::optional<Start> start = start_at(list + distance_);
  if (!start || start->routine == 0) return {};
  if (start->routine != of_std_thread_) return library_at(start->routine);
  std::uintptr_t table = 0;  // the object's first word
  if (read_own_memory(start->argument, &table, sizeof(table)) != static_cast<ssize_t>(sizeof(table))) return {};
  return library_at(table);
}

}  // namespace redag_rclcpp
