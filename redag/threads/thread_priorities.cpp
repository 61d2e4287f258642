// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/threads/thread_priorities.hpp"

#include <algorithm>

#include "redag/base/check.hpp"

namespace redag::runtime {

ThreadPriorities::ThreadPriorities(std::size_t threads, int priority)
    : threads_(threads, Thread{.priority = priority}) {
  raised_.reserve(threads);
  changes_.reserve(threads);
}

std::span<const ThreadPriorities::Change> ThreadPriorities::start(std::size_t thread, int priority, bool is_short) {
  Thread &self = threads_[thread];
  REDAG_CHECK(!self.started, "a thread has two jobs");
  self.started = true;
  ++started_;
  return place(self, priority, is_short);
}

std::span<const ThreadPriorities::Change> ThreadPriorities::change(std::size_t thread, int priority) {
  return follow(thread, priority, false);
}

void ThreadPriorities::end(std::size_t thread) {
  leave(threads_[thread]);
  threads_[thread].started = false;
  --started_;
}

std::span<const ThreadPriorities::Change> ThreadPriorities::end_and_place(Thread &self, int priority, bool is_short) {
  leave(self);
  return place(self, priority, is_short);
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
  self.of_job = priority;
  const bool all_run = started_ <= processors_;
  if (unordered_ && !all_run) {
    set(self);
    lower_raised([](const Thread &) { return true; });
    unordered_ = false;
  } else if (!(is_short && !self.waited && self.priority > priority && may_keep(self, all_run))) {
    set(self);
    lower_raised([&self](const Thread &other) { return overlaps(self, other); });
  }
  enter(self);
  return changes_;
}

// Returns true if the thread, which is not among the others yet, can keep a priority above that of its job.
bool ThreadPriorities::may_keep(const Thread &self, bool all_run) {
  if (unordered_ || started_ == 1) return true;  // place() has dealt with unordered ones that do not all run
  if (!overlaps_any(self)) return true;
  unordered_ = all_run;
  return all_run;
}

// Returns true if the order of the thread with another started one can differ from the order of their jobs, or of a job
// in between.
bool ThreadPriorities::overlaps_any(const Thread &self) const {
  return exact_.any(self.of_job, self.priority) ||
         std::any_of(raised_.begin(), raised_.end(), [&self](const Thread *other) { return overlaps(self, *other); });
}

template <class Predicate>
void ThreadPriorities::lower_raised(Predicate which) {
  for (std::size_t i = 0; i < raised_.size();) {
    Thread &thread = *raised_[i];
    if (!which(thread)) {
      ++i;
      continue;
    }
    leave(thread);
    set(thread);
    enter(thread);
  }
}

void ThreadPriorities::enter(Thread &thread) {
  if (thread.priority == thread.of_job) return exact_.add(thread.priority);
  thread.place = static_cast<std::uint32_t>(raised_.size());
  raised_.push_back(&thread);
}

void ThreadPriorities::leave(const Thread &thread) {
  if (thread.priority == thread.of_job) return exact_.remove(thread.priority);
  raised_.back()->place = thread.place;
  raised_[thread.place] = raised_.back();
  raised_.pop_back();
}

void ThreadPriorities::set(Thread &thread) {
  thread.waited = false;
  if (thread.priority == thread.of_job) return;
  thread.priority = thread.of_job;
  changes_.push_back(Change{static_cast<std::size_t>(&thread - threads_.data()), thread.priority});
}

void sort_without_inversion(std::span<PriorityMove> moves) {
  const auto falls = [](const PriorityMove &move) { return move.to < move.from; };
  std::sort(moves.begin(), moves.end(), [&](const PriorityMove &a, const PriorityMove &b) {
    if (falls(a) != falls(b)) return falls(b);
    return falls(a) ? a.level > b.level : a.level < b.level;
  });
}

}  // namespace redag::runtime
