// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What an executor says about deadlines: counts, distributions, end to end, and on_deadline_miss.
#include <gtest/gtest.h>

#include <atomic>
#include <limits>
#include <map>
#include <mutex>
#include <stdexcept>
#include <thread>
#include <vector>

#include "redag/engine/preemption_point.hpp"
#include "redag/runtime/executor.hpp"
#include "redag/threads/parker.hpp"
#include "tests/testing/one_worker.hpp"

namespace redag::runtime {
namespace {

using namespace std::chrono_literals;
using testing::one_worker;

void take(nanoseconds time) {
  const auto end = std::chrono::steady_clock::now() + time;
  while (std::chrono::steady_clock::now() < end) {
  }
}

// Keeps what on_deadline_miss was told.
class Told {
 public:
  void operator()(const MissInfo &miss) {
    const std::lock_guard guard(lock_);
    misses_.push_back(miss);
  }
  [[nodiscard]] std::vector<MissInfo> of(MissKind kind) {
    const std::lock_guard guard(lock_);
    std::vector<MissInfo> found;
    for (const MissInfo &miss : misses_) {
      if (miss.kind == kind) found.push_back(miss);
    }
    return found;
  }

 private:
  std::mutex lock_;
  std::vector<MissInfo> misses_;
};

TEST(ExecutorStats, LateJobsAndLateAnswersAreCountedAndTold) {
  ExecutorOptions options = one_worker();
  options.measure = true;
  Told told;
  options.on_deadline_miss = [&](const MissInfo &miss) { told(miss); };
  Executor executor(options);
  DagBuilder builder("control", {.deadline = 3ms});
  const TaskHandle slow = builder.timer("slow", 10s, [] { take(2ms); }, {.deadline = 1ms});
  builder.data("sink", {slow}, [&] {
    take(2ms);
    executor.stop();
  });
  const DagId dag = executor.add(std::move(builder));
  executor.run();

  const DagStats stats = executor.dag_stats(dag);
  EXPECT_EQ(stats.dag, "control");
  EXPECT_EQ(stats.deadline, 3 * kMillisecond);
  EXPECT_FALSE(stats.met_every_deadline());
  ASSERT_EQ(stats.tasks.size(), 2U);
  EXPECT_EQ(stats.tasks[0].late, 1U);
  EXPECT_EQ(stats.tasks[0].misses(), 1U);
  EXPECT_EQ(stats.tasks[0].response.count(), 1U);
  EXPECT_GE(stats.tasks[0].response.longest(), 2 * kMillisecond);
  EXPECT_GE(stats.tasks[0].lateness(1), kMillisecond);
  EXPECT_EQ(stats.tasks[1].misses(), 0U) << "its own deadline is the period that it inherits";
  EXPECT_LT(stats.tasks[1].lateness(0.5), 0);
  ASSERT_EQ(stats.sinks.size(), 1U);
  EXPECT_EQ(stats.sinks[0].task, "control.sink");
  EXPECT_EQ(stats.sinks[0].late, 1U);
  EXPECT_EQ(stats.sinks[0].end_to_end.count(), 1U);
  EXPECT_GE(stats.sinks[0].end_to_end.longest(), 4 * kMillisecond);

  const std::vector<MissInfo> late = told.of(MissKind::Late);
  ASSERT_EQ(late.size(), 1U);
  EXPECT_EQ(late[0].task, "control.slow");
  EXPECT_GE(late[0].lateness, kMillisecond);
  EXPECT_EQ(late[0].text.find("control.slow #0 finished"), 0U) << late[0].text;
  const std::vector<MissInfo> end_to_end = told.of(MissKind::EndToEnd);
  ASSERT_EQ(end_to_end.size(), 1U);
  EXPECT_EQ(end_to_end[0].task, "control.sink");
  EXPECT_GE(end_to_end[0].lateness, kMillisecond);
  EXPECT_EQ(end_to_end[0].unreported, 0U);
}

TEST(ExecutorStats, MissesAreCountedWithoutMeasuring) {
  Executor executor(one_worker());
  DagBuilder builder("dag", {.deadline = 1ms});
  builder.timer("slow", 10s,
                [&] {
                  take(2ms);
                  executor.stop();
                },
                {.deadline = 1ms});
  const DagId dag = executor.add(std::move(builder));
  executor.run();
  const DagStats stats = executor.dag_stats(dag);
  EXPECT_EQ(stats.tasks[0].misses(), 1U);
  EXPECT_EQ(stats.sinks[0].late, 1U);
  EXPECT_EQ(stats.tasks[0].response.count(), 0U);
  EXPECT_EQ(stats.tasks[0].response.quantile(0.99), 0);
  EXPECT_EQ(stats.tasks[0].lateness(0.99), 0);
}

TEST(ExecutorStats, AShareIsFromZeroToOne) {
  const TaskStats empty;
  EXPECT_EQ(empty.response.quantile(0), 0);
  EXPECT_EQ(empty.response.quantile(1), 0);
  for (const double wrong : {99.0, -0.01, std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_THROW(static_cast<void>(empty.response.quantile(wrong)), std::invalid_argument) << wrong;
    EXPECT_THROW(static_cast<void>(empty.lateness(wrong)), std::invalid_argument) << wrong;
  }
}

TEST(ExecutorStats, SkippedAndAbortedJobsAreMissesAndJobsInTimeAreNot) {
  ExecutorOptions options = one_worker();
  Told told;
  options.on_deadline_miss = [&](const MissInfo &miss) { told(miss); };
  options.on_exception = [](const ExceptionInfo &) { return OnException::Continue; };
  Executor executor(options);
  std::atomic<int> jobs{0};
  DagBuilder builder("dag");
  const EventHandle skipped = builder.event("skipped", 1h, [&] { ++jobs; }, {.early = EarlyRelease::Accept});
  const EventHandle cut = builder.event("cut", 1h,
                                        [] {
                                          for (;;) redag::preemption_point();
                                        },
                                        {.budget = 1ms});
  const EventHandle throws = builder.event("throws", 1h, [] { throw std::runtime_error("no scan"); });
  const EventHandle first = builder.event("first", 1h, [&] {
    // The only worker is busy here, and these jobs wait.
    executor.release(skipped);
    executor.release(skipped);
    executor.release(cut);
    executor.release(throws);
  });
  DagId dag;
  builder.timer("last", 20ms, [&] {
    const std::vector<TaskStats> stats = executor.stats(dag);
    if (jobs == 1 && stats[1].jobs.aborted == 1 && stats[2].jobs.aborted == 1) executor.stop();
  });
  dag = executor.add(std::move(builder));
  executor.start();
  EXPECT_TRUE(executor.release(first));
  executor.wait();

  const std::vector<TaskStats> stats = executor.stats(dag);
  EXPECT_EQ(stats[0].misses(), 1U);
  EXPECT_EQ(stats[0].early, 1U);
  EXPECT_EQ(stats[1].misses(), 1U);
  EXPECT_EQ(stats[2].misses(), 1U);
  EXPECT_EQ(stats[3].misses(), 0U);
  const std::vector<MissInfo> skips = told.of(MissKind::Skipped);
  ASSERT_FALSE(skips.empty());
  EXPECT_EQ(skips[0].task, "dag.skipped");
  EXPECT_EQ(skips[0].reason, Reason::Overrun);
  std::map<std::string, Reason> aborted;
  for (const MissInfo &miss : told.of(MissKind::Aborted)) aborted[miss.task] = miss.reason;
  EXPECT_EQ(aborted, (std::map<std::string, Reason>{{"dag.cut", Reason::Budget}, {"dag.throws", Reason::Exception}}));
}

TEST(ExecutorStats, AMissMayBeAnsweredWithAnyCall) {
  ExecutorOptions options = one_worker();
  Executor *executor = nullptr;
  DagId dag;
  std::vector<std::uint64_t> counted;
  bool refused = false;
  options.on_deadline_miss = [&](const MissInfo &) {
    counted.push_back(executor->stats(dag)[0].misses());
    DagBuilder rescue("rescue");
    rescue.timer("t", 1h, [] {}, {.offset = 1h});  // without a release, whose skip would be a miss
    executor->remove(executor->add(std::move(rescue)));
    try {
      executor->wait();
    } catch (const std::logic_error &) {
      refused = true;
    }
    executor->stop();
  };
  Executor it(options);
  executor = &it;
  DagBuilder builder("dag");
  builder.timer("slow", 10s, [] { take(2ms); }, {.deadline = 1ms});
  dag = it.add(std::move(builder));
  it.run();
  EXPECT_EQ(counted, std::vector<std::uint64_t>{1});
  EXPECT_TRUE(refused);
}

TEST(ExecutorStats, AnExceptionOfTheMissHandlerStopsTheRun) {
  ExecutorOptions options = one_worker();
  options.on_deadline_miss = [](const MissInfo &miss) { throw std::runtime_error(miss.text); };
  Executor executor(options);
  DagBuilder builder("dag");
  builder.timer("slow", 10s, [] { take(2ms); }, {.deadline = 1ms});
  executor.add(std::move(builder));
  EXPECT_THROW(executor.run(), std::runtime_error);
}

TEST(ExecutorStats, MissesBeyondTheRoomAreOnlyCounted) {
  constexpr std::uint64_t kMisses = 3000;
  ExecutorOptions options = one_worker();
  Event released;
  std::atomic<std::uint64_t> told{0};
  std::atomic<std::uint64_t> unreported{0};
  options.on_deadline_miss = [&](const MissInfo &miss) {
    released.wait();  // until all misses are noted
    ++told;
    unreported = miss.unreported;
  };
  Executor executor(options);
  DagBuilder builder("dag");
  const EventHandle event = builder.event("event", 1h, [] {}, {});
  const DagId dag = executor.add(std::move(builder));
  executor.start();
  executor.release(event);
  for (std::uint64_t i = 0; i < kMisses; ++i) EXPECT_FALSE(executor.release(event));
  released.set();
  executor.stop();
  EXPECT_EQ(executor.stats(dag)[0].misses(), kMisses);
  EXPECT_EQ(told + unreported, kMisses);
  EXPECT_GT(unreported, 0U);
}

}  // namespace
}  // namespace redag::runtime
