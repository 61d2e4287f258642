// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/executor.hpp"

#include <gtest/gtest.h>
#include <pthread.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <string>
#include <thread>
#include <vector>

#include "redag/engine/preemption_point.hpp"
#include "redag/threads/parker.hpp"
#include "tests/testing/one_worker.hpp"

namespace redag::runtime {
namespace {

using namespace std::chrono_literals;
using testing::one_worker;

TEST(Executor, RunsAChainUntilABodyStopsIt) {
  Executor executor(one_worker());
  int imu_jobs = 0;
  int ekf_jobs = 0;
  DagBuilder control("control");
  const TaskHandle imu = control.timer("imu", 1ms, [&] { ++imu_jobs; }, {.wcet = 300us});
  control.data("ekf", {imu}, [&] {
    if (++ekf_jobs == 5) executor.stop();  // in a body this only requests the stop
  });
  const DagId dag = executor.add(std::move(control));
  executor.run();
  EXPECT_EQ(ekf_jobs, 5);
  EXPECT_GE(imu_jobs, 5);
  const std::vector<TaskStats> stats = executor.stats(dag);
  ASSERT_EQ(stats.size(), 2U);
  EXPECT_EQ(stats[1].task, "control.ekf");
  EXPECT_EQ(stats[1].jobs.finished, 5U);
  EXPECT_EQ(stats[1].usage.jobs, 5U);
}

TEST(Executor, WorkersCanLookForJobsBeforeTheySleep) {
  for (const PreemptionMode mode : {PreemptionMode::None, PreemptionMode::Cooperative}) {
    ExecutorOptions options;
    options.workers = 2;
    options.preemption = mode;
    options.spin = 200us;  // some jobs are posted to a thread that spins, others to one that sleeps
    Executor executor(options);
    std::atomic<int> left{0};
    std::atomic<int> right{0};
    DagBuilder dag("dag");
    const TaskHandle source = dag.timer("source", 1ms, [] {});
    const TaskHandle a = dag.data("a", {source}, [&] { ++left; });
    const TaskHandle b = dag.data("b", {source}, [&] { ++right; });
    int joined = 0;
    dag.data("join", {a, b}, [&] {
      if (++joined == 50) executor.stop();
    });
    executor.add(std::move(dag));
    executor.run();
    EXPECT_EQ(joined, 50);
    EXPECT_GE(left.load(), 50);
    EXPECT_GE(right.load(), 50);
    for (const std::string &warning : executor.warnings()) EXPECT_EQ(warning.find("do not spin"), std::string::npos);
  }
}

TEST(Executor, RealTimeWorkersSleepAtOnceAndItSaysSo) {
  ExecutorOptions options = one_worker(PreemptionMode::Auto);
  options.spin = 200us;
  Executor executor(options);
  const std::vector<std::string> warnings = executor.warnings();
  const bool said = std::any_of(warnings.begin(), warnings.end(),
                                [](const auto &text) { return text.find("do not spin") != std::string::npos; });
  EXPECT_EQ(said, executor.mode().mode == PreemptionMode::Os);
}

TEST(Executor, RunForEndsByItselfAndOnlyOnce) {
  Executor executor(one_worker());
  executor.run_for(5ms);
  EXPECT_TRUE(executor.stopping());
  EXPECT_THROW(executor.run(), std::logic_error);
  executor.stop();
}

TEST(Executor, AnExceptionStopsItAndComesOutOfRun) {
  Executor executor(one_worker());
  DagBuilder dag("dag");
  dag.timer("bad", 1ms, [] { throw std::out_of_range("sensor"); });
  executor.add(std::move(dag));
  EXPECT_THROW(executor.run(), std::out_of_range);
}

TEST(Executor, AHandlerCanLetItGoOn) {
  ExecutorOptions options = one_worker();
  int handled = 0;
  options.on_exception = [&](const ExceptionInfo &info) {
    EXPECT_EQ(info.task, "dag.bad");
    EXPECT_THROW(std::rethrow_exception(info.exception), std::runtime_error);
    ++handled;
    return OnException::Continue;
  };
  Executor executor(options);
  int successors = 0;
  DagBuilder builder("dag");
  int jobs = 0;
  const TaskHandle bad = builder.timer("bad", 1ms, [&] {
    if (++jobs == 4) executor.request_stop();
    throw std::runtime_error("again");
  });
  builder.data("after", {bad}, [&] { ++successors; });
  const DagId dag = executor.add(std::move(builder));
  executor.run();
  EXPECT_EQ(handled, 4);
  EXPECT_EQ(successors, 0);
  EXPECT_EQ(executor.stats(dag)[0].jobs.aborted, 4U);
}

TEST(Executor, DagsComeAndGoWhileItRunsAlsoFromBodies) {
  for (const PreemptionMode mode : {PreemptionMode::None, PreemptionMode::Cooperative, PreemptionMode::Auto}) {
    ExecutorOptions options;
    options.workers = 2;
    options.preemption = mode;
    Executor executor(options);
    std::atomic<int> visits{0};
    auto owned = std::make_shared<int>(0);
    int rounds = 0;
    DagBuilder load("load");
    for (int i = 0; i < 3; ++i) {
      load.timer("spin" + std::to_string(i), 1ms, [] {
        while (job_cpu_time() < 100 * kMicrosecond) preemption_point();
      });
    }
    executor.add(std::move(load));
    DagBuilder manager("manager");
    DagId last;
    manager.timer("manage", 1ms, [&] {
      if (last.valid()) executor.remove(last);
      if (++rounds == 30) return executor.stop();
      DagBuilder visitor("visitor" + std::to_string(rounds));
      const TaskHandle first = visitor.timer("first", 1ms, [&visits, owned] { ++visits; });
      visitor.data("second", {first}, [&visits, owned] { ++visits; });
      last = executor.add(std::move(visitor));
    });
    executor.add(std::move(manager));
    executor.run();
    EXPECT_EQ(rounds, 30);
    EXPECT_EQ(owned.use_count(), 1) << "bodies of removed DAGs are destroyed";
  }
}

// Without a trace, memory does not grow with the number of former DAGs. A trace needs ids that name one task for ever.
TEST(Executor, WhatWasRemovedMakesRoom) {
  for (const bool traced : {false, true}) {
    ExecutorOptions options = one_worker();
    options.trace_capacity = traced ? 64 : 0;
    Executor executor(options);
    const auto dag = [](int number) {
      DagBuilder builder("dag" + std::to_string(number));
      const TaskHandle first = builder.timer("first", 1s, [] {});
      builder.data("second", {first}, [] {});
      return builder;
    };
    constexpr std::uint32_t kDags = 100;
    DagId last;
    for (std::uint32_t number = 0; number < kDags; ++number) {
      if (last.valid()) {
        executor.remove(last);
        EXPECT_EQ(executor.stats(last).size(), 2U) << "nobody has its place yet";
      }
      last = executor.add(dag(static_cast<int>(number)));
      EXPECT_EQ(last, DagId(number));
      EXPECT_EQ(executor.stats(last)[1].task, "dag" + std::to_string(number) + ".second");
    }
    EXPECT_EQ(executor.task_name(TaskId(2 * kDags - 1)), traced ? "dag99.second" : "task 199");
    EXPECT_EQ(executor.task_name(TaskId(2)), traced ? "dag1.first" : "task 2");
    if (traced) {
      EXPECT_EQ(executor.stats(DagId(0))[0].task, "dag0.first");
    } else {
      EXPECT_THROW(static_cast<void>(executor.stats(DagId(0))), std::out_of_range);
    }
    executor.remove(DagId(0));  // a second call does nothing
    EXPECT_EQ(executor.stats(last).size(), 2U);
    EXPECT_THROW(executor.remove(DagId(kDags)), std::out_of_range);
    EXPECT_THROW(static_cast<void>(executor.stats(DagId(kDags))), std::out_of_range);
  }
}

// Another DAG takes the slot of its sibling while a job of the removed DAG is in progress.
TEST(Executor, AJobOfARemovedDagKeepsItsName) {
  std::vector<std::string> failed;
  ExecutorOptions options = one_worker();
  options.on_exception = [&](const ExceptionInfo &info) {
    failed.push_back(info.task);
    return OnException::Stop;
  };
  Executor executor(options);
  DagId self;
  DagBuilder dag("removed");
  const TaskHandle first = dag.timer("runs", 1ms, [&] {
    executor.remove(self);
    DagBuilder other("other");
    other.timer("alone", 1h, [] {});
    EXPECT_EQ(executor.stats(executor.add(std::move(other)))[0].task, "other.alone");
    EXPECT_EQ(executor.task_name(TaskId(1)), "other.alone");
    EXPECT_THROW(static_cast<void>(executor.stats(self)), std::out_of_range) << "figures of another DAG are given";
    throw std::runtime_error("while it ends");
  });
  dag.data("waits", {first}, [] {});
  self = executor.add(std::move(dag));
  EXPECT_THROW(executor.run(), std::runtime_error);
  EXPECT_EQ(failed, std::vector<std::string>{"removed.runs"});
}

TEST(Executor, ABodyThatRemovesItsOwnDagFinishes) {
  Executor executor(one_worker());
  auto owned = std::make_shared<int>(0);
  DagId self;
  DagBuilder dag("dag");
  dag.timer("only", 1ms, [&executor, &self, owned] {
    executor.remove(self);
    EXPECT_GE(owned.use_count(), 2);  // the captures are still alive
    executor.stop();
  });
  self = executor.add(std::move(dag));
  executor.run();
  EXPECT_EQ(executor.stats(self)[0].jobs.finished, 1U);
  EXPECT_EQ(owned.use_count(), 1);
}

TEST(Executor, StopFromAnotherThreadWaitsForTheBodies) {
  Executor executor(one_worker());
  Event begun;
  std::atomic<bool> ended{false};
  DagBuilder dag("dag");
  dag.timer("long", 1s, [&] {
    begun.set();
    while (!executor.stopping()) std::this_thread::yield();
    ended = true;
  });
  executor.add(std::move(dag));
  executor.start();
  begun.wait();
  executor.stop();
  EXPECT_TRUE(ended);
}

TEST(Executor, ABodyThatDoesNotReturnIsNamed) {
  ExecutorOptions options = one_worker();
  options.stop_timeout = 1ms;
  Event begun;
  Event go;
  Executor executor(options);
  DagBuilder dag("dag");
  dag.timer("stuck", 1s, [&] {
    begun.set();
    go.wait();
  });
  executor.add(std::move(dag));
  executor.start();
  begun.wait();
  try {
    executor.stop();
    FAIL() << "stop() returned while a body was running";
  } catch (const std::runtime_error &error) {
    EXPECT_NE(std::string(error.what()).find("dag.stuck"), std::string::npos) << error.what();
  }
  go.set();
}

// While it lives, threads cannot be created: their stacks would have a size that no machine has.
class NoRoomForThreads {
 public:
  NoRoomForThreads() {
    pthread_getattr_default_np(&before_);
    pthread_attr_t huge;
    pthread_attr_init(&huge);
    EXPECT_EQ(pthread_attr_setstacksize(&huge, std::size_t{1} << 50U), 0);
    EXPECT_EQ(pthread_setattr_default_np(&huge), 0);
    pthread_attr_destroy(&huge);
  }
  ~NoRoomForThreads() {
    pthread_setattr_default_np(&before_);
    pthread_attr_destroy(&before_);
  }
  NoRoomForThreads(const NoRoomForThreads &) = delete;
  NoRoomForThreads &operator=(const NoRoomForThreads &) = delete;

