// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What the runtime asks of Linux for its threads: names, processors, SCHED_FIFO, timer slack, locked memory; and what
// the process may ask for. No state of its own. Any thread.
#pragma once

#include <pthread.h>
#include <sched.h>

#include <cstddef>
#include <cstdint>
#include <ctime>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "redag/base/result.hpp"

namespace redag::runtime {

using ThreadHandle = std::thread;

/// Holds the processor where a thread runs, valid until the thread ends; null: this system does not provide it.
using ProcessorWord = const volatile std::uint32_t *;

/// How a thread of the runtime is set up.
struct ThreadSetup {
  std::string name;       // shown by top -H and ps; cut to 15 characters
  int fifo_priority = 0;  // SCHED_FIFO, 1 to 99; 0: unchanged
  std::vector<int> cpus;  // processors where it may run; empty: wherever the process may
  // Bytes of its stack that it touches first, so that bodies meet no page fault there. With lock_memory() they stay
  // resident.
  std::size_t touched_stack = 0;
  ProcessorWord *processor = nullptr;  // if not null, receives the thread's ProcessorWord
};

/// 256 KiB: enough for a callback that keeps its large objects elsewhere.
inline constexpr std::size_t kTouchedStack = std::size_t{256} << 10;

/// Applies `setup` to the calling thread, with a timer slack of 1 ns. (The default of 50 us causes most of an idle
/// timer's lateness.) Error: the first thing that the system refused.
[[nodiscard]] Result<void> set_up_this_thread(const ThreadSetup &setup);

/// For the start of real-time threads. While it lives, the calling thread comes before ordinary threads, and never
/// before a job: it has SCHED_FIFO priority 1, unless it has a real-time priority or may have none. On a busy machine,
/// a new ordinary thread waits for several milliseconds for its first instruction, and so does the thread that waits
/// for it. Threads that it creates inherit the priority.
class BeforeOrdinaryThreads {
 public:
  explicit BeforeOrdinaryThreads(bool wanted);
  ~BeforeOrdinaryThreads();
  BeforeOrdinaryThreads(const BeforeOrdinaryThreads &) = delete;
  BeforeOrdinaryThreads &operator=(const BeforeOrdinaryThreads &) = delete;

 private:
  bool raised_ = false;
  int policy_ = 0;  // from before
  sched_param parameters_{};
};

/// Creates a thread that is set up like this and then runs `main`. Returns once it is set up. It takes no signals but
/// those that it causes itself (BlockedSignals). Error: as set_up_this_thread(), and `main` does not run.
[[nodiscard]] Result<ThreadHandle> start_thread(const ThreadSetup &setup, std::function<void()> main);

/// The same in two steps, so that several threads are set up at the same time.
class ThreadStart {
 public:
  /// Creates the thread.
  ThreadStart(ThreadSetup setup, std::function<void()> main);
  /// Returns false if there can be no more threads.
  [[nodiscard]] bool created() const;
  /// Waits until the thread is set up. It must be called, and once.
  [[nodiscard]] Result<ThreadHandle> finish();

 private:
  struct State;
  std::shared_ptr<State> state_;
};

/// The clock of a running thread's processor time.
[[nodiscard]] clockid_t cpu_clock_of(ThreadHandle &thread) noexcept;

[[nodiscard]] ProcessorWord this_threads_processor() noexcept;
/// The processor where that thread runs or ran last; negative: unknown. Any thread.
[[nodiscard]] int processor_of(ProcessorWord word) noexcept;

/// Priority 0: an ordinary thread (SCHED_OTHER). Returns false if the system refused.
[[nodiscard]] bool set_fifo_priority(pthread_t thread, int priority) noexcept;

/// SCHED_FIFO priority of a thread; 0 if it is scheduled otherwise.
[[nodiscard]] int fifo_priority(pthread_t thread) noexcept;

/// One above the priority of the calling thread; 0 if that has none, or the process may not have more.
[[nodiscard]] int fifo_priority_above_this_thread();

/// Processors where the calling thread may run, ascending.
[[nodiscard]] std::vector<int> usable_cpus();

/// The first of `cpus` where the calling thread may not run; nothing if it may use them all.
[[nodiscard]] std::optional<int> unusable_cpu(const std::vector<int> &cpus);

/// The highest SCHED_FIFO priority up to `wanted` that this process can really get; 0: none. Tried on a scratch thread,
/// because rights come from several places (CAP_SYS_NICE, RLIMIT_RTPRIO, the cgroup's real-time share).
[[nodiscard]] int available_fifo_priority(int wanted);

/// Says how to get the right to use SCHED_FIFO.
[[nodiscard]] const char *realtime_hint();

/// Locks the process's memory page by page as it is used (MCL_ONFAULT). Otherwise the stacks of many threads would all
/// become resident. Error: RLIMIT_MEMLOCK, or no right.
[[nodiscard]] Result<void> lock_memory();

/// The kernel's setting: SCHED_FIFO threads may use `runtime_us` of each `period_us` of a processor.
struct Throttling {
  std::int64_t runtime_us = 0;
  std::int64_t period_us = 0;
};

/// This kernel's setting. Empty: unlimited or unknown.
[[nodiscard]] std::optional<Throttling> realtime_throttling();

}  // namespace redag::runtime
