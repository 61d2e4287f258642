// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Tests libredag_pi.so, which this program is linked against: every mutex inherits priority, and otherwise stays as it
// was.
#include "redag_rclcpp/inherit.h"

#include <gtest/gtest.h>
#include <pthread.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <fstream>
#include <functional>
#include <mutex>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "redag/threads/parker.hpp"
#include "redag/threads/threads.hpp"
#include "spinning.hpp"

namespace redag_rclcpp {
namespace {

using namespace std::chrono_literals;
using redag::runtime::Event;
using redag::runtime::set_fifo_priority;

/// The SCHED_FIFO priority at which the kernel now runs the thread, inherited or its own; 0: none.
int effective_priority(int thread) {
  constexpr int kPriorityField = 18;  // man 5 proc: -1 - priority for real-time threads
  std::ifstream file("/proc/self/task/" + std::to_string(thread) + "/stat");
  std::string text;
  std::getline(file, text);
  std::istringstream fields(text.substr(text.rfind(')') + 1));
  std::string field;
  for (int i = 3; i <= kPriorityField; ++i) fields >> field;
  const int priority = std::stoi(field);
  return priority < 0 ? -1 - priority : 0;
}

/// True if the owner of a mutex gets the priority of a waiting thread.
bool inherits(const std::function<void()> &lock, const std::function<void()> &unlock) {
  constexpr int kLow = 5;
  constexpr int kHigh = 20;
  std::atomic<int> owner_id{0};
  Event owned;
  Event release;
  std::thread owner([&] {
    EXPECT_TRUE(set_fifo_priority(pthread_self(), kLow));
    lock();
    owner_id = static_cast<int>(syscall(SYS_gettid));
    owned.set();
    release.wait();
    unlock();
  });
  owned.wait();
  std::atomic<bool> asks{false};
  std::atomic<bool> got{false};
  std::thread waiter([&] {
    EXPECT_TRUE(set_fifo_priority(pthread_self(), kHigh));
    asks = true;
    lock();
    got = true;
    unlock();
  });
  // The waiter sleeps soon after it has asked. By then the owner has its priority, or never gets it.
  const auto end = std::chrono::steady_clock::now() + 2s;
  bool inherited = false;
  while (!inherited && std::chrono::steady_clock::now() < end) {
    inherited = asks && effective_priority(owner_id) == kHigh;
    std::this_thread::sleep_for(1ms);
  }
  EXPECT_FALSE(got);
  release.set();
  owner.join();
  waiter.join();
  return inherited;
}

template <class Mutex>
bool inherits(Mutex &mutex) {
  return inherits([&] { mutex.lock(); }, [&] { mutex.unlock(); });
}

bool inherits(pthread_mutex_t &mutex) {
  return inherits([&] { EXPECT_EQ(pthread_mutex_lock(&mutex), 0); },
                  [&] { EXPECT_EQ(pthread_mutex_unlock(&mutex), 0); });
}

/// A mutex initialised with these attributes.
class Initialised {
 public:
  explicit Initialised(const std::function<void(pthread_mutexattr_t &)> &set, pthread_mutex_t *place = nullptr)
      : mutex_(place != nullptr ? *place : own_) {
    pthread_mutexattr_t attributes;
    EXPECT_EQ(pthread_mutexattr_init(&attributes), 0);
    set(attributes);
    EXPECT_EQ(pthread_mutex_init(&mutex_, &attributes), 0);
    int protocol = -1;
    EXPECT_EQ(pthread_mutexattr_getprotocol(&attributes, &protocol), 0);
    EXPECT_EQ(protocol, PTHREAD_PRIO_NONE) << "the caller's attributes were changed";
    pthread_mutexattr_destroy(&attributes);
  }
  ~Initialised() { pthread_mutex_destroy(&mutex_); }
  Initialised(const Initialised &) = delete;
  Initialised &operator=(const Initialised &) = delete;

  [[nodiscard]] pthread_mutex_t &get() { return mutex_; }

