// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// libredag_pi.so makes mutexes inherit priority, even if the library that owns them never asked for it.
//
// The replaced pthread_mutex_init() adds PTHREAD_PRIO_INHERIT to the attributes. A mutex with a static initialiser
// (std::mutex is one) never passes through it. The replaced lock functions change the kind of such a mutex before its
// first lock, by one compare-and-swap. Every lock passes through them: a mutex with the initialiser's kind was
// therefore never locked. glibc itself tells which kinds correspond. The library owns no thread and no lock, and
// allocates nothing.
#include <dlfcn.h>
#include <pthread.h>

#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <ctime>

#include "redag_rclcpp/inherit.h"

#define REDAG_PI_EXPORT __attribute__((visibility("default")))

namespace {

using Init = int (*)(pthread_mutex_t *, const pthread_mutexattr_t *);
using Lock = int (*)(pthread_mutex_t *);
using TimedLock = int (*)(pthread_mutex_t *, const timespec *);
using ClockLock = int (*)(pthread_mutex_t *, clockid_t, const timespec *);

/// Finds the next function of this name behind the replaced one. glibc may call it before any constructor has run.
template <class Function>
Function next(std::atomic<void *> &known, const char *name) {
  void *function = known.load(std::memory_order_relaxed);
  if (function == nullptr) {
    function = dlsym(RTLD_NEXT, name);
    if (function == nullptr) std::abort();  // a libc without mutexes
    known.store(function, std::memory_order_relaxed);
  }
  return reinterpret_cast<Function>(function);
}

std::atomic<void *> init_function{nullptr};
std::atomic<void *> lock_function{nullptr};
std::atomic<void *> try_function{nullptr};
std::atomic<void *> timed_function{nullptr};
std::atomic<void *> clock_function{nullptr};

int real_init(pthread_mutex_t *mutex, const pthread_mutexattr_t *attributes) {
  return next<Init>(init_function, "pthread_mutex_init")(mutex, attributes);
}

// The kinds of static initialisers: normal, recursive, error-checking, adaptive.
constexpr int kStaticKinds = 4;
constexpr int kUnknown = -1;

enum class State : int { Undecided, Off, On };
std::atomic<State> state{State::Undecided};
std::atomic<int> inheriting[kStaticKinds] = {kUnknown, kUnknown, kUnknown, kUnknown};  // indexed by the static kind

/// The kind that glibc gives to a mutex of this type and protocol. kUnknown: glibc refuses.
int kind_of(int type, int protocol) {
  pthread_mutexattr_t attributes;
  if (pthread_mutexattr_init(&attributes) != 0) return kUnknown;
  pthread_mutex_t mutex{};
  int kind = kUnknown;
  // PTHREAD_MUTEX_TIMED_NP (normal) is the initial type. Setting it would also forbid lock elision, which changes the
  // kind.
  const bool typed = type == PTHREAD_MUTEX_TIMED_NP || pthread_mutexattr_settype(&attributes, type) == 0;
  if (typed && pthread_mutexattr_setprotocol(&attributes, protocol) == 0 && real_init(&mutex, &attributes) == 0) {
    kind = mutex.__data.__kind;
    pthread_mutex_destroy(&mutex);
  }
  pthread_mutexattr_destroy(&attributes);
  return kind;
}

// Decides whether mutexes inherit. Several threads may run it at once; all of them find the same answer.
State decide() {
  const char *wish = std::getenv("REDAG_PI");
  bool works = wish == nullptr || std::strcmp(wish, "0") != 0;
  for (int type = 0; type < kStaticKinds && works; ++type) {
    const int kind = kind_of(type, PTHREAD_PRIO_INHERIT);
    works = kind != kUnknown && (type != PTHREAD_MUTEX_TIMED_NP || kind_of(type, PTHREAD_PRIO_NONE) == type);
    if (works) inheriting[type].store(kind, std::memory_order_relaxed);
  }
  State undecided = State::Undecided;
  state.compare_exchange_strong(undecided, works ? State::On : State::Off, std::memory_order_acq_rel);
  return state.load(std::memory_order_acquire);
}

bool is_on() {
  const State now = state.load(std::memory_order_acquire);
  return (now == State::Undecided ? decide() : now) == State::On;
}

/// Called before every lock. Makes a mutex that its initialiser left unchanged one that inherits.
void adopt(pthread_mutex_t *mutex) {
  std::atomic_ref<int> kind(mutex->__data.__kind);
  int now = kind.load(std::memory_order_relaxed);
  if (static_cast<unsigned>(now) >= static_cast<unsigned>(kStaticKinds))
    return;  // it inherits already, or has another protocol
  if (!is_on()) return;
  // A thread that locked it in another way holds it. Changing the kind now would lose the unlock.
  if (std::atomic_ref<int>(mutex->__data.__lock).load(std::memory_order_relaxed) != 0) return;
  if (mutex->__data.__owner != 0 || mutex->__data.__nusers != 0) return;
  const int wanted = inheriting[now].load(std::memory_order_relaxed);
  // A faster thread has stored the same kind.
  kind.compare_exchange_strong(now, wanted, std::memory_order_relaxed);
}

timespec as_realtime(clockid_t clock, const timespec &deadline) {
  constexpr long kSecond = 1'000'000'000;
  timespec there{};
  timespec here{};
  clock_gettime(clock, &there);
  clock_gettime(CLOCK_REALTIME, &here);
  timespec result{here.tv_sec + deadline.tv_sec - there.tv_sec, here.tv_nsec + deadline.tv_nsec - there.tv_nsec};
  for (; result.tv_nsec < 0; result.tv_nsec += kSecond) --result.tv_sec;
  for (; result.tv_nsec >= kSecond; result.tv_nsec -= kSecond) ++result.tv_sec;
  return result;
}

}  // namespace

