// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/threads/threads.hpp"

#include <fmt/format.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>

#if __has_include(<sys/rseq.h>)
#include <sys/rseq.h>
#endif

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <fstream>
#include <functional>
#include <optional>
#include <system_error>
#include <thread>
#include <utility>

#include "redag/base/blocked_signals.hpp"
#include "redag/base/check.hpp"
#include "redag/threads/parker.hpp"

namespace redag::runtime {
namespace {

std::string reason(int error) { return std::strerror(error); }

std::optional<std::int64_t> read_number(const char *path) {
  std::ifstream file(path);
  std::int64_t value = 0;
  if (!(file >> value)) return std::nullopt;
  return value;
}

Result<void> pin(const ThreadSetup &setup) {
  cpu_set_t set;
  CPU_ZERO(&set);
  for (const int cpu : setup.cpus) {
    if (cpu < 0 || cpu >= CPU_SETSIZE) return make_error(fmt::format("there is no processor {}", cpu));
    CPU_SET(static_cast<std::size_t>(cpu), &set);
  }
  const int error = pthread_setaffinity_np(pthread_self(), sizeof(set), &set);
  if (error == 0) return {};
  return make_error(fmt::format("thread '{}' cannot be pinned to its processors: {}", setup.name, reason(error)),
                    fmt::format("usable processors are {}", fmt::join(usable_cpus(), ", ")));
}

// Writes to every page of the stack below the caller's frame, as far as there is room.
[[gnu::noinline]] void touch_stack(std::size_t bytes) {
  constexpr std::size_t kReserve = std::size_t{32} << 10;  // bytes for this function and those that it calls
  pthread_attr_t attributes;
  if (pthread_getattr_np(pthread_self(), &attributes) != 0) return;
  void *lowest = nullptr;
  std::size_t size = 0;
  const bool known = pthread_attr_getstack(&attributes, &lowest, &size) == 0;
  pthread_attr_destroy(&attributes);
  const auto room = static_cast<std::size_t>(static_cast<const char *>(__builtin_frame_address(0)) -
                                             static_cast<const char *>(lowest));
  if (!known || room <= kReserve) return;
  const std::size_t amount = std::min(bytes, room - kReserve);
  auto *const page = static_cast<volatile char *>(__builtin_alloca(amount));
  for (std::size_t i = 0; i < amount; i += 1024) page[i] = 0;  // no page is smaller
}

// What a program that a body starts with fork() would otherwise inherit: all signals blocked, so that nothing but
// SIGKILL ends it, and sleeps without slack.
struct OfChildren {
  sigset_t signals{};  // blocked
  unsigned long slack = 0;
};
constinit thread_local std::optional<OfChildren> of_children;

void set_up_child() noexcept {
  if (!of_children) return;
  pthread_sigmask(SIG_SETMASK, &of_children->signals, nullptr);
  prctl(PR_SET_TIMERSLACK, of_children->slack, 0UL, 0UL, 0UL);
}

OfChildren like_this_thread(const BlockedSignals &inherited) {
  if (of_children) return *of_children;
  return {inherited.before(), static_cast<unsigned long>(prctl(PR_GET_TIMERSLACK))};
}

}  // namespace

Result<void> set_up_this_thread(const ThreadSetup &setup) {
  pthread_setname_np(pthread_self(), setup.name.substr(0, 15).c_str());
  prctl(PR_SET_TIMERSLACK, 1UL, 0UL, 0UL, 0UL);
  if (setup.touched_stack > 0) touch_stack(setup.touched_stack);
  if (setup.processor != nullptr) *setup.processor = this_threads_processor();
  if (!setup.cpus.empty()) {
    if (Result<void> pinned = pin(setup); !pinned) return pinned;
  }
  if (setup.fifo_priority > 0 && !set_fifo_priority(pthread_self(), setup.fifo_priority)) {
    return make_error(fmt::format("thread '{}' cannot have SCHED_FIFO priority {}", setup.name, setup.fifo_priority),
                      realtime_hint());
  }
  return {};
}

clockid_t cpu_clock_of(ThreadHandle &thread) noexcept {
  clockid_t clock = CLOCK_MONOTONIC;
  const int error = ::pthread_getcpuclockid(thread.native_handle(), &clock);
  REDAG_CHECK(error == 0, "a thread that runs has a clock");
  return clock;
}

// The kernel writes this word whenever it puts the thread on a processor (restartable sequences, registered by glibc).
ProcessorWord this_threads_processor() noexcept {
#if __has_include(<sys/rseq.h>) && defined(__GLIBC__)
  if (__rseq_size > 0) {
    const char *const area = static_cast<const char *>(__builtin_thread_pointer()) + __rseq_offset;
    return reinterpret_cast<ProcessorWord>(area + offsetof(rseq, cpu_id));
  }
#endif
  return nullptr;
}

int processor_of(ProcessorWord word) noexcept {
  return word == nullptr ? -1 : static_cast<int>(__atomic_load_n(word, __ATOMIC_RELAXED));
}

bool set_fifo_priority(pthread_t thread, int priority) noexcept {
  sched_param parameters{};
  parameters.sched_priority = priority;
  return pthread_setschedparam(thread, priority > 0 ? SCHED_FIFO : SCHED_OTHER, &parameters) == 0;
}

namespace {

// Makes the thread an ordinary one: what it does after its work, such as destroying its data, is not urgent.
// ThreadSanitizer's spin locks also do not inherit priority. Under it, threads that end at several priorities would
// wait for each other for ever.
void leave_fifo() noexcept {
  if (fifo_priority(pthread_self()) > 0) static_cast<void>(set_fifo_priority(pthread_self(), 0));
}

}  // namespace

BeforeOrdinaryThreads::BeforeOrdinaryThreads(bool wanted) {
  if (!wanted || pthread_getschedparam(pthread_self(), &policy_, &parameters_) != 0) return;
  const bool is_ordinary = policy_ != SCHED_FIFO && policy_ != SCHED_RR && policy_ != SCHED_DEADLINE;
  raised_ = is_ordinary && set_fifo_priority(pthread_self(), 1);
}

BeforeOrdinaryThreads::~BeforeOrdinaryThreads() {
  if (raised_) pthread_setschedparam(pthread_self(), policy_, &parameters_);
}

struct ThreadStart::State {
  ThreadSetup setup;
  Result<void> result;
  Event ready;
  std::thread thread;
};

ThreadStart::ThreadStart(ThreadSetup setup, std::function<void()> main) : state_(std::make_shared<State>()) {
  state_->setup = std::move(setup);
  try {
    static const int prepared = ::pthread_atfork(nullptr, nullptr, set_up_child);
    static_cast<void>(prepared);
    const BlockedSignals inherited;
    state_->thread =
        std::thread([state = state_, main = std::move(main), like = like_this_thread(inherited)]() mutable {
          of_children = like;
          state->result = set_up_this_thread(state->setup);
          const bool usable = state->result.has_value();
          state->ready.set();
          state.reset();
          if (usable) main();
          leave_fifo();
        });
  } catch (const std::system_error &error) {
    state_->result = make_error(fmt::format("thread '{}' cannot be created: {}", state_->setup.name, error.what()),
                                "check the limits on threads: 'ulimit -u', the pids limit of the container, and memory "
                                "for stacks ('ulimit -s')");
  }
}

bool ThreadStart::created() const { return state_->thread.joinable(); }

Result<ThreadHandle> ThreadStart::finish() {
  std::thread thread = std::move(state_->thread);
  if (thread.joinable()) state_->ready.wait();
  if (state_->result) return thread;
  if (thread.joinable()) thread.join();
  return tl::unexpected(state_->result.error());
}

Result<ThreadHandle> start_thread(const ThreadSetup &setup, std::function<void()> main) {
  const BeforeOrdinaryThreads promptly(setup.fifo_priority > 0);
  return ThreadStart(setup, std::move(main)).finish();
}

int fifo_priority(pthread_t thread) noexcept {
  int policy = 0;
  sched_param parameters{};
  if (pthread_getschedparam(thread, &policy, &parameters) != 0 || policy != SCHED_FIFO) return 0;
  return parameters.sched_priority;
}

std::vector<int> usable_cpus() {
  cpu_set_t set;
  CPU_ZERO(&set);
  std::vector<int> cpus;
  if (sched_getaffinity(0, sizeof(set), &set) != 0) return {0};
  for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu) {
    if (CPU_ISSET(static_cast<std::size_t>(cpu), &set)) cpus.push_back(cpu);
  }
  return cpus;
}

