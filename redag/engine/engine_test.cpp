// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/engine/engine.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "redag/engine/coroutine_body.hpp"
#include "redag/engine/preemption_point.hpp"
#include "redag/runtime/async_event.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag/threads/clock.hpp"
#include "redag/trace/tap.hpp"
#include "tests/testing/allocation_counter.hpp"
#include "tests/testing/builders.hpp"
#include "tests/testing/every_mode.hpp"

namespace redag::runtime {
namespace {

using sched::Outcome;
using testing::ladder;

// An engine whose jobs write into one log: "+t" when a body begins, "-t" when it ends.
class Bench {
 public:
  Bench(Workload workload, PreemptionMode mode, std::uint32_t workers) : workload_(std::move(workload)) {
    const PriorityBand band = probe_priority_band();
    EngineOptions options;
    options.config = make_config(Mode{mode, {}}, workers, workload_.policy, band,
                                 workers + static_cast<std::uint32_t>(workload_.task_count()));
    options.band = band;
    options.trace_capacity = 1 << 16;
    options.on_exception = [this](const Job &, const std::exception_ptr &) { ++exceptions; };
    engine = std::make_unique<Engine>(std::make_unique<sched::PriorityScheduler>(workload_, options.config), options);
    bodies.resize(workload_.task_count(), [](const Job &) { return Outcome::Finished; });
  }

  void start() {
    bind();
    const Result<void> ready = engine->start();
    ASSERT_TRUE(ready) << to_string(ready.error());
    engine->set_origin(monotonic_now());
  }

  void bind() {
    std::vector<Body> logging;
    for (std::size_t t = 0; t < bodies.size(); ++t) {
      logging.emplace_back([this, t](const Job &job) {
        write("+" + std::to_string(t));
        const Outcome outcome = bodies[t](job);
        write("-" + std::to_string(t));
        return outcome;
      });
    }
    engine->bind(workload_, std::move(logging));
  }

  void release(std::initializer_list<std::size_t> tasks) {
    std::vector<Release> batch;
    for (const std::size_t t : tasks) batch.push_back(Release{TaskId(t), engine->now()});
    engine->release(batch);
  }

  // Stops the engine, and checks what must hold at the end of every run.
  void finish() {
    engine->halt();
    ASSERT_TRUE(engine->wait_idle(kNever));
    EXPECT_TRUE(engine->started().empty());
    engine->join();
    engine->drain(events, true);
    EXPECT_EQ(engine->lost_events(), 0U);
    std::vector<std::uint64_t> released(workload_.task_count());
    Time time = 0;
    for (const JobEvent &event : events) {
      EXPECT_GE(event.time, time);
      time = event.time;
      if (event.kind == JobEventKind::Released) ++released[event.task.value];
    }
    for (std::size_t t = 0; t < workload_.task_count(); ++t) {
      EXPECT_EQ(engine->figures(TaskId(t)).jobs.released, released[t]);
    }
  }

  std::string log() {
    const std::lock_guard guard(mutex_);
    return log_;
  }
  void write(const std::string &entry) {
    const std::lock_guard guard(mutex_);
    log_ += log_.empty() ? entry : " " + entry;
  }

  std::unique_ptr<Engine> engine;
  std::vector<Body> bodies;
  std::vector<JobEvent> events;
  std::atomic<int> exceptions{0};

