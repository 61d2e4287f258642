// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/threads/thread_priorities.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <optional>
#include <span>
#include <vector>

namespace redag::runtime {
namespace {

constexpr int kFirst = 80;

// Models the kernel's priorities of the threads, and the threads' jobs.
struct Kernel {
  explicit Kernel(std::size_t count, std::size_t cpus)
      : processors(cpus), priorities(count, kFirst), threads(count, kFirst), jobs(count) {
    threads.set_processors(cpus);
  }

  void start(std::size_t thread, int priority, bool is_short) {
    jobs[thread] = priority;
    apply(threads.start(thread, priority, is_short));
    if (!is_short) {
      EXPECT_EQ(priorities[thread], priority);
    }
  }
  void change(std::size_t thread, int priority) {
    jobs[thread] = priority;
    apply(threads.change(thread, priority));
    EXPECT_EQ(priorities[thread], priority);
  }
  void end(std::size_t thread) {
    jobs[thread].reset();
    threads.end(thread);
  }
  void apply(std::span<const ThreadPriorities::Change> list) {
    for (const ThreadPriorities::Change &change : list) {
      EXPECT_NE(priorities[change.thread], change.priority) << "a change that is none";
      priorities[change.thread] = change.priority;
      ++changes;
    }
  }

  [[nodiscard]] bool all_run() const {
    return static_cast<std::size_t>(std::count_if(jobs.begin(), jobs.end(), [](auto &j) { return j.has_value(); })) <=
           processors;
  }
  // Returns true if the threads' priorities are in the order of their jobs' priorities.
  [[nodiscard]] bool ordered() const {
    for (std::size_t a = 0; a < jobs.size(); ++a) {
      for (std::size_t b = 0; b < jobs.size(); ++b) {
        if (!jobs[a] || !jobs[b]) continue;
        if ((*jobs[a] < *jobs[b]) != (priorities[a] < priorities[b])) return false;
      }
    }
    return true;
  }
  [[nodiscard]] bool none_below() const {
    for (std::size_t t = 0; t < jobs.size(); ++t) {
      if (jobs[t] && priorities[t] < *jobs[t]) return false;
    }
    return true;
  }

  std::size_t processors;
  std::vector<int> priorities;
  ThreadPriorities threads;
  std::vector<std::optional<int>> jobs;
  int changes = 0;
};

TEST(ThreadPriorities, ShortJobsOneAfterAnotherCostNothing) {
  Kernel kernel(3, 2);
  for (int i = 0; i < 10; ++i) {
    kernel.start(0, 70 - i, true);
    kernel.start(1, 60 + i, true);
    kernel.end(0);
    kernel.end(1);
  }
  EXPECT_EQ(kernel.changes, 0);
}

TEST(ThreadPriorities, ALongJobHasItsOwn) {
  Kernel kernel(1, 1);
  kernel.start(0, 10, false);
  EXPECT_EQ(kernel.priorities[0], 10);
}

TEST(ThreadPriorities, AJobMoreThanProcessorsPutsAllInOrder) {
  Kernel kernel(3, 2);
  kernel.start(0, 20, true);
  kernel.start(1, 10, true);
  EXPECT_EQ(kernel.changes, 0);
  kernel.start(2, 15, true);
  EXPECT_TRUE(kernel.ordered());
}

// The new job's own place is clear. But two jobs that each had a processor are not in order yet.
TEST(ThreadPriorities, AJobAboveAllOthersPutsThemInOrder) {
  Kernel kernel(3, 2);
  for (std::size_t thread = 0; thread < 2; ++thread) {
    kernel.start(thread, 50, false);
    kernel.end(thread);
  }
  kernel.start(0, 20, true);
  kernel.start(1, 10, true);
  EXPECT_FALSE(kernel.ordered());
  kernel.start(2, 70, true);
  EXPECT_TRUE(kernel.ordered());
}

TEST(ThreadPriorities, AShortJobAboveAPreemptedOneKeepsWhatItHas) {
  Kernel kernel(2, 1);
  kernel.start(0, 10, false);
  kernel.start(1, 50, true);
  const int changes = kernel.changes;
  kernel.end(1);
  kernel.start(1, 40, true);
  EXPECT_EQ(kernel.changes, changes);
  EXPECT_TRUE(kernel.ordered());
  kernel.change(0, 60);  // it inherits
  EXPECT_TRUE(kernel.ordered());
}

RC_GTEST_PROP(ThreadPriorities, MoreJobsThanProcessorsAreAlwaysInOrder, ()) {
  const auto count = *rc::gen::inRange<std::size_t>(1, 6);
  Kernel kernel(count, *rc::gen::inRange<std::size_t>(1, 4));
  for (int steps = *rc::gen::inRange(1, 60); steps > 0; --steps) {
    const auto thread = *rc::gen::inRange<std::size_t>(0, count);
    const int priority = *rc::gen::inRange(0, *rc::gen::element(5, kFirst));
    if (!kernel.jobs[thread]) {
      kernel.start(thread, priority, *rc::gen::arbitrary<bool>());
    } else if (*rc::gen::inRange(0, 4) == 0) {
      kernel.change(thread, priority);
    } else {
      kernel.end(thread);
    }
    RC_ASSERT(kernel.none_below());
    RC_ASSERT(kernel.all_run() || kernel.ordered());
  }
}

// Both maps from level to priority are monotone, as those before and after a change of a common order.
RC_GTEST_PROP(PriorityMoves, NeverInvertAnOrder, ()) {
  const auto descending = [](std::size_t count) {
    std::vector<int> priorities(count);
    for (int &priority : priorities) priority = *rc::gen::inRange(2, 12);
    std::sort(priorities.rbegin(), priorities.rend());
    return priorities;
  };
  const auto levels = *rc::gen::inRange<std::size_t>(1, 8);
  const std::vector<int> from = descending(levels);
  const std::vector<int> to = descending(levels);
  std::vector<PriorityMove> moves;
  for (std::size_t thread = *rc::gen::inRange<std::size_t>(1, 12); thread > 0; --thread) {
    const auto level = *rc::gen::inRange<std::uint32_t>(0, static_cast<std::uint32_t>(levels));
    moves.push_back({thread, level, from[level], to[level]});
  }
  sort_without_inversion(moves);
  std::vector<int> now;
  for (const PriorityMove &move : moves) now.push_back(move.from);
  for (std::size_t step = 0; step < moves.size(); ++step) {
    now[step] = moves[step].to;
    for (std::size_t a = 0; a < moves.size(); ++a) {
      for (std::size_t b = 0; b < moves.size(); ++b) {
        RC_ASSERT(moves[a].level >= moves[b].level || now[a] >= now[b]);
      }
    }
  }
}

}  // namespace
}  // namespace redag::runtime
