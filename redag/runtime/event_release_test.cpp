// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Releases from outside: Executor::release() of tasks that DagBuilder::event() adds.
#include <gtest/gtest.h>

#include <atomic>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "redag/runtime/executor.hpp"
#include "redag/threads/parker.hpp"
#include "tests/testing/one_worker.hpp"

namespace redag::runtime {
namespace {

using namespace std::chrono_literals;
using testing::one_worker;

std::string refusal_of(const std::function<void()> &call) {
  try {
    call();
  } catch (const std::exception &error) {
    return error.what();
  }
  return {};
}

TEST(EventRelease, AThreadReleasesAChain) {
  Executor executor(one_worker());
  int received = 0;
  std::atomic<int> evaluated{0};
  DagBuilder builder("lidar");
  const EventHandle scan =
      builder.event("scan", 1ns, [&] { ++received; }, {.overrun = Overrun::Queue, .queue_depth = 100});
  builder.data("detect", {scan}, [&] { ++evaluated; }, {.overrun = Overrun::Queue, .queue_depth = 100});
  const DagId dag = executor.add(std::move(builder));
  EXPECT_FALSE(executor.release(scan)) << "the executor does not run yet";
  executor.start();
  std::thread driver([&] {
    for (int i = 0; i < 50; ++i) EXPECT_TRUE(executor.release(scan));
  });
  driver.join();
  while (evaluated < 50) std::this_thread::yield();
  executor.stop();
  EXPECT_EQ(received, 50);
  EXPECT_EQ(executor.stats(dag)[0].jobs.released, 50U);
  EXPECT_FALSE(executor.release(scan)) << "the executor has stopped";
}

TEST(EventRelease, AnEarlyReleaseIsSkippedOrAccepted) {
  Executor executor(one_worker());
  DagBuilder builder("dag");
  std::atomic<int> skip_jobs{0};
  std::atomic<int> accept_jobs{0};
  const TaskOptions queue{.overrun = Overrun::Queue, .queue_depth = 10};
  TaskOptions accepting = queue;
  accepting.early = EarlyRelease::Accept;
  const EventHandle skip = builder.event(
      "skip", 1h, [&] { ++skip_jobs; }, queue);
  const EventHandle accept = builder.event(
      "accept", 1h, [&] { ++accept_jobs; }, accepting);
  const DagId dag = executor.add(std::move(builder));
  executor.start();
  EXPECT_TRUE(executor.release(skip));
  EXPECT_FALSE(executor.release(skip));
  EXPECT_FALSE(executor.release(skip));
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(executor.release(accept));
  while (skip_jobs < 1 || accept_jobs < 3) std::this_thread::yield();
  executor.stop();
  const std::vector<TaskStats> stats = executor.stats(dag);
  EXPECT_EQ(skip_jobs, 1);
  EXPECT_EQ(stats[0].early, 2U);
  EXPECT_EQ(stats[0].jobs.released, 3U);
  EXPECT_EQ(stats[0].jobs.skipped, 2U) << "an early release counts, and is a miss";
  EXPECT_EQ(accept_jobs, 3);
  EXPECT_EQ(stats[1].early, 2U);
  EXPECT_EQ(stats[1].jobs.skipped, 0U);
}

TEST(EventRelease, BoundsHoldAsForEveryRelease) {
  Executor executor(one_worker());
  Event entered;
  Event leave;
  DagBuilder builder("dag", {.max_pending = 2});
  const EventHandle event = builder.event("event", 1ns,
                                          [&] {
                                            entered.set();
                                            leave.wait();
                                          },
                                          {.overrun = Overrun::Queue, .queue_depth = 10});
  const DagId dag = executor.add(std::move(builder));
  executor.start();
  executor.release(event);
  entered.wait();
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(executor.release(event)) << "released, and then skipped by a rule";
  leave.set();
  executor.stop();
  EXPECT_EQ(executor.stats(dag)[0].jobs.released, 6U);
  EXPECT_EQ(executor.stats(dag)[0].jobs.skipped, 3U);
}

TEST(EventRelease, AHandleBelongsToOneExecutorAtATime) {
  DagBuilder builder("dag");
  const EventHandle event = builder.event("door", 1ms, [] {});
  Executor other(one_worker());
  {
    Executor executor(one_worker());
    EXPECT_EQ(
        refusal_of([&] { executor.release(event); }),
        "Executor::release(): DagBuilder(\"dag\").event(\"door\") is in no executor (add() its DagBuilder first)");
    const DagId dag = executor.add(builder);
    EXPECT_EQ(refusal_of([&] { other.release(event); }),
              "Executor::release(): DagBuilder(\"dag\").event(\"door\") is in another executor (use the executor that "
              "add() was called on)");
    EXPECT_EQ(
        refusal_of([&] { other.add(builder); }),
        "Executor::add(): DagBuilder(\"dag\").event(\"door\"): this event is in an executor already (remove() its "
        "DAG there first, or build another one)");
    executor.start();
    EXPECT_TRUE(executor.release(event));
    executor.remove(dag);
    EXPECT_NE(refusal_of([&] { executor.release(event); }), "");
    const DagId again = executor.add(builder);
    EXPECT_TRUE(executor.release(event)) << "it begins afresh";
    executor.stop();
    EXPECT_EQ(executor.stats(again)[0].jobs.released, 1U);
  }
  EXPECT_NE(refusal_of([&] { other.release(event); }), "") << "its executor is gone";
}

TEST(EventRelease, ReleasesRaceWithTheEndOfTheirDag) {
  for (int round = 0; round < 20; ++round) {
    Executor executor(one_worker());
    DagBuilder builder("dag");
    const EventHandle event = builder.event("event", 1ns, [] {});
    const DagId dag = executor.add(std::move(builder));
    executor.start();
    std::atomic<bool> removed{false};
    std::thread driver([&] {
      while (!removed) {
        try {
          executor.release(event);
        } catch (const std::logic_error &) {
          return;  // it has been removed
        }
      }
    });
    executor.remove(dag);
    removed = true;
    driver.join();
    executor.stop();
  }
}

// Only events can be released: for the handle of another task there is no such call.
template <class Handle>
concept CanBeReleased = requires(Executor executor, const Handle &handle) {
  executor.release(handle);
};
static_assert(CanBeReleased<EventHandle> && !CanBeReleased<TaskHandle>);

TEST(EventRelease, MistakesAreToldInTheWordsOfTheBuilder) {
  DagBuilder builder("dag");
  const EventHandle event = builder.event("event", 5ms, [] {});
  EXPECT_EQ(refusal_of([&] { builder.event("a", 1ms, {}); }),
            "DagBuilder(\"dag\").event(\"a\"): the task has no body (pass a function that is not empty)");
  EXPECT_EQ(refusal_of([&] { builder.event("b", 1ms, [] {}, {.after = {event}}); }),
            "DagBuilder(\"dag\").event(\"b\"): TaskOptions::after applies to timer() only (events have no "
            "predecessors)");
  EXPECT_EQ(refusal_of([&] { builder.event("c", 1ms, [] {}, {.offset = 1ms}); }),
            "DagBuilder(\"dag\").event(\"c\"): TaskOptions::offset and jitter apply to timer() only");
  Executor executor(one_worker());
  DagBuilder aligned("aligned");
  const EventHandle source = aligned.event("source", 5ms, [] {});
  aligned.timer("timer", 5ms, [] {}, {.after = {source}});
  aligned.event("zero", 0ms, [] {});
  EXPECT_EQ(
      refusal_of([&] { executor.add(std::move(aligned)); }),
      "Executor::add(): DagBuilder(\"aligned\").timer(\"timer\"): timer task 'timer' waits for jobs of 'source' that "
      "are released at the same instants, but nothing synchronises the two (change TaskOptions::after, or use data())\n"
      "DagBuilder(\"aligned\").event(\"zero\"): the minimum interval must be greater than 0 (change the second "
      "argument of event())");
}

}  // namespace
}  // namespace redag::runtime