 private:
  pthread_attr_t before_{};
};

TEST(Executor, StartsOnceThreadsCanBeHad) {
  ExecutorOptions options = one_worker();
  options.watchdog = WatchdogOptions{{kSecond, 0}, 10 * kMillisecond};
  Executor executor(options);
  DagBuilder dag("dag");
  dag.timer("stop", 1ms, [&] { executor.request_stop(); });
  executor.add(std::move(dag));
  {
    const NoRoomForThreads none;
    EXPECT_THROW(executor.start(), std::runtime_error);
    EXPECT_THROW(executor.run(), std::runtime_error);
  }
  EXPECT_FALSE(executor.stopping());
  executor.run();
  EXPECT_THROW(executor.start(), std::logic_error);
}

TEST(Executor, CanBeDestroyedAfterItCouldNotStart) {
  Executor executor(one_worker());
  const NoRoomForThreads none;
  EXPECT_THROW(executor.run(), std::runtime_error);
}

Executor *interrupted_executor = nullptr;

TEST(Executor, RequestStopWorksFromASignalHandler) {
  Executor executor(one_worker());
  interrupted_executor = &executor;
  auto *const old = std::signal(SIGUSR1, [](int) { interrupted_executor->request_stop(); });
  DagBuilder dag("dag");
  dag.timer("raise", 1ms, [] { kill(getpid(), SIGUSR1); });  // to the process: runtime threads block it
  executor.add(std::move(dag));
  executor.run();
  std::signal(SIGUSR1, old);
  EXPECT_TRUE(executor.stopping());
}

TEST(Executor, OverrunsOfAssumedExecutionTimesAreCounted) {
  Executor executor(one_worker());
  DagBuilder builder("dag");
  builder.timer("slow", 1s,
                [&] {
                  while (job_cpu_time() < kMillisecond) {
                  }
                  executor.stop();
                },
                {.wcet = 10us, .budget = 20us});
  const DagId dag = executor.add(std::move(builder));
  executor.run();
  const TaskStats stats = executor.stats(dag)[0];
  EXPECT_EQ(stats.jobs.finished, 1U);  // without a preemption point the job is not cut off
  EXPECT_EQ(stats.usage.over_wcet, 1U);
  EXPECT_EQ(stats.usage.over_budget, 1U);
}

TEST(Executor, EventsCanBeDrainedWhileItRunsAndAfterwards) {
  ExecutorOptions options = one_worker();
  options.trace_capacity = 1024;
  Executor executor(options);
  int jobs = 0;
  DagBuilder dag("dag");
  dag.timer("tick", 1ms, [&] {
    if (++jobs == 10) executor.stop();
  });
  executor.add(std::move(dag));
  executor.start();
  std::vector<JobEvent> events;
  while (!executor.stopping()) {
    executor.drain(events);
    std::this_thread::yield();
  }
  executor.wait();
  executor.drain(events);
  EXPECT_EQ(
      std::count_if(events.begin(), events.end(), [](const JobEvent &e) { return e.kind == JobEventKind::Started; }),
      10);
  EXPECT_EQ(executor.lost_events(), 0U);
}

TEST(Executor, OsIsRefusedForAPolicyThatDoesNotOrderThreads) {
  ExecutorOptions options = one_worker(PreemptionMode::Os);
  options.policy = PolicyKind::Edf;
  EXPECT_THROW(Executor{options}, std::runtime_error);
  options.preemption = PreemptionMode::Auto;
  EXPECT_EQ(Executor(options).mode().mode, PreemptionMode::Cooperative);
}

TEST(Executor, IsDestroyedCleanlyInEveryState) {
  { const Executor never_started; }
  {
    Executor stopped_before(one_worker());
    stopped_before.stop();
    stopped_before.run();
  }
  {
    Executor running(one_worker());
    DagBuilder dag("dag");
    dag.timer("tick", 1ms, [] {});
    running.add(std::move(dag));
    running.start();
  }
}

// A refused DAG changes nothing, and a removed one makes room.
TEST(Executor, AsksWhetherADagIsAdmitted) {
  ExecutorOptions options = one_worker();
  std::vector<std::size_t> asked;
  options.admission = [&](const Workload &workload, const sched::Config &config) -> Result<void> {
    EXPECT_EQ(config.workers, 1U);
    asked.push_back(workload.dags.size());
    if (workload.utilization() <= 1) return {};
    return make_error("no time is left");
  };
  Executor executor(options);
  const auto dag = [](const std::string &name) {
    DagBuilder builder(name);
    builder.timer("t", 10ms, [] {}, {.wcet = 6ms});
    return builder;
  };
  const DagId first = executor.add(dag("first"));
  try {
    executor.add(dag("second"));
    FAIL() << "more than there is time for was admitted";
  } catch (const AdmissionRefused &refused) {
    EXPECT_NE(std::string(refused.what()).find("'second' is not admitted"), std::string::npos) << refused.what();
    EXPECT_NE(std::string(refused.what()).find("no time is left"), std::string::npos) << refused.what();
  }
  executor.remove(first);
  const DagId third = executor.add(dag("third"));
  EXPECT_EQ(executor.stats(third)[0].task, "third.t");
  EXPECT_EQ(asked, (std::vector<std::size_t>{1, 2, 1}));
}

// The analysis can take seconds. What threads above all jobs ask of the executor must not wait for it.
TEST(Executor, ALongAdmissionHoldsUpNobody) {
  ExecutorOptions options = one_worker();
  Executor *running = nullptr;
  options.admission = [&](const Workload &workload, const sched::Config &) -> Result<void> {
    if (workload.dags.size() > 1) {
      EXPECT_EQ(running->task_name(TaskId(0)), "first.task");
    }
    return {};
  };
  Executor executor(options);
  running = &executor;
  executor.add(once("first", [] {}));
  executor.add(once("second", [] {}));
}

// As a daemon does: it starts with all rights, and then gives them up. In a process of its own, which they are lost to.
TEST(Executor, SaysThatTheSystemRefusesPriorities) {
  if (::geteuid() != 0 || available_fifo_priority(10) < 10) GTEST_SKIP() << "this process has no rights to lose";
#if defined(__SANITIZE_THREAD__) || defined(__SANITIZE_ADDRESS__)
  GTEST_SKIP() << "threads have their priorities in name only";
#endif
  const auto without_rights = [] {
    Executor executor(one_worker(PreemptionMode::Os));
    DagBuilder dag("dag");
    std::atomic<int> jobs{0};
    dag.timer("fast", 1ms, [&] { ++jobs; });
    dag.timer("slow", 2ms, [&] { ++jobs; });
    executor.add(std::move(dag));
    executor.start();
    const bool silent_before = executor.warnings().size() <= 1;  // throttling
    if (::setuid(65534) != 0) ::_exit(2);
    for (const int before = jobs; jobs < before + 20;) std::this_thread::sleep_for(1ms);
    executor.stop();
    const std::vector<std::string> warnings = executor.warnings();
    const bool told = !warnings.empty() && warnings.back().find("refused") != std::string::npos;
    ::_exit(silent_before && told ? 0 : 1);
  };
  EXPECT_EXIT(without_rights(), ::testing::ExitedWithCode(0), "");
}

}  // namespace
}  // namespace redag::runtime
