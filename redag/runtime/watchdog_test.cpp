// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Time is an argument of the tested functions. Tests with real threads wait for events, never for a time.
#include "redag/runtime/watchdog.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "redag/engine/preemption_point.hpp"
#include "redag/runtime/executor.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag/threads/clock.hpp"
#include "tests/testing/builders.hpp"

namespace redag::runtime {
namespace {

using namespace std::chrono_literals;
using ::testing::Each;
using ::testing::HasSubstr;
using testing::make_dag;
using testing::make_workload;
using ::testing::Not;

constexpr Time kForever = 3600 * kSecond;

// An engine with one worker for `workload`; halts and joins at its end.
class Watched {
 public:
  Watched(const Workload &workload, std::vector<Body> works, sched::Preemption preemption = sched::Preemption::None) {
    EngineOptions options;
    options.config.preemption = preemption;
    options.trace_capacity = 1024;
    engine = std::make_unique<Engine>(std::make_unique<sched::PriorityScheduler>(workload, options.config), options);
    engine->bind(workload, std::move(works));
    EXPECT_TRUE(engine->start());
    engine->set_origin(monotonic_now());
  }
  ~Watched() {
    engine->halt();
    engine->join();
  }
  [[nodiscard]] std::size_t count(JobEventKind kind) {
    engine->drain(events_);
    return static_cast<std::size_t>(
        std::count_if(events_.begin(), events_.end(), [kind](const JobEvent &event) { return event.kind == kind; }));
  }

  std::unique_ptr<Engine> engine;

 private:
  std::vector<JobEvent> events_;
};

Workload one_task() { return make_workload({make_dag("d", {{"t", 10, 5}})}, 1, PreemptionMode::None); }

// Holds the job until open(); begun() returns once its body has begun.
class Gate {
 public:
  Body body() {
    return [this](const Job &) {
      begun_.set();
      open_.wait();
      return sched::Outcome::Finished;
    };
  }
  void begun() { begun_.wait(); }
  void open() { open_.set(); }

