// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/base/pi_mutex.hpp"

#include <gtest/gtest.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <fstream>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "redag/base/lock_guard.hpp"
#include "redag/base/mutex.hpp"
#include "redag/threads/parker.hpp"
#include "redag/threads/threads.hpp"

namespace redag {
namespace {

// A field of /proc/self/task/<thread>/stat, from 3 on.
std::string stat_field(long thread, int field) {
  std::ifstream file("/proc/self/task/" + std::to_string(thread) + "/stat");
  std::string text;
  std::getline(file, text);
  text = text.substr(text.rfind(')') + 2);
  for (; field > 3; --field) text = text.substr(text.find(' ') + 1);
  return text.substr(0, text.find(' '));
}

bool sleeps(long thread) { return stat_field(thread, 3) == "S"; }

// For real-time threads the kernel says minus (priority + 1), with inherited priority.
int kernel_priority(long thread) { return -std::stoi(stat_field(thread, 18)) - 1; }

TEST(PiMutex, ExcludesOthers) {
  for (const bool inherits : {false, true}) {
    PiMutex mutex(inherits);
    const std::lock_guard guard(mutex);
    bool taken = true;
    std::thread([&] { taken = mutex.try_lock(); }).join();
    EXPECT_FALSE(taken);
  }
}

// There are more threads than processors: some are preempted as owners, and others queue.
class PiMutexUnderContention : public testing::TestWithParam<bool> {};
INSTANTIATE_TEST_SUITE_P(, PiMutexUnderContention, testing::Bool(),
                         [](const auto &instance) { return instance.param ? "Inherits" : "DoesNotInherit"; });

TEST_P(PiMutexUnderContention, CountsRight) {
  PiMutex mutex(GetParam());
  int count = 0;
  const auto add = [&] {
    for (int i = 0; i < 10'000; ++i) {
      const std::lock_guard guard(mutex);
      ++count;
    }
  };
  std::vector<std::thread> threads;
  threads.reserve(8);
  for (int i = 0; i < 8; ++i) threads.emplace_back(add);
  for (std::thread &thread : threads) thread.join();
  EXPECT_EQ(count, 80'000);
}

// A thread that sleeps for the mutex gets it, however long the owner keeps it.
TEST_P(PiMutexUnderContention, WhoeverSleepsGetsItInTheEnd) {
  PiMutex mutex(GetParam());
  mutex.lock();
  std::atomic<int> served{0};
  std::array<std::atomic<long>, 3> ids{};
  std::vector<std::thread> sleepers;
  sleepers.reserve(ids.size());
  for (std::atomic<long> &id : ids) {
    sleepers.emplace_back([&] {
      id = syscall(SYS_gettid);
      EXPECT_FALSE(mutex.lock());
      ++served;
      mutex.unlock();
    });
  }
  for (const std::atomic<long> &id : ids) {
    while (id == 0 || !sleeps(id)) std::this_thread::yield();
  }
  EXPECT_EQ(served, 0);
  EXPECT_TRUE(mutex.unlock()) << "it woke a thread";
  for (std::thread &sleeper : sleepers) sleeper.join();
  EXPECT_EQ(served, 3);
  EXPECT_TRUE(mutex.try_lock());
  EXPECT_FALSE(mutex.unlock()) << "nobody slept";
}

// The kernel's id of the only thread of a child process is a new one.
TEST(PiMutex, WorksInAChildProcess) {
  PiMutex mutex;
  mutex.lock();
  mutex.unlock();
  const pid_t child = fork();
  if (child == 0) {
    mutex.lock();
    const bool is_mine = this_thread_id() == static_cast<std::uint32_t>(syscall(SYS_gettid));
    mutex.unlock();
    _exit(is_mine ? 0 : 1);
  }
  int status = 1;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_EQ(status, 0);
}

// The first waiter sleeps for the mutex, the second one in the queue behind it.
TEST(PiMutex, TheOwnerRunsAtThePriorityOfWhoeverWaits) {
#ifdef REDAG_NOMINAL_PRIORITIES
  GTEST_SKIP() << "with sanitizers priorities are nominal, and this is about the kernel's";
#endif
  if (runtime::available_fifo_priority(30) < 30) GTEST_SKIP() << "this process may not use SCHED_FIFO";
  PiMutex mutex;
  std::atomic<long> owner{0};
  runtime::Event let_go;
  std::thread low([&] {
    ASSERT_TRUE(runtime::set_fifo_priority(pthread_self(), 10));
    const std::lock_guard guard(mutex);
    owner = syscall(SYS_gettid);
    let_go.wait();
  });
  while (owner == 0) std::this_thread::yield();
  EXPECT_EQ(kernel_priority(owner), 10);
  std::vector<std::thread> waiters;
  for (const int priority : {20, 30}) {
    waiters.emplace_back([&mutex, priority] {
      ASSERT_TRUE(runtime::set_fifo_priority(pthread_self(), priority));
      const std::lock_guard guard(mutex);
    });
    while (kernel_priority(owner) != priority) std::this_thread::yield();
  }
  let_go.set();
  for (std::thread &waiter : waiters) waiter.join();
  low.join();
}

class LockClassDeathTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if constexpr (!kChecksLockClasses) GTEST_SKIP() << "only debug builds check this";
    ::testing::FLAGS_gtest_death_test_style = "threadsafe";
  }
};

TEST_F(LockClassDeathTest, AThreadThatMustReactTakesNoUnboundedLock) {
  PiMutex unbounded(LockClass::Unbounded);
  Mutex ordinary;
  { const LockGuard guard(unbounded); }
  EXPECT_DEATH(
      {
        const MustReact here;
        const LockGuard guard(unbounded);
      },
      "a thread that must react begins unbounded work, or waits for it");
  EXPECT_DEATH(
      {
        const MustReact here;
        const LockGuard guard(ordinary);
      },
      "a thread that must react");
  const MustReact here;
  PiMutex bounded(LockClass::Bounded);
  const LockGuard guard(bounded);
}

TEST_F(LockClassDeathTest, NothingUnboundedBeginsUnderABoundedLock) {
  PiMutex bounded(LockClass::Bounded);
  {
    const LockGuard guard(bounded);
    EXPECT_DEATH(begin_unbounded_work(), "unbounded work begins under a lock");
    Mutex ordinary;
    EXPECT_DEATH(ordinary.lock(), "unbounded work begins under a lock");
  }
  ASSERT_TRUE(bounded.try_lock());
  EXPECT_DEATH(begin_unbounded_work(), "unbounded work begins under a lock");
  bounded.unlock();
  begin_unbounded_work();
}

}  // namespace
}  // namespace redag
