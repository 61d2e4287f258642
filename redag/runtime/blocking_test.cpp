// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Bodies that block and lend their workers meanwhile, on real threads. No test depends on how long anything takes:
// where an order matters, jobs wait for what other jobs do.
#include "redag/runtime/blocking.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <latch>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "redag/engine/preemption_point.hpp"
#include "redag/runtime/async_event.hpp"
#include "redag/runtime/executor.hpp"
#include "tests/testing/allocation_counter.hpp"
#include "tests/testing/every_mode.hpp"
#include "tests/testing/one_worker.hpp"
#include "tests/testing/recorded_run.hpp"

namespace redag::runtime {
namespace {

using namespace std::chrono_literals;
using testing::once;
using testing::one_worker;

ExecutorOptions with_spare_threads(PreemptionMode mode, std::uint32_t threads = 1, std::uint32_t workers = 1) {
  ExecutorOptions options = one_worker(mode);
  options.workers = workers;
  if (mode != PreemptionMode::Os) options.threads = options.workers + threads;
  return options;
}

using BlockingInEveryMode = testing::InEveryMode;

INSTANTIATE_TEST_SUITE_P(, BlockingInEveryMode, testing::every_mode(), testing::mode_name);

// The only worker would otherwise be held for ever.
TEST_P(BlockingInEveryMode, TheWorkerRunsAnotherJobMeanwhile) {
  Executor executor(with_spare_threads(mode()));
  std::latch answer(1);
  const std::thread::id nobody;
  std::thread::id begun_on;
  std::thread::id ended_on;
  const DagId client = executor.add(once("client", [&] {
    begun_on = std::this_thread::get_id();
    {
      const Blocking scope;
      EXPECT_TRUE(scope.lends());
      answer.wait();
    }
    ended_on = std::this_thread::get_id();
    executor.stop();
  }));
  executor.add(once("server", [&] { answer.count_down(); }, {.offset = 1ms}));
  executor.run();
  EXPECT_NE(begun_on, nobody);
  EXPECT_EQ(begun_on, ended_on);
  EXPECT_EQ(executor.stats(client)[0].jobs.finished, 1U);
  EXPECT_EQ(executor.stats(client)[0].kept_worker, 0U);
}

// The call has returned, which the record says. The job then waits until the only worker is free.
TEST(Blocking, TheJobGoesOnWhenItHasAWorker) {
  ExecutorOptions options = with_spare_threads(PreemptionMode::None);
  options.trace_capacity = 1000;
  Executor executor(options);
  std::latch answer(1);
  std::atomic<bool> other_has_ended{false};
  executor.add(once("client", [&] {
    {
      const Blocking scope;
      answer.wait();
    }
    EXPECT_TRUE(other_has_ended);
    executor.stop();
  }));
  executor.add(once("other",
                    [&] {
                      answer.count_down();
                      std::vector<JobEvent> events;
                      const auto is_woken = [](const JobEvent &event) { return event.kind == JobEventKind::Woken; };
                      while (std::none_of(events.begin(), events.end(), is_woken)) executor.drain(events);
                      other_has_ended = true;
                    },
                    {.offset = 1ms}));
  executor.run();
}

// More jobs block than there are workers, all at the same time.
TEST_P(BlockingInEveryMode, ManyJobsBlockAtOnce) {
  constexpr int kJobs = 12;
  Executor executor(with_spare_threads(mode(), kJobs));
  std::latch all_block(kJobs);
  std::atomic<int> ended{0};
  for (int i = 0; i < kJobs; ++i) {
    executor.add(once("client_" + std::to_string(i), [&] {
      {
        const Blocking scope;
        all_block.arrive_and_wait();
      }
      if (++ended == kJobs) executor.stop();
    }));
  }
  executor.run();
  EXPECT_EQ(ended.load(), kJobs);
}

TEST_P(BlockingInEveryMode, AnExceptionLeavesTheScope) {
  ExecutorOptions options = with_spare_threads(mode());
  int handled = 0;
  options.on_exception = [&](const ExceptionInfo &info) {
    ++handled;
    EXPECT_EQ(info.task, "dag.task");
    return OnException::Continue;
  };
  Executor executor(options);
  const DagId dag = executor.add(once("dag", [] {
    const Blocking scope;
    throw std::runtime_error("the file is not there");
  }));
  executor.start();
  while (executor.stats(dag)[0].jobs.aborted < 1) std::this_thread::sleep_for(1ms);
  executor.stop();
  EXPECT_EQ(handled, 1);
}

TEST(Blocking, AJobKeepsItsWorkerIfNoThreadIsLeft) {
  Executor executor(with_spare_threads(PreemptionMode::None, 0));
  const DagId dag = executor.add(once("dag", [&] {
    const Blocking scope;
    EXPECT_FALSE(scope.lends());
    executor.stop();
  }));
  executor.run();
  EXPECT_EQ(executor.stats(dag)[0].kept_worker, 1U);
  EXPECT_EQ(executor.stats(dag)[0].jobs.finished, 1U);
}

TEST_P(BlockingInEveryMode, ScopesInScopesAndOutsideJobsDoNothing) {
  const Blocking outside;
  EXPECT_FALSE(outside.lends());
  Executor executor(with_spare_threads(mode()));
  std::vector<bool> lends;
  const DagId dag = executor.add(once("dag", [&] {
    for (int i = 0; i < 2; ++i) {
      const Blocking outer;
      const Blocking inner;
      preemption_point();  // does nothing: the job has no worker
      lends.push_back(outer.lends());
      lends.push_back(inner.lends());
    }
    executor.stop();
  }));
  executor.run();
  EXPECT_EQ(lends, (std::vector<bool>{true, false, true, false}));
  EXPECT_EQ(executor.stats(dag)[0].kept_worker, 0U);
}

// The job below it could not go on, because its stack is under the one that blocks.
TEST(Blocking, AJobOnTopOfAnotherKeepsItsWorker) {
  ExecutorOptions options = with_spare_threads(PreemptionMode::Cooperative);
  options.policy = PolicyKind::Fixed;
  Executor executor(options);
  std::atomic<bool> ended{false};
  DagBuilder builder("urgent");
  const EventHandle event = builder.event("task", 1h,
                                          [&] {
                                            const Blocking scope;
                                            EXPECT_FALSE(scope.lends());
                                            ended = true;
                                          },
                                          {.priority = 2});
  const DagId urgent = executor.add(std::move(builder));
  executor.add(once("below",
                    [&] {
                      executor.release(event);
                      while (!ended) preemption_point();
                      executor.stop();
                    },
                    {.priority = 1}));
  executor.run();
  EXPECT_EQ(executor.stats(urgent)[0].kept_worker, 1U);
}

// The urgent job's call returns while another job has the worker. It then preempts that job at its preemption point,
// but from another thread: the preempted job waits there.
TEST(Blocking, AJobYieldsToOneThatHasBlocked) {
  ExecutorOptions options = with_spare_threads(PreemptionMode::Cooperative);
  options.policy = PolicyKind::Fixed;
  Executor executor(options);
  std::latch answer(1);
  std::atomic<bool> urgent_runs{false};
  std::atomic<bool> urgent_ended{false};
  executor.add(once("urgent",
                    [&] {
                      {
                        const Blocking scope;
                        answer.wait();
                      }
                      urgent_runs = true;
                      for (const Duration end = job_cpu_time() + 2 * kMillisecond; job_cpu_time() < end;) {
                      }
                      urgent_runs = false;
                      urgent_ended = true;
                    },
                    {.priority = 2}));
  executor.add(once("other",
                    [&] {
                      answer.count_down();
                      while (!urgent_ended) {
                        preemption_point();
                        EXPECT_FALSE(urgent_runs);
                      }
                      executor.stop();
                    },
                    {.offset = 1ms, .priority = 1}));
  executor.run();
}

// A job that goes on after its call preempts one of two others, which keeps its thread. The spare thread is in use: no
// other job can lend its worker, and none that is ready may start.
TEST(Blocking, AJobThatYieldedUsesTheSpareThread) {
  ExecutorOptions options = with_spare_threads(PreemptionMode::Cooperative, 1, 2);
  options.policy = PolicyKind::Fixed;
  Executor executor(options);
  std::latch both_run(2);
  std::latch urgent_goes_on(1);
  std::latch asked(1);
  std::atomic<bool> urgent_ended{false};
  executor.add(once("urgent",
                    [&] {
                      {
                        const Blocking scope;
                        EXPECT_TRUE(scope.lends());
                        both_run.wait();
                      }
                      urgent_goes_on.count_down();
                      asked.wait();
                      urgent_ended = true;
                    },
                    {.priority = 4}));
  executor.add(once("asks",
                    [&] {
                      both_run.count_down();
                      urgent_goes_on.wait();
                      {
                        const Blocking scope;
                        EXPECT_FALSE(scope.lends());
                      }
                      asked.count_down();
                    },
                    {.priority = 3}));
  executor.add(once("yields",
                    [&] {
                      both_run.count_down();
                      while (!urgent_ended) preemption_point();
                    },
                    {.priority = 2}));
  executor.add(once("last", [&] { executor.stop(); }, {.priority = 1}));
  executor.run();
  EXPECT_TRUE(urgent_ended);
}

TEST_P(BlockingInEveryMode, TheStopWaitsForTheCall) {
  Executor executor(with_spare_threads(mode()));
  std::latch blocks(1);
  std::latch may_return(1);
  bool went_on = false;
  const DagId dag = executor.add(once("dag", [&] {
    {
      const Blocking scope;
      blocks.count_down();
      may_return.wait();
    }
    went_on = true;
  }));
  executor.start();
  blocks.wait();
  executor.request_stop();
  may_return.count_down();
  executor.stop();
  EXPECT_TRUE(went_on);
  EXPECT_EQ(executor.stats(dag)[0].jobs.finished, 1U);
}

TEST_P(BlockingInEveryMode, ACoroutineMayBlockBetweenItsWaits) {
  Executor executor(with_spare_threads(mode()));
  std::latch first(1);
  std::latch second(1);
  const DagId client = executor.add(once("client", [&]() -> Coroutine {
    {
      const Blocking scope;
      EXPECT_TRUE(scope.lends());
      first.wait();
    }
    co_await sleep_for(1ms);
    {
      const Blocking scope;
      EXPECT_TRUE(scope.lends());
      second.wait();
    }
    executor.stop();
  }));
  DagBuilder server("server");
  server.timer("task", 5ms, [&, calls = 0]() mutable {
    if (++calls == 1) first.count_down();
    if (calls == 2) second.count_down();
  });
  executor.add(std::move(server));
  executor.run();
  EXPECT_EQ(executor.stats(client)[0].jobs.finished, 1U);
}

// Processor time counts inside the scope and outside. The time for which it blocks does not.
TEST_P(BlockingInEveryMode, ProcessorTimeCounts) {
  const auto use = [](std::chrono::nanoseconds time) {
    for (const Duration end = job_cpu_time() + time.count(); job_cpu_time() < end;) {
    }
  };
  Executor executor(with_spare_threads(mode()));
  const DagId dag = executor.add(once("dag", [&] {
    use(2ms);
    {
      const Blocking scope;
      use(3ms);
      std::this_thread::sleep_for(50ms);
    }
    EXPECT_GE(job_cpu_time(), (5ms / 1ns));
    use(1ms);
    executor.stop();
  }));
  executor.run();
  const Usage usage = executor.stats(dag)[0].usage;
  EXPECT_GE(usage.total, (6ms / 1ns));
  EXPECT_EQ(usage.jobs, 1U);
}

TEST(Blocking, NothingAllocatesInSteadyState) {
  Executor executor(with_spare_threads(PreemptionMode::None));
  int jobs = 0;
  std::uint64_t before = 0;
  std::uint64_t after = 0;
  DagBuilder dag("dag");
  dag.timer("task", 1ms, [&] {
    if (++jobs == 20) before = testing::allocation_count();
    if (jobs == 60) after = testing::allocation_count();
    if (jobs == 60) return executor.stop();
    const Blocking scope;
  });
  executor.add(std::move(dag));
  executor.run();
  EXPECT_EQ(after, before);
}

TEST_P(BlockingInEveryMode, TheCheckerAcceptsARecordedRun) {
  const testing::RecordedRun run;
  {
    ExecutorOptions options = with_spare_threads(mode(), 8, 2);
    options.record = run.folder().string();
    Executor executor(options);
    DagBuilder logger("logger", {.max_active = 2});
    const TaskHandle collect = logger.timer("collect", 2ms, [] {});
    logger.data("write", {collect},
                [] {
                  const Blocking scope;
                  std::this_thread::sleep_for(300us);
                },
                {.group = "state"});
    executor.add(std::move(logger));
    DagBuilder control("control");
    int jobs = 0;
    control.timer("step", 1ms,
                  [&] {
                    {
                      const Blocking scope;
                      std::this_thread::sleep_for(50us);
                    }
                    if (++jobs == 100) executor.stop();
                  },
                  {.group = "state"});
    executor.add(std::move(control));
    DagBuilder busy("busy");
    busy.timer("step", 3ms, [] {
      for (const Duration end = job_cpu_time() + kMillisecond; job_cpu_time() < end;) preemption_point();
    });
    executor.add(std::move(busy));
    executor.run();
  }
  const trace::Trace trace = run.trace();
  const auto waits = std::count_if(trace.events.begin(), trace.events.end(),
                                   [](const JobEvent &event) { return event.kind == JobEventKind::Waits; });
  EXPECT_GE(waits, 100);
  testing::expect_right(trace);
}

}  // namespace
}  // namespace redag::runtime