 private:
  Event begun_;
  Event open_;
};

TEST(Watchdog, NamesAJobThatDoesNotEndOnceAndOnlyWhenItIsLate) {
  Gate gate;
  Watched watched(one_task(), {gate.body()});
  std::vector<OverdueJob> named;
  Watchdog watchdog(*watched.engine, {{kForever, 0}}, [&](const OverdueJob &job) { named.push_back(job); });
  watchdog.look(2 * kForever);
  EXPECT_TRUE(named.empty()) << "nothing is in progress";
  watched.engine->release(TaskId(0), 0);
  gate.begun();
  watchdog.look(kForever / 2);
  EXPECT_TRUE(named.empty());
  watchdog.look(2 * kForever);
  watchdog.look(3 * kForever);
  gate.open();
  ASSERT_EQ(named.size(), 1U);
  EXPECT_EQ(named[0].job.task, TaskId(0));
  EXPECT_EQ(named[0].job.number, 0U);
  EXPECT_GT(named[0].elapsed, kForever);
  EXPECT_THAT(describe(named[0]), HasSubstr("it waits")) << "it has used no processor time";
  EXPECT_EQ(watched.engine->figures(TaskId(0)).usage.overdue, 1U);
}

TEST(Watchdog, TheLimitCanBeAMultipleOfTheDeadline) {
  Gate gate;
  Watched watched(one_task(), {gate.body()});
  std::vector<OverdueJob> named;
  Watchdog watchdog(*watched.engine, {{kForever, 3}}, [&](const OverdueJob &job) { named.push_back(job); });
  watched.engine->release(TaskId(0), 0);
  gate.begun();
  // It was dispatched between 0 and now.
  watchdog.look(29 * kMillisecond);
  EXPECT_TRUE(named.empty());
  watchdog.look(watched.engine->now() + 31 * kMillisecond);
  EXPECT_EQ(named.size(), 1U);
  gate.open();
}

// The body has no preemption points: only the watchdog can notice.
TEST(Watchdog, ABudgetIsNoticedWhileTheJobRuns) {
  Workload workload = one_task();
  workload.dags[0].tasks[0].budget = kMillisecond;
  workload.dags[0].tasks[0].on_budget = OnBudget::Log;
  std::atomic<bool> noticed{false};
  const auto work = [&](const Job &) {
    const Time give_up = monotonic_now() + 60 * kSecond;
    while (!noticed && monotonic_now() < give_up) {
    }
    return sched::Outcome::Finished;
  };
  Watched watched(workload, {work});
  Watchdog watchdog(*watched.engine, {}, [](const OverdueJob &) { FAIL() << "no limits were given"; });
  watched.engine->release(TaskId(0), 0);
  while (watched.count(JobEventKind::Exceeded) == 0 && watched.count(JobEventKind::Finished) == 0) {
    watchdog.look(watched.engine->now());
  }
  EXPECT_EQ(watched.count(JobEventKind::Finished), 0U) << "the job gave up before it was noticed";
  noticed = true;
  watched.engine->halt();
  EXPECT_TRUE(watched.engine->wait_idle(kNever));
  EXPECT_EQ(watched.count(JobEventKind::Exceeded), 1U) << "it is told once, also when the job ends";
}

TEST(Watchdog, HighModeBeginsWhileTheJobRuns) {
  Workload workload = one_task();
  workload.dags[0].criticality = Criticality::High;
  workload.dags[0].tasks[0].wcet_low = kMillisecond;
  std::atomic<bool> noticed{false};
  const auto work = [&](const Job &) {
    const Time give_up = monotonic_now() + 60 * kSecond;
    while (!noticed && monotonic_now() < give_up) {
    }
    return sched::Outcome::Finished;
  };
  Watched watched(workload, {work});
  Watchdog watchdog(*watched.engine, {}, [](const OverdueJob &) {});
  watched.engine->release(TaskId(0), 0);
  while (watched.count(JobEventKind::HighMode) == 0 && watched.count(JobEventKind::Finished) == 0) {
    watchdog.look(watched.engine->now());
  }
  EXPECT_EQ(watched.count(JobEventKind::Finished), 0U) << "the job gave up before it was noticed";
  noticed = true;
}

// Jobs that sleep use no processor time, however long they take.
TEST(Watchdog, OnlyProcessorTimeCounts) {
  Workload workload = one_task();
  workload.dags[0].tasks[0].budget = 100 * kMillisecond;
  workload.dags[0].tasks[0].on_budget = OnBudget::Log;
  Gate gate;
  Watched watched(workload, {gate.body()});
  Watchdog watchdog(*watched.engine, {}, [](const OverdueJob &) {});
  watched.engine->release(TaskId(0), 0);
  gate.begun();
  for (int i = 0; i < 100; ++i) watchdog.look(kForever);
  EXPECT_EQ(watched.count(JobEventKind::Exceeded), 0U);
  gate.open();
}

// With `abort`, the job's own preemption point ends it and reports it.
TEST(Watchdog, AJobThatIsToBeCutOffIsLeftAlone) {
  Workload workload = one_task();
  workload.dags[0].tasks[0].budget = kMillisecond;
  workload.dags[0].tasks[0].on_budget = OnBudget::Abort;
  std::atomic<bool> looked{false};
  Event over_budget;
  const auto work = [&](const Job &) {
    while (job_cpu_time() < 2 * kMillisecond) {
    }
    over_budget.set();
    while (!looked) {
    }
    return sched::Outcome::Finished;
  };
  Watched watched(workload, {work});
  Watchdog watchdog(*watched.engine, {}, [](const OverdueJob &) {});
  watched.engine->release(TaskId(0), 0);
  over_budget.wait();
  watchdog.look(watched.engine->now());
  EXPECT_EQ(watched.count(JobEventKind::Exceeded), 0U);
  looked = true;
}

TEST(Watchdog, AJobIsSeenAgainAfterAnotherRanOnTopOfIt) {
  const Workload workload =
      make_workload({make_dag("d", {{"slow", 100, 5}, {"fast", 10, 5}})}, 1, PreemptionMode::Cooperative);
  Gate gate;
  Event begun;
  Event released;
  const auto slow = [&, body = gate.body()](const Job &job) {
    begun.set();
    released.wait();
    preemption_point();
    return body(job);
  };
  bool interrupted = false;
  const auto fast = [&](const Job &) {
    interrupted = true;
    return sched::Outcome::Finished;
  };
  Watched watched(workload, {slow, fast}, sched::Preemption::Cooperative);
  std::vector<OverdueJob> named;
  Watchdog watchdog(*watched.engine, {{kForever, 0}}, [&](const OverdueJob &job) { named.push_back(job); });
  watched.engine->release(TaskId(0), 0);
  begun.wait();
  watched.engine->release(TaskId(1), 0);
  released.set();
  gate.begun();
  watchdog.look(2 * kForever);
  gate.open();
  EXPECT_TRUE(interrupted);
  ASSERT_EQ(named.size(), 1U);
  EXPECT_EQ(named[0].job.task, TaskId(0));
}

ExecutorOptions watching(std::vector<std::string> &texts, Event &named) {
  ExecutorOptions options;
  options.workers = 1;
  options.preemption = PreemptionMode::None;
  options.watchdog = WatchdogOptions{{5 * kMillisecond, 0}, 2 * kMillisecond};
  options.on_overdue = [&](const OverdueInfo &info) {
    texts.push_back(info.text);
    named.set();
  };
  return options;
}

TEST(Watchdog, OfAnExecutorNamesTheBody) {
  std::vector<std::string> texts;
  Event named;
  Executor executor(watching(texts, named));
  DagBuilder builder("control");
  builder.timer("ekf", 1ms, [&] {
    named.wait();
    executor.request_stop();
  });
  const DagId dag = executor.add(std::move(builder));
  executor.run();
  ASSERT_EQ(texts.size(), 1U);
  EXPECT_THAT(texts[0], ::testing::ContainsRegex("^control.ekf #[0-9]+ is overdue: in progress for "));
  EXPECT_EQ(executor.stats(dag)[0].usage.overdue, 1U);
}

// Reporting one job takes time. Meanwhile the next job of the same look ends, and another task gets its id.
TEST(Watchdog, NamesNoTaskThatCameLater) {
  std::vector<std::string> names;
  Event told;
  ExecutorOptions options = watching(names, told);
  options.workers = 2;
  options.watchdog->interval = 100 * kMillisecond;  // both are overdue by then
  std::array<Event, 2> let_go;
  std::array<DagId, 2> dags;
  Executor *running = nullptr;
  options.on_overdue = [&](const OverdueInfo &info) {
    names.push_back(info.task);
    if (names.size() > 1) return;
    const std::size_t other = info.task == "d0.t" ? 1 : 0;
    let_go[other].set();
    running->remove(dags[other]);
    while (running->stats(dags[other])[0].jobs.finished == 0) std::this_thread::yield();
    DagBuilder later("later");
    later.timer("t", 1h, [] {}, {.offset = 1h});
    running->add(std::move(later));
    EXPECT_EQ(running->task_name(TaskId(static_cast<std::uint32_t>(other))), "later.t");
    told.set();
  };
  Executor executor(options);
  running = &executor;
  std::array<Event, 2> begun;
  for (std::size_t i = 0; i < 2; ++i) {
    DagBuilder builder("d" + std::to_string(i));
    builder.timer("t", 1h, [&begin = begun[i], &end = let_go[i]] {
      begin.set();
      end.wait();
    });
    dags[i] = executor.add(std::move(builder));
  }
  executor.start();
  for (Event &event : begun) event.wait();
  told.wait();
  for (Event &event : let_go) event.set();
  executor.stop();
  EXPECT_THAT(names, Each(Not(HasSubstr("later"))));
}

// The natural answer to a job that is stuck.
TEST(Watchdog, MayStopTheExecutor) {
  std::vector<std::string> texts;
  Event named;
  ExecutorOptions options = watching(texts, named);
  Executor *running = nullptr;
  options.on_overdue = [&](const OverdueInfo &) {
    running->stop();
    EXPECT_THROW(running->wait(), std::logic_error);
    named.set();
  };
  Executor executor(options);
  running = &executor;
  DagBuilder builder("control");
  builder.timer("ekf", 1ms, [&] { named.wait(); });
  executor.add(std::move(builder));
  executor.run();
}

TEST(Watchdog, WhatItsHandlerThrowsComesOutOfRun) {
  std::vector<std::string> texts;
  Event named;
  ExecutorOptions options = watching(texts, named);
  options.on_overdue = [&](const OverdueInfo &) {
    named.set();
    throw std::runtime_error("the handler fails");
  };
  Executor executor(options);
  DagBuilder builder("control");
  builder.timer("ekf", 1ms, [&] { named.wait(); });
  executor.add(std::move(builder));
  EXPECT_THROW(executor.run(), std::runtime_error);
}

// The body that delays a stop is the one that must be reported.
TEST(Watchdog, GoesOnWhileTheExecutorStops) {
  std::vector<std::string> texts;
  Event named;
  Event begun;
  {
    Executor executor(watching(texts, named));
    DagBuilder builder("control");
    builder.timer("ekf", 1ms, [&] {
      begun.set();
      named.wait();
    });
    executor.add(std::move(builder));
    executor.start();
    begun.wait();
  }
  EXPECT_GE(texts.size(), 1U);  // a job after it may have to wait, and is then reported, too
}

}  // namespace
}  // namespace redag::runtime
