// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/thread_priorities.hpp"

#include <algorithm>

#include "redag/base/check.hpp"

namespace redag::runtime {

ThreadPriorities::ThreadPriorities(std::size_t threads, int priority)
    : threads_(threads, Thread{.priority = priority}) {
  changes_.reserve(threads);
}

std::span<const ThreadPriorities::Change> ThreadPriorities::start(std::size_t thread, int priority, bool is_short) {
  REDAG_CHECK(!threads_[thread].started, "a thread has two jobs");
  threads_[thread].started = true;
  ++started_;
  threads_[thread].of_job = 0;
  return place(threads_[thread], priority, is_short);
}

std::span<const ThreadPriorities::Change> ThreadPriorities::change(std::size_t thread, int priority) {
  return place(threads_[thread], priority, false);
}

void ThreadPriorities::end(std::size_t thread) {
  threads_[thread].started = false;
  --started_;
  if (threads_[thread].of_job > 0) --realtime_;
}

std::span<const ThreadPriorities::Change> ThreadPriorities::wait(std::size_t thread, int priority) {
  Thread &self = threads_[thread];
  REDAG_CHECK(!self.started, "a thread that has a job waits for none");
  changes_.clear();
  self.of_job = priority;
  set(self);
  self.waited = true;
  return changes_;
}

std::span<const ThreadPriorities::Change> ThreadPriorities::place(Thread &self, int priority, bool is_short) {
  changes_.clear();
  if (self.of_job > 0) --realtime_;
  if (priority > 0) ++realtime_;
  self.of_job = priority;
  const bool all_run = started_ <= processors_;
  if (unordered_ && !all_run) {
    for (Thread &thread : threads_) {
      if (thread.started) set(thread);
    }
    unordered_ = false;
    return changes_;
  }
  // True for a started thread whose order with this one can differ from the order of their jobs, or of a job in
  // between.
  const auto overlaps = [&self](const Thread &other) {
    return &other != &self && other.started && other.of_job <= self.priority && self.of_job <= other.priority;
  };
  if (is_short && !self.waited && self.priority > self.of_job) {
    const bool ordered = std::none_of(threads_.begin(), threads_.end(), overlaps);
    if (ordered) return changes_;
    if (all_run) {
      unordered_ = true;
      return changes_;
    }
  }
  set(self);
  for (Thread &thread : threads_) {
    if (overlaps(thread)) set(thread);
  }
  return changes_;
}

void ThreadPriorities::set(Thread &thread) {
  thread.waited = false;
  if (thread.priority == thread.of_job) return;
  thread.priority = thread.of_job;
  changes_.push_back(Change{static_cast<std::size_t>(&thread - threads_.data()), thread.priority});
}

}  // namespace redag::runtime
