// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <gtest/gtest.h>
#include <unistd.h>

#include <csignal>
#include <stdexcept>

#include "redag/runtime/executor.hpp"
#include "tests/testing/one_worker.hpp"

namespace redag::runtime {
namespace {

using namespace std::chrono_literals;
using testing::one_worker;

#ifdef __SANITIZE_THREAD__
constexpr bool kSignalsAreHeldBack = true;
#else
constexpr bool kSignalsAreHeldBack = false;
#endif
constexpr const char *kHeldBack = "ThreadSanitizer holds a signal back while its thread waits in a system call";

volatile std::sig_atomic_t handled = 0;

// The handler of a signal while the object lives.
class Handler {
 public:
  Handler(int number, void (*handler)(int)) : number_(number) {
    struct sigaction action {};
    action.sa_handler = handler;
    sigaction(number, &action, &before_);
  }
  ~Handler() { sigaction(number_, &before_, nullptr); }
  Handler(const Handler &) = delete;
  Handler &operator=(const Handler &) = delete;

 private:
  int number_;
  struct sigaction before_ {};
};

void count(int) { handled = handled + 1; }

TEST(RunUntilSignal, StopsAndRestoresTheHandlers) {
  if (kSignalsAreHeldBack) GTEST_SKIP() << kHeldBack;
  for (const int number : {SIGINT, SIGTERM}) {
    const Handler own(number, count);
    handled = 0;
    Executor executor(one_worker());
    DagBuilder builder("dag");
    builder.timer("t", 1ms, [&] { kill(getpid(), number); });
    executor.add(std::move(builder));
    EXPECT_EQ(executor.run_until_signal(), number);
    EXPECT_EQ(handled, 0) << "the executor's handler takes the signal";
    raise(number);
    EXPECT_EQ(handled, 1) << "the previous handler is back";
  }
}

TEST(RunUntilSignal, ReturnsZeroIfItStopsOtherwise) {
  Executor executor(one_worker());
  DagBuilder builder("dag");
  builder.timer("t", 1ms, [&] { executor.stop(); });
  executor.add(std::move(builder));
  EXPECT_EQ(executor.run_until_signal({SIGUSR1}), 0);
}

TEST(RunUntilSignal, RestoresTheHandlersWhenABodyThrows) {
  const Handler own(SIGINT, count);
  handled = 0;
  Executor executor(one_worker());
  DagBuilder builder("dag");
  builder.timer("t", 1ms, [] { throw std::runtime_error("no scan"); });
  executor.add(std::move(builder));
  EXPECT_THROW(executor.run_until_signal(), std::runtime_error);
  raise(SIGINT);
  EXPECT_EQ(handled, 1);
}

TEST(RunUntilSignal, LeavesIgnoredSignalsIgnored) {
  const Handler ignored(SIGINT, SIG_IGN);
  Executor executor(one_worker());
  DagBuilder builder("dag");
  int jobs = 0;
  builder.timer("t", 1ms, [&] {
    kill(getpid(), SIGINT);
    if (++jobs == 3) executor.stop();
  });
  executor.add(std::move(builder));
  EXPECT_EQ(executor.run_until_signal(), 0);
  EXPECT_EQ(jobs, 3);
}

TEST(RunUntilSignal, IsForOneExecutorAtATime) {
  Executor executor(one_worker());
  Executor second(one_worker());
  DagBuilder builder("dag");
  bool refused = false;
  builder.timer("t", 1ms, [&] {
    try {
      second.run_until_signal();
    } catch (const std::logic_error &) {
      refused = true;
    }
    executor.stop();
  });
  executor.add(std::move(builder));
  executor.run_until_signal();
  EXPECT_TRUE(refused);
}

TEST(RunUntilSignal, RefusesASignalThatCannotBeHandled) {
  Executor executor(one_worker());
  EXPECT_THROW(executor.run_until_signal({SIGINT, SIGKILL}), std::invalid_argument);
}

TEST(RunUntilSignalDeathTest, ASecondSignalEndsAProcessWhoseBodyDoesNotReturn) {
  if (kSignalsAreHeldBack) GTEST_SKIP() << kHeldBack;
  ::testing::FLAGS_gtest_death_test_style = "threadsafe";
  EXPECT_EXIT(
      {
        Executor executor(one_worker());
        DagBuilder builder("dag");
        builder.timer("t", 1ms, [] {
          kill(getpid(), SIGINT);
          usleep(300'000);
          kill(getpid(), SIGINT);
          for (;;) pause();
        });
        executor.add(std::move(builder));
        executor.run_until_signal();
      },
      ::testing::KilledBySignal(SIGINT), "");
}

}  // namespace
}  // namespace redag::runtime
