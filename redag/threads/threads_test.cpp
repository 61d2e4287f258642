// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/threads/threads.hpp"

#include <gtest/gtest.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdint>
#include <thread>
#include <vector>

#include "redag/threads/setup.hpp"

namespace redag::runtime {
namespace {

TEST(Threads, SetUpGivesNameProcessorsAndTimerSlack) {
  const int cpu = usable_cpus().back();
  std::thread([&] {
    const Result<void> done = set_up_this_thread(ThreadSetup{"a name that is too long", 0, {cpu}});
    ASSERT_TRUE(done) << to_string(done.error());
    char name[16] = {};
    pthread_getname_np(pthread_self(), name, sizeof name);
    EXPECT_STREQ(name, "a name that is ");
    EXPECT_EQ(usable_cpus(), std::vector<int>{cpu});
    EXPECT_EQ(prctl(PR_GET_TIMERSLACK), 1);
    EXPECT_EQ(fifo_priority(pthread_self()), 0);
  }).join();
}

TEST(Threads, AProcessorThatIsNotThereIsAnErrorWithAHint) {
  std::thread([] {
    const Result<void> done = set_up_this_thread(ThreadSetup{"t", 0, {1023}});
    ASSERT_FALSE(done);
    EXPECT_NE(done.error()[0].hint.find("usable processors"), std::string::npos);
    EXPECT_FALSE(set_up_this_thread(ThreadSetup{"t", 0, {-1}}));
  }).join();
}

TEST(Threads, FifoPriorityIsSetWhereItIsAvailable) {
  const int priority = available_fifo_priority(7);
  if (priority == 0) GTEST_SKIP() << "this process may not use SCHED_FIFO";
  EXPECT_EQ(fifo_priority(pthread_self()), 0);  // tried on another thread
  std::thread([&] {
    ASSERT_TRUE(set_up_this_thread(ThreadSetup{"t", priority, {}}));
    EXPECT_EQ(fifo_priority(pthread_self()), priority);
  }).join();
}

TEST(Threads, TakeNoSignalsButThoseOfTheirOwnMistakes) {
  sigset_t of_thread;
  Result<ThreadHandle> thread =
      start_thread(ThreadSetup{"t", 0, {}}, [&] { pthread_sigmask(SIG_SETMASK, nullptr, &of_thread); });
  ASSERT_TRUE(thread);
  thread->join();
  for (const int number : {SIGINT, SIGTERM, SIGHUP, SIGALRM, SIGUSR1, SIGCHLD, SIGPROF, SIGRTMIN, SIGRTMAX}) {
    EXPECT_EQ(sigismember(&of_thread, number), 1) << number;
  }
  for (const int number : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGTRAP, SIGSYS, SIGABRT}) {
    EXPECT_EQ(sigismember(&of_thread, number), 0) << number;
  }
  sigset_t of_caller;
  pthread_sigmask(SIG_SETMASK, nullptr, &of_caller);
  EXPECT_EQ(sigismember(&of_caller, SIGUSR1), 0) << "the caller's own are as before";
}

// A helper program that a body starts must end when the robot does.
TEST(Threads, ProgramsThatTheyStartTakeSignals) {
  int blocked = -1;
  Result<ThreadHandle> thread = start_thread(ThreadSetup{"t", 0, {}}, [&] {
    const pid_t child = ::fork();
    if (child == 0) {
      sigset_t mask;
      pthread_sigmask(SIG_SETMASK, nullptr, &mask);
      ::_exit(sigismember(&mask, SIGTERM) == 1 || prctl(PR_GET_TIMERSLACK) == 1 ? 1 : 0);
    }
    int status = 0;
    ::waitpid(child, &status, 0);
    blocked = WEXITSTATUS(status);
  });
  ASSERT_TRUE(thread);
  thread->join();
  EXPECT_EQ(blocked, 0);
}

TEST(Threads, SayWhereTheyRun) {
  const int cpu = usable_cpus().front();
  ProcessorWord word = nullptr;
  Result<ThreadHandle> thread = start_thread(ThreadSetup{"t", 0, {cpu}, 0, &word}, [&] {
    if (word != nullptr) {
      EXPECT_EQ(processor_of(word), cpu);
    }
  });
  ASSERT_TRUE(thread);
  thread->join();
  EXPECT_LT(processor_of(nullptr), 0);
}

constexpr PriorityBand kBand{80, 90};

TEST(Threads, AThreadIsNoLongerUrgentWhenItsWorkIsDone) {
  if (available_fifo_priority(7) == 0) GTEST_SKIP() << "this process may not use SCHED_FIFO";
  static int at_work = -1;
  static int at_its_end = -1;
  struct AtItsEnd {
    ~AtItsEnd() { at_its_end = fifo_priority(pthread_self()); }
  };
  Result<ThreadHandle> thread = start_thread(ThreadSetup{"t", 7, {}}, [] {
    thread_local const AtItsEnd kOwned;
    (void)kOwned;
    at_work = fifo_priority(pthread_self());
  });
  ASSERT_TRUE(thread) << to_string(thread.error());
  thread->join();
  EXPECT_EQ(at_work, 7);
  EXPECT_EQ(at_its_end, 0);
}

TEST(Threads, ComeBeforeOrdinaryThreadsForAWhile) {
  if (available_fifo_priority(5) < 5) GTEST_SKIP() << "this process may not use SCHED_FIFO 5";
  std::thread([] {
    int inherited = 0;
    {
      const BeforeOrdinaryThreads promptly(true);
      EXPECT_EQ(fifo_priority(pthread_self()), 1);
      { const BeforeOrdinaryThreads again(true); }
      EXPECT_EQ(fifo_priority(pthread_self()), 1);
      std::thread([&] { inherited = fifo_priority(pthread_self()); }).join();
    }
    EXPECT_EQ(inherited, 1);
    EXPECT_EQ(fifo_priority(pthread_self()), 0);
    {
      const BeforeOrdinaryThreads unwanted(false);
      EXPECT_EQ(fifo_priority(pthread_self()), 0);
    }
    ASSERT_TRUE(set_fifo_priority(pthread_self(), 5));
    {
      const BeforeOrdinaryThreads promptly(true);
      EXPECT_EQ(fifo_priority(pthread_self()), 5) << "a real-time thread keeps its priority";
    }
    EXPECT_EQ(fifo_priority(pthread_self()), 5);
  }).join();
}

// A thread that is started is ordinary again at its end, and so is the one that started it.
TEST(Threads, AStartLeavesTheCallerAsItWas) {
  if (available_fifo_priority(7) < 7) GTEST_SKIP() << "this process may not use SCHED_FIFO 7";
  std::thread([] {
    int seen = 0;
    Result<ThreadHandle> thread = start_thread(ThreadSetup{"t", 7, {}}, [&] { seen = fifo_priority(pthread_self()); });
    ASSERT_TRUE(thread) << to_string(thread.error());
    thread->join();
    EXPECT_EQ(seen, 7);
    EXPECT_EQ(fifo_priority(pthread_self()), 0);
    Result<ThreadHandle> ordinary =
        start_thread(ThreadSetup{"u", 0, {}}, [&] { seen = fifo_priority(pthread_self()); });
    ASSERT_TRUE(ordinary);
    ordinary->join();
    EXPECT_EQ(seen, 0);
  }).join();
}

TEST(Threads, StartSideBySide) {
  std::atomic<int> ran{0};
  ThreadStart first(ThreadSetup{"first", 0, {}}, [&] { ++ran; });
  ThreadStart refused(ThreadSetup{"refused", 0, {100000}}, [&] { ran += 100; });
  ThreadStart last(ThreadSetup{"last", 0, {}}, [&] { ++ran; });
  EXPECT_TRUE(refused.created());
  Result<ThreadHandle> one = first.finish();
  Result<ThreadHandle> none = refused.finish();
  Result<ThreadHandle> two = last.finish();
  ASSERT_TRUE(one);
  ASSERT_TRUE(two);
  one->join();
  two->join();
  EXPECT_EQ(ran, 2);
  ASSERT_FALSE(none);
  EXPECT_NE(to_string(none.error()).find("processor 100000"), std::string::npos);
}

/// Counts the pages below the caller's frame on its stack that are in memory.
std::size_t resident_pages_below(std::size_t bytes) {
  const auto page = static_cast<std::uintptr_t>(sysconf(_SC_PAGESIZE));
  const auto here = reinterpret_cast<std::uintptr_t>(__builtin_frame_address(0)) / page * page;
  std::vector<unsigned char> resident(bytes / page);
  EXPECT_EQ(mincore(reinterpret_cast<void *>(here - bytes), bytes, resident.data()), 0);
  return static_cast<std::size_t>(std::count_if(resident.begin(), resident.end(), [](auto r) { return (r & 1) != 0; }));
}

TEST(Threads, TouchTheirStackWhereThatIsAskedFor) {
  constexpr std::size_t kLooked = std::size_t{192} << 10;
  const std::size_t all = kLooked / static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
  const auto resident_with = [&](std::size_t touched) {
    std::size_t resident = 0;
    Result<ThreadHandle> thread =
        start_thread({"stack", 0, {}, touched}, [&] { resident = resident_pages_below(kLooked); });
    EXPECT_TRUE(thread) << to_string(thread.error());
    thread->join();
    return resident;
  };
  EXPECT_EQ(resident_with(kTouchedStack), all);
  EXPECT_EQ(resident_with(std::size_t{1} << 40), all) << "more than there is";
}

TEST(ResolveMode, AutoTakesOsWhereItCanAndSaysWhy) {
  const auto with_rights = resolve_mode(PreemptionMode::Auto, PolicyKind::RateMonotonic, kBand);
  ASSERT_TRUE(with_rights);
  EXPECT_EQ(with_rights->mode, PreemptionMode::Os);
  EXPECT_EQ(with_rights->reason, "auto: this process may use SCHED_FIFO");

  const auto without = resolve_mode(PreemptionMode::Auto, PolicyKind::RateMonotonic, {});
  ASSERT_TRUE(without);
  EXPECT_EQ(without->mode, PreemptionMode::Cooperative);
  EXPECT_EQ(without->reason, "auto: this process may not use SCHED_FIFO");

  const auto dynamic = resolve_mode(PreemptionMode::Auto, PolicyKind::Edf, kBand);
  ASSERT_TRUE(dynamic);
  EXPECT_EQ(dynamic->mode, PreemptionMode::Cooperative);
  EXPECT_EQ(dynamic->reason, "auto: policy edf gives priorities to jobs, but the kernel schedules threads");
}

TEST(ResolveMode, OsWithoutRightsIsAnErrorThatSaysHowToGetThem) {
  const auto refused = resolve_mode(PreemptionMode::Os, PolicyKind::RateMonotonic, {});
  ASSERT_FALSE(refused);
  for (const char *way : {"rtprio", "CAP_SYS_NICE", "redag doctor"}) {
    EXPECT_NE(refused.error()[0].hint.find(way), std::string::npos) << way;
  }
  const auto dynamic = resolve_mode(PreemptionMode::Os, PolicyKind::Fifo, kBand);
  ASSERT_FALSE(dynamic);
  EXPECT_NE(dynamic.error()[0].hint.find("static policy"), std::string::npos);
  EXPECT_TRUE(resolve_mode(PreemptionMode::None, PolicyKind::Fifo, {}));
}

TEST(ResolveMode, TheMostUrgentLevelHasTheTopPriorityAndTheLastOneIsValid) {
  EXPECT_EQ(kBand.of_level(0), 80);
  EXPECT_EQ(kBand.of_level(kBand.levels() - 1), 2);
  EXPECT_EQ(kBand.of_level(kBand.levels()), 1) << "of demoted jobs";
  const PriorityBand band = probe_priority_band();
  EXPECT_TRUE(band.top_job == 0 || band.timer > band.top_job);
}

TEST(PriorityBand, ReleasesComeAfterMoreUrgentJobsOfOthers) {
  EXPECT_EQ(kBand.of_releases(), 90);
  const auto with_levels = [](std::vector<int> priorities) {
    PriorityBand band = kBand;
    band.given = std::move(priorities);
    return band;
  };
  EXPECT_EQ(with_levels({80, 70}).of_releases(), 90) << "its own jobs are the most urgent ones";
  EXPECT_EQ(with_levels({79, 70}).of_releases(), 80);
  EXPECT_EQ(with_levels({2}).of_releases(), 3);
}

TEST(Setup, TheTimerOutranksWorkersThatInheritAPriority) {
  if (available_fifo_priority(8) < 8) GTEST_SKIP() << "this process may not use SCHED_FIFO 8";
  for (const PreemptionMode mode : {PreemptionMode::None, PreemptionMode::Cooperative}) {
    const auto setup = set_up({.preemption = mode, .workers = 1});
    ASSERT_TRUE(setup);
    EXPECT_EQ(setup->timer_priority(), 0);
    EXPECT_EQ(setup->top_job_priority(), 0);
    std::thread([&] {
      ASSERT_TRUE(set_fifo_priority(pthread_self(), 7));
      EXPECT_EQ(setup->timer_priority(), 8);
      EXPECT_EQ(setup->top_job_priority(), 7);
    }).join();
  }
}

TEST(MissingProcessors, AreThoseThatWorkersShare) {
  EXPECT_EQ(missing_processors(2, 2), "");
  EXPECT_NE(missing_processors(4, 2), "");
}

}  // namespace
}  // namespace redag::runtime
