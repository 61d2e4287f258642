// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A library for LD_PRELOAD. The time of day (CLOCK_REALTIME) jumps back and forth by one day to eleven years at every
// reading. A wait for a time of day ends the program. Setting the machine's own clock would disturb other programs.
#include <dlfcn.h>
#include <linux/futex.h>
#include <pthread.h>
#include <semaphore.h>
#include <signal.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

#include <atomic>
#include <cstdarg>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <initializer_list>

namespace {

bool is_time_of_day(clockid_t clock) {
  return clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE || clock == CLOCK_TAI;
}

// Jumps forward at one reading and back at the next, further each time.
time_t jump() {
  static std::atomic<std::uint32_t> looks{0};
  const std::uint32_t look = looks.fetch_add(1, std::memory_order_relaxed);
  const auto days = static_cast<time_t>(1 + look % 4000);
  return (look % 2 == 0 ? days : -days) * 86'400;
}

template <class Function>
Function *next(const char *name) {
  void *const found = dlsym(RTLD_NEXT, name);
  Function *function = nullptr;
  std::memcpy(&function, &found, sizeof function);
  return function;
}

[[noreturn]] void refuse(const char *what) {
  for (const char *part : {"jumping_clock: ", what, " waits for a time of day\n"}) {
    static_cast<void>(!write(STDERR_FILENO, part, std::strlen(part)));
  }
  std::abort();
}

}  // namespace

extern "C" {

int clock_gettime(clockid_t clock, timespec *now) noexcept {
  static auto *const real = next<int(clockid_t, timespec *)>("clock_gettime");
  const int result = real(clock, now);
  if (result == 0 && is_time_of_day(clock)) now->tv_sec += jump();
  return result;
}

int gettimeofday(timeval *now, void * /*zone*/) noexcept {
  timespec precise{};
  const int result = clock_gettime(CLOCK_REALTIME, &precise);
  *now = timeval{precise.tv_sec, precise.tv_nsec / 1000};
  return result;
}

time_t time(time_t *now) noexcept {
  timespec precise{};
  clock_gettime(CLOCK_REALTIME, &precise);
  if (now != nullptr) *now = precise.tv_sec;
  return precise.tv_sec;
}

int clock_nanosleep(clockid_t clock, int flags, const timespec *until, timespec *left) {
  static auto *const real = next<int(clockid_t, int, const timespec *, timespec *)>("clock_nanosleep");
  if (is_time_of_day(clock) && (flags & TIMER_ABSTIME) != 0) refuse("clock_nanosleep");
  return real(clock, flags, until, left);
}

int pthread_cond_timedwait(pthread_cond_t *, pthread_mutex_t *, const timespec *) { refuse("pthread_cond_timedwait"); }

int pthread_mutex_timedlock(pthread_mutex_t *, const timespec *) noexcept { refuse("pthread_mutex_timedlock"); }

int sem_timedwait(sem_t *, const timespec *) { refuse("sem_timedwait"); }

int timer_create(clockid_t clock, sigevent *event, timer_t *timer) noexcept {
  static auto *const real = next<int(clockid_t, sigevent *, timer_t *)>("timer_create");
  if (is_time_of_day(clock)) refuse("timer_create");
  return real(clock, event, timer);
}

int timerfd_create(int clock, int flags) noexcept {
  static auto *const real = next<int(int, int)>("timerfd_create");
  if (is_time_of_day(clock)) refuse("timerfd_create");
  return real(clock, flags);
}

long syscall(long number, ...) noexcept {
  static auto *const real = next<long(long, ...)>("syscall");
  va_list list;
  va_start(list, number);
  long arguments[6];
  for (long &argument : arguments) argument = va_arg(list, long);
  va_end(list);
  const bool waits_until = number == SYS_futex && (arguments[1] & FUTEX_CLOCK_REALTIME) != 0 && arguments[3] != 0;
  if (waits_until) refuse("futex");
  return real(number, arguments[0], arguments[1], arguments[2], arguments[3], arguments[4], arguments[5]);
}
}