 private:
  pthread_mutex_t own_{};
  pthread_mutex_t &mutex_;
};

std::function<void(pthread_mutexattr_t &)> of_type(int type) {
  return [type](pthread_mutexattr_t &attributes) { EXPECT_EQ(pthread_mutexattr_settype(&attributes, type), 0); };
}

class Inheritance : public ::testing::Test {
 protected:
  void SetUp() override {
    if (redag::runtime::available_fifo_priority(20) < 20) GTEST_SKIP() << "SCHED_FIFO is not to be had here";
    ASSERT_EQ(redag_pi_enabled(), 1);
  }
};

TEST_F(Inheritance, OfMutexesOfTheStandardLibrary) {
  std::mutex plain;
  EXPECT_TRUE(inherits(plain));
  std::recursive_mutex recursive;
  EXPECT_TRUE(inherits(recursive));
  std::timed_mutex timed;
  EXPECT_TRUE(inherits(timed));
  std::recursive_timed_mutex recursive_timed;
  EXPECT_TRUE(inherits(recursive_timed));
}

TEST_F(Inheritance, OfMutexesWithStaticInitialisers) {
  pthread_mutex_t normal = PTHREAD_MUTEX_INITIALIZER;
  EXPECT_TRUE(inherits(normal));
  pthread_mutex_t recursive = PTHREAD_RECURSIVE_MUTEX_INITIALIZER_NP;
  EXPECT_TRUE(inherits(recursive));
  pthread_mutex_t checking = PTHREAD_ERRORCHECK_MUTEX_INITIALIZER_NP;
  EXPECT_TRUE(inherits(checking));
  pthread_mutex_t adaptive = PTHREAD_ADAPTIVE_MUTEX_INITIALIZER_NP;
  EXPECT_TRUE(inherits(adaptive));
}

TEST_F(Inheritance, OfMutexesInitialisedByACall) {
  pthread_mutex_t plain;
  ASSERT_EQ(pthread_mutex_init(&plain, nullptr), 0);
  EXPECT_TRUE(inherits(plain));
  pthread_mutex_destroy(&plain);
  for (const int type : {PTHREAD_MUTEX_NORMAL, PTHREAD_MUTEX_RECURSIVE, PTHREAD_MUTEX_ERRORCHECK}) {
    Initialised mutex(of_type(type));
    EXPECT_TRUE(inherits(mutex.get())) << type;
  }
}

TEST_F(Inheritance, BeginsWithAnyWayToLock) {
  std::mutex tried;
  EXPECT_TRUE(inherits(
      [&] {
        if (!tried.try_lock()) tried.lock();
      },
      [&] { tried.unlock(); }));
  std::timed_mutex timed;
  EXPECT_TRUE(inherits([&] { EXPECT_TRUE(timed.try_lock_for(kLimit)); }, [&] { timed.unlock(); }));
  std::timed_mutex until;
  const auto end = std::chrono::system_clock::now() + kLimit;
  EXPECT_TRUE(inherits([&] { EXPECT_TRUE(until.try_lock_until(end)); }, [&] { until.unlock(); }));
}

TEST(Inherit, ARecursiveMutexStaysRecursive) {
  std::recursive_mutex mutex;
  mutex.lock();
  mutex.lock();
  std::thread([&] { EXPECT_FALSE(mutex.try_lock()); }).join();
  mutex.unlock();
  std::thread([&] { EXPECT_FALSE(mutex.try_lock()); }).join();
  mutex.unlock();
  std::thread([&] {
    EXPECT_TRUE(mutex.try_lock());
    mutex.unlock();
  }).join();
}

TEST(Inherit, AnErrorCheckingMutexStillChecks) {
  Initialised mutex(of_type(PTHREAD_MUTEX_ERRORCHECK));
  ASSERT_EQ(pthread_mutex_lock(&mutex.get()), 0);
  EXPECT_EQ(pthread_mutex_lock(&mutex.get()), EDEADLK);
  std::thread([&] { EXPECT_EQ(pthread_mutex_unlock(&mutex.get()), EPERM); }).join();
  EXPECT_EQ(pthread_mutex_unlock(&mutex.get()), 0);
}

TEST(Inherit, ARobustMutexTellsOfAnOwnerThatDied) {
  Initialised mutex([](pthread_mutexattr_t &attributes) {
    EXPECT_EQ(pthread_mutexattr_setrobust(&attributes, PTHREAD_MUTEX_ROBUST), 0);
  });
  std::thread([&] { EXPECT_EQ(pthread_mutex_lock(&mutex.get()), 0); }).join();
  ASSERT_EQ(pthread_mutex_lock(&mutex.get()), EOWNERDEAD);
  EXPECT_EQ(pthread_mutex_consistent(&mutex.get()), 0);
  EXPECT_EQ(pthread_mutex_unlock(&mutex.get()), 0);
}

TEST(Inherit, ASharedMutexIsSharedWithAnotherProcess) {
  void *memory = mmap(nullptr, sizeof(pthread_mutex_t), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
  ASSERT_NE(memory, MAP_FAILED);
  {
    Initialised mutex(
        [](pthread_mutexattr_t &attributes) {
          EXPECT_EQ(pthread_mutexattr_setpshared(&attributes, PTHREAD_PROCESS_SHARED), 0);
        },
        static_cast<pthread_mutex_t *>(memory));
    int locked[2];
    int unlock[2];
    ASSERT_EQ(pipe(locked), 0);
    ASSERT_EQ(pipe(unlock), 0);
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      char byte = 0;
      bool works = pthread_mutex_lock(&mutex.get()) == 0 && write(locked[1], &byte, 1) == 1;
      works = works && read(unlock[0], &byte, 1) == 1 && pthread_mutex_unlock(&mutex.get()) == 0;
      _exit(works ? 0 : 1);
    }
    char byte = 0;
    ASSERT_EQ(read(locked[0], &byte, 1), 1);
    EXPECT_EQ(pthread_mutex_trylock(&mutex.get()), EBUSY);
    ASSERT_EQ(write(unlock[1], &byte, 1), 1);
    EXPECT_EQ(pthread_mutex_lock(&mutex.get()), 0);
    EXPECT_EQ(pthread_mutex_unlock(&mutex.get()), 0);
    int status = -1;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    EXPECT_EQ(status, 0);
    for (const int end : {locked[0], locked[1], unlock[0], unlock[1]}) close(end);
  }
  munmap(memory, sizeof(pthread_mutex_t));
}

TEST(Inherit, ATimedMutexIsNotHadInTimeAndThenIs) {
  std::timed_mutex mutex;
  mutex.lock();
  std::thread([&] {
    const auto start = std::chrono::steady_clock::now();
    EXPECT_FALSE(mutex.try_lock_for(20ms));
    EXPECT_GE(std::chrono::steady_clock::now() - start, 20ms);
  }).join();
  mutex.unlock();
  EXPECT_TRUE(mutex.try_lock_for(20ms));
  mutex.unlock();
}

TEST(Inherit, ConditionVariablesWork) {
  std::mutex mutex;
  std::condition_variable changed;
  int turn = 0;
  constexpr int kTurns = 2000;
  const auto play = [&](int parity) {
    for (;;) {
      std::unique_lock<std::mutex> lock(mutex);
      changed.wait(lock, [&] { return turn % 2 == parity || turn >= kTurns; });
      if (turn >= kTurns) return;
      ++turn;
      changed.notify_all();
    }
  };
  std::thread other(play, 1);
  play(0);
  other.join();
  EXPECT_EQ(turn, kTurns);
}

// The first lock changes the mutex's kind, here on several threads at once.
TEST(Inherit, ManyFirstLocksAtTheSameTime) {
  constexpr int kRounds = 3000;
  constexpr int kThreads = 4;
  std::vector<std::mutex> mutexes(kRounds);
  std::vector<int> counts(kRounds, 0);
  std::atomic<int> arrived{0};
  std::vector<std::thread> threads;
  for (int t = 0; t < kThreads; ++t) {
    threads.emplace_back([&] {
      for (int round = 0; round < kRounds; ++round) {
        ++arrived;
        while (arrived < kThreads * (round + 1)) std::this_thread::yield();
        for (int i = 0; i < 10; ++i) {
          const std::lock_guard<std::mutex> lock(mutexes[static_cast<std::size_t>(round)]);
          ++counts[static_cast<std::size_t>(round)];
        }
      }
    });
  }
  for (std::thread &thread : threads) thread.join();
  for (const int count : counts) ASSERT_EQ(count, 10 * kThreads);
}

/// True if, after `prepare` in a child process, the library leaves a fresh mutex unchanged.
bool is_left_alone(const std::function<void()> &prepare) {
  const pid_t child = fork();
  if (child == 0) {
    prepare();
    pthread_mutex_t fresh = PTHREAD_MUTEX_INITIALIZER;
    const int kind = fresh.__data.__kind;
    pthread_mutex_lock(&fresh);
    _exit(fresh.__data.__kind == kind && redag_pi_enabled() == 0 ? 0 : 1);
  }
  int status = -1;
  waitpid(child, &status, 0);
  return status == 0;
}

TEST(Inherit, CanBeTurnedOff) {
  EXPECT_FALSE(is_left_alone([] {}));
  EXPECT_TRUE(is_left_alone([] { redag_pi_disable(); }));
}

}  // namespace
}  // namespace redag_rclcpp