extern "C" {

REDAG_PI_EXPORT int redag_pi_enabled(void) { return is_on() ? 1 : 0; }

REDAG_PI_EXPORT void redag_pi_disable(void) { state.store(State::Off); }

REDAG_PI_EXPORT int pthread_mutex_init(pthread_mutex_t *mutex, const pthread_mutexattr_t *attributes) noexcept {
  int protocol = PTHREAD_PRIO_NONE;
  if (attributes != nullptr) pthread_mutexattr_getprotocol(attributes, &protocol);
  if (protocol != PTHREAD_PRIO_NONE || !is_on()) return real_init(mutex, attributes);

  // Copies the attributes: glibc's are plain values, and the copy has the same type, robustness and sharing.
  pthread_mutexattr_t own;
  if (attributes != nullptr) {
    own = *attributes;
  } else if (pthread_mutexattr_init(&own) != 0) {
    return real_init(mutex, attributes);
  }
  if (pthread_mutexattr_setprotocol(&own, PTHREAD_PRIO_INHERIT) != 0) return real_init(mutex, attributes);
  const int error = real_init(mutex, &own);
  return error == 0 ? 0 : real_init(mutex, attributes);
}

REDAG_PI_EXPORT int pthread_mutex_lock(pthread_mutex_t *mutex) noexcept {
  adopt(mutex);
  return next<Lock>(lock_function, "pthread_mutex_lock")(mutex);
}

REDAG_PI_EXPORT int pthread_mutex_trylock(pthread_mutex_t *mutex) noexcept {
  adopt(mutex);
  return next<Lock>(try_function, "pthread_mutex_trylock")(mutex);
}

REDAG_PI_EXPORT int pthread_mutex_timedlock(pthread_mutex_t *mutex, const timespec *deadline) noexcept {
  adopt(mutex);
  return next<TimedLock>(timed_function, "pthread_mutex_timedlock")(mutex, deadline);
}

// Falls back to CLOCK_REALTIME. Before glibc 2.35 and Linux 5.14 an inheriting mutex cannot wait by CLOCK_MONOTONIC, as
// std::timed_mutex does. It would get EINVAL and take that for "not locked".
REDAG_PI_EXPORT int pthread_mutex_clocklock(pthread_mutex_t *mutex, clockid_t clock,
                                            const timespec *deadline) noexcept {
  adopt(mutex);
  const int result = next<ClockLock>(clock_function, "pthread_mutex_clocklock")(mutex, clock, deadline);
  if (result != EINVAL || clock != CLOCK_MONOTONIC) return result;
  const timespec by_realtime = as_realtime(clock, *deadline);
  return next<TimedLock>(timed_function, "pthread_mutex_timedlock")(mutex, &by_realtime);
}

}  // extern "C"