std::optional<int> unusable_cpu(const std::vector<int> &cpus) {
  const std::vector<int> usable = usable_cpus();
  const auto bad = std::find_if_not(cpus.begin(), cpus.end(),
                                    [&](int cpu) { return std::binary_search(usable.begin(), usable.end(), cpu); });
  return bad == cpus.end() ? std::nullopt : std::optional(*bad);
}

int available_fifo_priority(int wanted) {
  int found = 0;
  const BlockedSignals inherited;
  std::thread([&] {
    if (set_fifo_priority(pthread_self(), wanted)) {
      found = wanted;
      return;
    }
    rlimit limit{};
    if (getrlimit(RLIMIT_RTPRIO, &limit) != 0 || limit.rlim_cur == 0) return;
    const int allowed = limit.rlim_cur >= static_cast<rlim_t>(wanted) ? wanted : static_cast<int>(limit.rlim_cur);
    if (set_fifo_priority(pthread_self(), allowed)) found = allowed;
  }).join();
  return found;
}

int fifo_priority_above_this_thread() {
  const int inherited = fifo_priority(pthread_self());
  if (inherited == 0) return 0;
  const int above = available_fifo_priority(inherited + 1);
  return above > inherited ? above : 0;
}

const char *realtime_hint() {
  return "allow real-time priorities up to 90 (rtprio, CAP_SYS_NICE): 'redag doctor' says how";
}

Result<void> lock_memory() {
  if (mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) == 0) return {};
  return make_error("memory cannot be locked: " + reason(errno),
                    "raise the limit on locked memory (memlock): 'redag doctor' says how");
}

std::optional<Throttling> realtime_throttling() {
  const auto runtime = read_number("/proc/sys/kernel/sched_rt_runtime_us");
  const auto period = read_number("/proc/sys/kernel/sched_rt_period_us");
  if (!runtime || !period || *runtime < 0 || *runtime >= *period) return std::nullopt;
  return Throttling{*runtime, *period};
}

}  // namespace redag::runtime