 private:
  Workload workload_;
  PiMutex mutex_;  // jobs of several priorities take it
  std::string log_;
};

class EngineInEveryMode : public ::testing::TestWithParam<PreemptionMode> {
 protected:
  void SetUp() override {
    if (GetParam() == PreemptionMode::Os && probe_priority_band().top_job == 0) {
      GTEST_SKIP() << "this process may not use SCHED_FIFO";
    }
  }
};
INSTANTIATE_TEST_SUITE_P(Modes, EngineInEveryMode, testing::every_mode(), testing::mode_name);

TEST_P(EngineInEveryMode, OneWorkerTakesTheMostUrgentJobFirst) {
  Bench bench(ladder(4), GetParam(), 1);
  Event go;
  Event done;
  bench.bodies[3] = [&](const Job &) {
    go.wait();
    return Outcome::Finished;
  };
  bench.bodies[0] = [&](const Job &) {
    done.set();
    return Outcome::Finished;
  };
  bench.start();
  bench.release({3});
  bench.release({1, 0, 2});  // at one instant, while the worker is busy
  go.set();
  done.wait();
  bench.finish();
  EXPECT_EQ(bench.log(), "+3 -3 +2 -2 +1 -1 +0 -0");
}

// The low job releases the high one. With preemption, the high one ends before the low one.
TEST_P(EngineInEveryMode, AMoreUrgentJobStartsBeforeTheRunningOneEnds) {
  Bench bench(ladder(2), GetParam(), 1);
  std::atomic<bool> high_ended{false};
  Event done;
  bench.bodies[1] = [&](const Job &) {
    high_ended = true;
    if (GetParam() == PreemptionMode::None) done.set();
    return Outcome::Finished;
  };
  bench.bodies[0] = [&](const Job &) {
    bench.release({1});
    while (GetParam() != PreemptionMode::None && !high_ended) preemption_point();
    EXPECT_EQ(high_ended, GetParam() != PreemptionMode::None);
    if (GetParam() != PreemptionMode::None) done.set();
    return Outcome::Finished;
  };
  bench.start();
  bench.release({0});
  done.wait();
  bench.finish();
  EXPECT_EQ(bench.log(), GetParam() == PreemptionMode::None ? "+0 -0 +1 -1" : "+0 +1 -1 -0");
}

TEST_P(EngineInEveryMode, AfterAHaltNothingStartsAndWhatStartedEnds) {
  Bench bench(ladder(3), GetParam(), 1);
  Event begun;
  Event go;
  bench.bodies[2] = [&](const Job &) {
    begun.set();
    go.wait();
    return Outcome::Finished;
  };
  bench.start();
  bench.release({2});
  begun.wait();
  bench.release({0, 1});
  bench.engine->halt();
  EXPECT_FALSE(bench.engine->wait_idle(monotonic_now()));
  ASSERT_EQ(bench.engine->started().size(), 1U);
  EXPECT_EQ(bench.engine->started()[0].task, TaskId(2));
  bench.release({0});  // ignored
  go.set();
  bench.finish();
  EXPECT_EQ(bench.log(), "+2 -2");
  EXPECT_EQ(bench.engine->figures(TaskId(2)).jobs, (sched::Accounting{1, 1, 0, 0, 0}));
  EXPECT_EQ(bench.engine->figures(TaskId(0)).jobs.in_flight(), 1U);
  EXPECT_EQ(bench.engine->figures(TaskId(1)).jobs.in_flight(), 1U);
}

TEST_P(EngineInEveryMode, ExceptionsAbortTheJobAndNothingElse) {
  Bench bench(ladder(2), GetParam(), 2);
  Event done;
  bench.bodies[1] = [](const Job &) -> Outcome { throw std::runtime_error("no"); };
  bench.bodies[0] = [&](const Job &job) {
    if (job.number == 1) done.set();
    return Outcome::Finished;
  };
  bench.start();
  bench.release({0, 1});
  while (bench.engine->figures(TaskId(1)).jobs.aborted == 0) std::this_thread::yield();
  while (bench.engine->figures(TaskId(0)).jobs.finished == 0) std::this_thread::yield();
  bench.release({0});
  done.wait();
  bench.finish();
  EXPECT_EQ(bench.exceptions, 1);
  EXPECT_EQ(bench.engine->figures(TaskId(1)).jobs, (sched::Accounting{1, 0, 0, 1, 0}));
}

TEST_P(EngineInEveryMode, ReleasesFromSeveralThreadsAndBodiesLoseNoJob) {
  constexpr std::size_t kTasks = 12;
  for (const std::uint32_t workers : {1U, 2U, 8U}) {
    Bench bench(ladder(kTasks), GetParam(), workers);
    std::atomic<std::uint64_t> ran{0};
    for (std::size_t t = 0; t < kTasks; ++t) {
      bench.bodies[t] = [&, t](const Job &job) -> Outcome {
        ran.fetch_add(1);
        for (int i = 0; i < 5; ++i) preemption_point();
        if (t % 3 == 0 && job.number % 4 == 0) bench.release({(t + 7) % kTasks, (t + 5) % kTasks});
        if (t % 5 == 0 && job.number % 16 == 3) throw std::logic_error("now and then");
        return Outcome::Finished;
      };
    }
    bench.start();
    std::vector<std::thread> sources;
    for (std::size_t s = 0; s < 3; ++s) {
      sources.emplace_back([&, s] {
        for (std::size_t i = 0; i < 1000; ++i) bench.release({(i + s) % kTasks, (3 * i + s) % kTasks});
      });
    }
    for (std::thread &source : sources) source.join();
    bench.finish();
    std::uint64_t ended = 0;
    for (std::size_t t = 0; t < kTasks; ++t) {
      const sched::Accounting a = bench.engine->figures(TaskId(t)).jobs;
      EXPECT_LE(a.in_flight(), 1U);
      ended += a.finished + a.aborted;
    }
    EXPECT_EQ(ended, ran);
  }
}

TEST_P(EngineInEveryMode, TheHotPathDoesNotAllocate) {
  Bench bench(ladder(3), GetParam(), 1);
  Event done;
  std::uint64_t before = 0;
  std::uint64_t after = 0;
  constexpr std::uint32_t kJobs = 200;
  std::vector<Body> bodies(3, [](const Job &) { return Outcome::Finished; });
  // Each job releases the next one. The thread's allocations are counted from job 20 to the last.
  bodies[0] = [&](const Job &job) {
    preemption_point();
    if (job.number == 20) before = testing::allocation_count();
    if (job.number == kJobs) {
      after = testing::allocation_count();
      done.set();
    } else {
      bench.engine->release(TaskId(0), bench.engine->now());
    }
    return Outcome::Finished;
  };
  bench.engine->bind(ladder(3), bodies);
  ASSERT_TRUE(bench.engine->start());
  bench.engine->release(TaskId(0), 0);
  done.wait();
  bench.finish();
  EXPECT_EQ(after, before);
}

class CountsSkips : public SkipListener {
 public:
  void skipped(Reason reason) noexcept override { overruns += reason == Reason::Overrun ? 1 : 0; }
  std::atomic<std::uint32_t> overruns{0};
};

// Each job releases two jobs of its task; the first one is skipped.
TEST_P(EngineInEveryMode, ToTellOfASkipDoesNotAllocate) {
  Bench bench(ladder(1), GetParam(), 1);
  bench.start();
  Event done;
  std::uint64_t before = 0;
  std::uint64_t after = 0;
  constexpr std::uint32_t kJobs = 100;
  const auto listener = std::make_shared<CountsSkips>();
  Task task = ladder(1).dags[0].tasks[0];
  task.name = "skipped";
  // This task's jobs that run have the numbers 0, 2, 4, ...
  const auto body = [&](const Job &job) {
    if (job.number == 20) before = testing::allocation_count();
    if (job.number == 2 * kJobs) {
      after = testing::allocation_count();
      done.set();
    } else {
      bench.engine->release(job.task, bench.engine->now());
      bench.engine->release(job.task, bench.engine->now());
    }
    return Outcome::Finished;
  };
  const TaskId id = bench.engine->add_tasks({{DagId(0), 1, task, body, listener}}).front();
  bench.engine->release(id, bench.engine->now());
  done.wait();
  bench.engine->join();
  EXPECT_EQ(listener->overruns, kJobs);
  EXPECT_EQ(after, before);
}

// The releases skip more jobs at once than Engine::Locked has room for.
TEST_P(EngineInEveryMode, EverySkipIsTold) {
  Bench bench(ladder(1), GetParam(), 1);
  bench.start();
  const auto listener = std::make_shared<CountsSkips>();
  Task task = ladder(1).dags[0].tasks[0];
  task.name = "skipped";
  const TaskId id =
      bench.engine->add_tasks({{DagId(0), 1, task, [](const Job &) { return Outcome::Finished; }, listener}}).front();
  constexpr std::uint32_t kReleases = 50;
  const std::vector<Release> releases(kReleases, Release{id, 0});
  const std::uint64_t before = testing::allocation_count();
  bench.engine->release(releases);
  EXPECT_LE(testing::allocation_count() - before, 1U) << "room for all skips at once, before the lock is taken";
  EXPECT_EQ(listener->overruns, kReleases - 1);
  bench.engine->join();
}

TEST_P(EngineInEveryMode, PausedItStartsNothingAndKeepsWhatIsReleased) {
  Bench bench(ladder(3), GetParam(), 1);
  Event begun;
  Event go;
  Event done;
  bench.bodies[2] = [&](const Job &) {
    begun.set();
    go.wait();
    return Outcome::Finished;
  };
  bench.bodies[0] = [&](const Job &job) {
    if (job.number == 1) done.set();
    return Outcome::Finished;
  };
  bench.start();
  bench.release({2});
  begun.wait();
  bench.engine->pause();
  bench.release({0, 1});
  EXPECT_FALSE(bench.engine->wait_paused(monotonic_now()));
  go.set();
  EXPECT_TRUE(bench.engine->wait_paused(kNever));
  EXPECT_EQ(bench.log(), "+2 -2");
  bench.engine->resume();
  while (bench.engine->figures(TaskId(0)).jobs.finished == 0) std::this_thread::yield();
  bench.engine->pause();
  EXPECT_TRUE(bench.engine->wait_paused(kNever));
  bench.release({0});
  EXPECT_EQ(bench.log(), "+2 -2 +1 -1 +0 -0");
  bench.engine->resume();
  done.wait();
  bench.finish();
}

// Jobs run one by one on the calling thread, the most urgent first.
TEST_P(EngineInEveryMode, RunOneNeedsNoThreads) {
  Bench bench(ladder(3), GetParam(), 2);
  const std::thread::id here = std::this_thread::get_id();
  for (std::size_t t = 0; t < 3; ++t) {
    bench.bodies[t] = [&, t](const Job &) -> Outcome {
      EXPECT_EQ(std::this_thread::get_id(), here);
      const RunningJob *job = bench.engine->current_job();
      EXPECT_TRUE(job != nullptr && job->job.task == TaskId(t));
      if (t == 0) bench.release({2});
      preemption_point();
      if (t == 1) throw std::runtime_error("no");
      return t == 2 ? Outcome::NoData : Outcome::Finished;
    };
  }
  bench.engine->pause();
  bench.bind();
  bench.release({0, 1});
  EXPECT_EQ(bench.engine->current_job(), nullptr);
  EXPECT_TRUE(bench.engine->run_one());
  EXPECT_TRUE(bench.engine->run_one());
  EXPECT_TRUE(bench.engine->run_one());
  EXPECT_FALSE(bench.engine->run_one());
  EXPECT_EQ(bench.log(), "+1 +0 -0 +2 -2");
  EXPECT_EQ(bench.exceptions, 1);
  bench.engine->miss(TaskId(0), 0, Reason::Overrun);
  bench.finish();
  EXPECT_EQ(bench.engine->figures(TaskId(0)).jobs, (sched::Accounting{2, 1, 1, 0, 0}));
  EXPECT_EQ(bench.engine->figures(TaskId(2)).jobs, (sched::Accounting{.released = 1, .aborted = 1, .no_data = 1}));
  const auto starts = std::count_if(bench.events.begin(), bench.events.end(),
                                    [](const JobEvent &e) { return e.kind == JobEventKind::Started; });
  EXPECT_EQ(starts, 3);
}

// Tasks come and go, and the engine is paused, stepped and resumed, while threads release. Every body of a removed task
// is destroyed, and none runs afterwards.
TEST_P(EngineInEveryMode, TasksComeAndGoWhileItRuns) {
  const PriorityBand band = probe_priority_band();
  EngineOptions options;
  options.config = make_config(Mode{GetParam(), {}}, 2, PolicyKind::RateMonotonic, band, 20);
  options.config.reuse_ids = true;
  options.band = band;
  options.trace_capacity = 1 << 18;
  Engine engine(std::make_unique<sched::PriorityScheduler>(Workload{}, options.config), options);
  engine.pause();
  const DagId dag = engine.add_dag(Dag{}, {}).dag;
  std::atomic<int> in_progress{0};
  std::atomic<int> most{0};
  Task task;
  task.period = task.deadline = kSecond;
  task.concurrency = 2;
  task.overrun = Overrun::Queue;
  task.queue_depth = 3;
  const TaskId steady = engine
                            .add_tasks({{dag, 0, task,
                                         [&](const Job &) {
                                           most = std::max(most.load(), ++in_progress);
                                           preemption_point();
                                           --in_progress;
                                           return Outcome::Finished;
                                         }}})
                            .front();
  ASSERT_TRUE(engine.start());
  engine.set_origin(monotonic_now());
  engine.resume();
  std::atomic<bool> stop{false};
  std::thread source([&] {
    while (!stop) engine.release(steady, engine.now());
  });
  while (engine.figures(steady).jobs.finished == 0) std::this_thread::yield();
  std::thread stepper([&] {
    while (!stop) {
      engine.pause();
      EXPECT_TRUE(engine.wait_paused(kNever));
      engine.run_one();
      engine.resume();
      std::this_thread::yield();
    }
  });
  for (int i = 0; i < 300; ++i) {
    auto alive = std::make_shared<int>(0);
    const std::weak_ptr<int> watch = alive;
    Task other = task;
    other.concurrency = 1;
    other.period = kMillisecond * (1 + i % 7);
    const TaskId id = engine
                          .add_tasks({{dag, 1, other,
                                       [alive = std::move(alive)](const Job &) {
                                         ++*alive;
                                         return Outcome::Finished;
                                       }}})
                          .front();
    engine.release(id, engine.now());
    engine.set_timing(id, kSecond, kSecond);
    engine.release(id, engine.now());
    engine.remove_task(id);
    while (!watch.expired()) std::this_thread::yield();
  }
  stop = true;
  source.join();
  stepper.join();
  engine.halt();
  EXPECT_TRUE(engine.wait_idle(kNever));
  EXPECT_LE(most, 2);
  EXPECT_GT(engine.figures(steady).jobs.finished, 0U);
}

TEST(Engine, NestedJobsRunOnOneThreadAndTheirTimeIsNotChargedToTheJobBelow) {
  Bench bench(ladder(3), PreemptionMode::Cooperative, 1);
  Event done;
  std::thread::id thread;
  const auto use = [](Duration demand) {
    while (job_cpu_time() < demand) {
    }
  };
  bench.bodies[0] = [&](const Job &) {
    thread = std::this_thread::get_id();
    bench.release({1});
    preemption_point();
    EXPECT_LT(job_cpu_time(), 10 * kMillisecond);
    return Outcome::Finished;
  };
  bench.bodies[1] = [&](const Job &) {
    EXPECT_EQ(std::this_thread::get_id(), thread);
    bench.release({2});
    preemption_point();
    return Outcome::Finished;
  };
  bench.bodies[2] = [&](const Job &job) {
    EXPECT_EQ(std::this_thread::get_id(), thread);
    use(10 * kMillisecond);
    if (job.number == 0) {
      bench.release({2});
    } else {
      done.set();
    }
    return Outcome::Finished;
  };
  bench.start();
  bench.release({0});
  done.wait();
  bench.finish();
  // The second job of 2 runs on top of 1 when the first has ended, before 1 is resumed.
  EXPECT_EQ(bench.log(), "+0 +1 +2 -2 +2 -2 -1 -0");
  EXPECT_GE(bench.engine->figures(TaskId(2)).usage.longest, 10 * kMillisecond);
  EXPECT_LT(bench.engine->figures(TaskId(1)).usage.longest, 10 * kMillisecond);
}

TEST(Engine, ABudgetEndsTheJobAtItsNextPreemptionPoint) {
  Workload workload = ladder(1);
  workload.dags[0].tasks[0].budget = kMillisecond;
  Bench bench(workload, PreemptionMode::None, 1);
  std::atomic<bool> caught{false};
  bench.bodies[0] = [&](const Job &) {
    try {
      for (;;) preemption_point();
    } catch (const std::exception &) {
      caught = true;  // user code that swallows every exception it knows
    }
    return Outcome::Finished;
  };
  bench.start();
  bench.release({0});
  while (bench.engine->figures(TaskId(0)).jobs.aborted == 0) std::this_thread::yield();
  bench.finish();
  EXPECT_FALSE(caught);
  EXPECT_EQ(bench.exceptions, 0);
  EXPECT_EQ(bench.engine->figures(TaskId(0)).usage.over_budget, 1U);
}

void use_processor(Duration time, bool with_points) {
  while (job_cpu_time() < time) {
    if (with_points) preemption_point();
  }
}

TEST(Engine, ABudgetThatWasUsedIsToldAtTheEndAtTheLatest) {
  Workload workload = ladder(1);
  workload.dags[0].tasks[0].budget = kMillisecond;
  workload.dags[0].tasks[0].on_budget = OnBudget::SkipNext;
  Bench bench(workload, PreemptionMode::None, 1);
  bench.bodies[0] = [&](const Job &) {
    use_processor(2 * kMillisecond, false);
    return Outcome::Finished;
  };
  bench.start();
  bench.release({0});
  while (bench.engine->figures(TaskId(0)).jobs.finished == 0) std::this_thread::yield();
  bench.release({0});
  EXPECT_EQ(bench.engine->figures(TaskId(0)).jobs.skipped, 1U);
  bench.release({0});
  while (bench.engine->figures(TaskId(0)).jobs.finished == 1) std::this_thread::yield();
  bench.finish();
  EXPECT_EQ(std::count_if(bench.events.begin(), bench.events.end(),
                          [](const JobEvent &event) { return event.kind == JobEventKind::Exceeded; }),
            2);
}

struct SkipLog final : SkipListener {
  explicit SkipLog(Engine &its_engine) : engine(its_engine) {}
  void skipped(Reason reason) noexcept override {
    reasons.push_back(reason);
    (void)engine.figures(TaskId(0)).usage;  // takes the engine's lock
  }
  Engine &engine;
  std::vector<Reason> reasons;
};

// As LTTng's provider, which is loaded before there is an engine.
TEST(Engine, ATapHearsOfAllEventsWithoutATrace) {
  static std::atomic<int> heard{0};
  heard = 0;
  static constexpr trace::Tap kTap{
      [](const void *, TaskId, DagId, const Task &) noexcept {},
      [](const void *, const JobEvent &event) noexcept { heard += event.kind == JobEventKind::Released ? 1 : 0; },
      [](const void *, const JobEvent &, Duration) noexcept {}};
  redag_set_tap(&kTap);
  {
    Workload workload = ladder(1);
    EngineOptions options;
    options.config.policy = workload.policy;
    Engine engine(std::make_unique<sched::PriorityScheduler>(workload, options.config), options);
    engine.bind(workload, {[](const Job &) { return Outcome::Finished; }});
    engine.set_origin(monotonic_now());
    for (int i = 0; i < 3; ++i) {
      engine.pause();
      engine.release(TaskId(0), engine.now());
      EXPECT_TRUE(engine.run_one());
    }
  }
  redag_set_tap(nullptr);
  EXPECT_EQ(heard, 3);
}

TEST(Engine, AListenerIsToldOfSkippedJobsAndNotOfMissedReleases) {
  Bench bench(ladder(1), PreemptionMode::None, 1);
  bench.bind();
  bench.engine->pause();
  Task task;
  task.period = task.deadline = kSecond;
  task.wcet = task.budget = kMicrosecond;
  task.on_budget = OnBudget::SkipNext;
  const auto log = std::make_shared<SkipLog>(*bench.engine);
  const auto body = [log](const Job &) {
    use_processor(kMillisecond, false);
    return Outcome::Finished;
  };
  const TaskId added = bench.engine->add_tasks({{DagId(0), 1, task, body, log}}).front();
  bench.engine->release(added, 1);
  EXPECT_TRUE(log->reasons.empty());
  bench.engine->release(added, 2);
  EXPECT_EQ(log->reasons, std::vector{Reason::Overrun});
  bench.engine->miss(added, 3, Reason::QueueFull);
  EXPECT_EQ(log->reasons.size(), 1U);
  EXPECT_TRUE(bench.engine->run_one());
  bench.engine->release(added, 4);
  EXPECT_EQ(log->reasons, (std::vector{Reason::Overrun, Reason::Budget}));
  EXPECT_EQ(bench.engine->figures(added).jobs.skipped, 3U);
}

TEST(Engine, HighModeIsOnWhileTheJobThatBeganItRuns) {
  Workload workload = ladder(1);
  workload.dags.push_back(workload.dags[0]);
  workload.dags[0].criticality = Criticality::High;
  workload.dags[0].tasks[0].wcet_low = kMillisecond;
  Bench bench(workload, PreemptionMode::None, 2);
  Event begun;
  Event released;
  bench.bodies[0] = [&](const Job &) {
    use_processor(2 * kMillisecond, true);
    begun.set();
    released.wait();
    return Outcome::Finished;
  };
  bench.start();
  bench.release({0});
  begun.wait();
  bench.release({1});
  EXPECT_EQ(bench.engine->figures(TaskId(1)).jobs.skipped, 1U);
  released.set();
  while (bench.engine->figures(TaskId(0)).jobs.finished == 0) std::this_thread::yield();
  bench.release({1});
  while (bench.engine->figures(TaskId(1)).jobs.finished == 0) std::this_thread::yield();
  bench.finish();
}

TEST(Engine, OutsideAJobPreemptionPointsDoNothing) {
  preemption_point();
  EXPECT_EQ(job_cpu_time(), 0);
}

TEST(Engine, AThreadThatCannotBeMadeAsAskedIsAnError) {
  EngineOptions options;
  options.config.workers = 2;
  options.cpus = {1023};
  Engine engine(std::make_unique<sched::PriorityScheduler>(Workload{}, options.config), options);
  const Result<void> ready = engine.start();
  ASSERT_FALSE(ready);
  EXPECT_NE(ready.error()[0].message.find("cannot be pinned"), std::string::npos);
}

}  // namespace
}  // namespace redag::runtime
