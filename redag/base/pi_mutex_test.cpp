// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/base/pi_mutex.hpp"

#include <gtest/gtest.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <fstream>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "redag/runtime/parker.hpp"
#include "redag/runtime/threads.hpp"

namespace redag {
namespace {

TEST(PiMutex, ExcludesOthers) {
  PiMutex mutex;
  const std::lock_guard guard(mutex);
  bool taken = true;
  std::thread([&] { taken = mutex.try_lock(); }).join();
  EXPECT_FALSE(taken);
}

// There are more threads than processors: some are preempted as owners, and others queue.
TEST(PiMutex, CountsRightUnderContention) {
  PiMutex mutex;
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

// Field 18 of /proc/<pid>/stat: for real-time threads minus (priority + 1), with inherited priority.
int kernel_priority(long thread) {
  std::ifstream file("/proc/self/task/" + std::to_string(thread) + "/stat");
  std::string text;
  std::getline(file, text);
  text = text.substr(text.rfind(')') + 2);
  for (int field = 3; field < 18; ++field) text = text.substr(text.find(' ') + 1);
  return -std::stoi(text) - 1;
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

}  // namespace
}  // namespace redag
