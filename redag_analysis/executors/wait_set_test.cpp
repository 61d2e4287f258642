// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/executors/wait_set.hpp"

#include <algorithm>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "redag/derived/rng.hpp"
#include "redag_analysis/executors/executors.hpp"
#include "tests/testing/named_executor.hpp"
#include "tests/testing/random_workloads.hpp"

namespace redag::executors {
namespace {

using testing::NamedExecutor;
using testing::subscription;
using testing::timer;
using Names = NamedExecutor::Names;

NamedExecutor single_threaded(std::vector<std::vector<Task>> dags) { return {"ste", std::move(dags), 1}; }
NamedExecutor static_single_threaded(std::vector<std::vector<Task>> dags) { return {"static", std::move(dags), 1}; }
NamedExecutor multi_threaded(std::vector<std::vector<Task>> dags) { return {"mte", std::move(dags), 2}; }

TEST(SingleThreaded, ALongSubscriptionBlocksAFastTimer) {
  NamedExecutor ste = single_threaded({{timer("camera", 100), subscription("detect", {0})}, {timer("control")}});
  EXPECT_EQ(ste.release_and_dispatch({"camera"}), Names{"camera"});
  EXPECT_EQ(ste.end("camera"), Names{"detect"});
  for (int i = 0; i < 3; ++i) EXPECT_EQ(ste.release_and_dispatch({"control"}), Names{});
  EXPECT_EQ(ste.end("detect"), Names{"control"});
  EXPECT_EQ(ste.accounting("control").released, 3U);
  EXPECT_EQ(ste.accounting("control").skipped, 2U);  // rclcpp's timers lose the periods that they miss
}

TEST(SingleThreaded, TimersGoBeforeSubscriptionsAndBothInTheOrderOfRegistration) {
  NamedExecutor ste = single_threaded({{timer("source", 50), subscription("first", {0}), subscription("second", {0})},
                                       {timer("slow", 90)},
                                       {timer("fast", 10)}});
  EXPECT_EQ(ste.release_and_dispatch({"source"}), Names{"source"});
  ste.release("fast");
  ste.release("slow");
  EXPECT_EQ(ste.end("source"), Names{"slow"});  // neither the rate nor the order of arrival counts
  EXPECT_EQ(ste.end("slow"), Names{"fast"});
  EXPECT_EQ(ste.end("fast"), Names{"first"});
  EXPECT_EQ(ste.end("first"), Names{"second"});
  EXPECT_EQ(ste.end("second"), Names{});
}

TEST(SingleThreaded, RanksReplaceTheOrderOfRegistration) {
  NamedExecutor ste{"ste", {{timer("a"), subscription("b", {0})}, {timer("c")}, {timer("d")}}, 1, {2, 0, 3, 1}};
  EXPECT_EQ(ste.release_and_dispatch({"a", "c", "d"}), Names{"d"});
  EXPECT_EQ(ste.end("d"), Names{"a"});
  EXPECT_EQ(ste.end("a"), Names{"c"});
  EXPECT_EQ(ste.end("c"), Names{"b"});  // subscriptions are last, as always
}

// The priority inversion of Casini et al.: even a timer waits for all subscriptions of the window.
TEST(SingleThreaded, WhatBecomesReadyDuringAWindowIsSeenAfterIt) {
  NamedExecutor ste = single_threaded(
      {{timer("source"), subscription("first", {0}), subscription("second", {0})}, {timer("urgent", 1)}});
  EXPECT_EQ(ste.release_and_dispatch({"source"}), Names{"source"});
  EXPECT_EQ(ste.end("source"), Names{"first"});
  ste.release("urgent");
  EXPECT_EQ(ste.end("first"), Names{"second"});
  ste.release("source");
  EXPECT_EQ(ste.end("second"), Names{"source"});  // both are timers of the new window
  EXPECT_EQ(ste.end("source"), Names{"urgent"});
}

TEST(SingleThreaded, AnEntityIsTakenOnceAWindowSoNobodyStarves) {
  Task often = timer("often", 1);
  often.overrun = Overrun::Queue;
  often.queue_depth = 3;
  NamedExecutor ste = single_threaded({{often}, {timer("other", 100)}});
  EXPECT_EQ(ste.release_and_dispatch({"often", "often", "often", "other"}), Names{"often"});
  EXPECT_EQ(ste.end("often"), Names{"other"});
  EXPECT_EQ(ste.end("other"), Names{"often"});
  ste.release("other");
  EXPECT_EQ(ste.end("often"), Names{"often"});  // "other" arrived during the window of one; both are in the next one
  EXPECT_EQ(ste.end("often"), Names{"other"});
}

TEST(SingleThreaded, AnAbortedJobFeedsNobody) {
  NamedExecutor ste = single_threaded({{timer("source"), subscription("sink", {0})}});
  EXPECT_EQ(ste.release_and_dispatch({"source"}), Names{"source"});
  EXPECT_EQ(ste.end("source", sched::Outcome::Threw), Names{});
}

TEST(SingleThreaded, ARemovedDagLeavesTheWindow) {
  NamedExecutor ste = single_threaded({{timer("a")}, {timer("b")}, {timer("c")}});
  EXPECT_EQ(ste.release_and_dispatch({"a", "b", "c"}), Names{"a"});
  ste.remove_dag(1);
  EXPECT_EQ(ste.end("a"), Names{"c"});
  EXPECT_EQ(ste.accounting("b").skipped, 1U);
}

TEST(MultiThreaded, TasksOfADagRunAtTheSameTimeWhateverItsBound) {
  NamedExecutor mte = multi_threaded({{timer("a"), timer("b"), timer("c")}});
  EXPECT_EQ(mte.release_and_dispatch({"c", "b", "a"}), (Names{"a", "b"}));
  EXPECT_EQ(mte.end("b"), Names{"c"});
}

TEST(MultiThreaded, AnExclusiveGroupIsPassedOver) {
  Task a = timer("a");
  Task b = timer("b");
  a.group = b.group = "driver";
  NamedExecutor mte = multi_threaded({{a}, {b}, {timer("c")}});
  EXPECT_EQ(mte.release_and_dispatch({"a", "b", "c"}), (Names{"a", "c"}));
  EXPECT_EQ(mte.end("c"), Names{});  // b's group is busy: the thread waits
  EXPECT_EQ(mte.end("a"), Names{"b"});
}

TEST(MultiThreaded, WhatABusyGroupLeavesInTheWindowGoesBeforeWhatCameLater) {
  Task a = timer("a");
  Task b = timer("b");
  a.group = b.group = "driver";
  NamedExecutor mte = multi_threaded({{timer("late")}, {a}, {b}, {timer("c")}});
  EXPECT_EQ(mte.release_and_dispatch({"a", "b", "c"}), (Names{"a", "c"}));
  mte.release("late");
  EXPECT_EQ(mte.end("a"), Names{"b"});  // although "late" is registered before it
  EXPECT_EQ(mte.end("c"), Names{"late"});
}

TEST(MultiThreaded, AWaitForgetsWhatABusyGroupLeft) {
  Task a = timer("a");
  Task b = timer("b");
  a.group = b.group = "driver";
  NamedExecutor mte = multi_threaded({{timer("late")}, {a}, {b}, {timer("c")}});
  EXPECT_EQ(mte.release_and_dispatch({"a", "b", "c"}), (Names{"a", "c"}));
  EXPECT_EQ(mte.end("c"), Names{});  // only b could be taken: the window is given up
  EXPECT_EQ(mte.release_and_dispatch({"late"}), Names{"late"});
  mte.release("c");
  EXPECT_EQ(mte.end("late"), Names{"c"});
  mte.release("late");
  EXPECT_EQ(mte.end("a"), Names{"late"});  // b competes again with all ready entities
  EXPECT_EQ(mte.end("c"), Names{"b"});
}

TEST(StaticSingleThreaded, SubscriptionsGoBeforeTimers) {
  NamedExecutor executor = static_single_threaded({{timer("source"), subscription("sink", {0})}, {timer("other")}});
  EXPECT_EQ(executor.release_and_dispatch({"source"}), Names{"source"});
  executor.release("other");
  EXPECT_EQ(executor.end("source"), Names{"sink"});
  EXPECT_EQ(executor.end("sink"), Names{"other"});
}

TEST(StaticSingleThreaded, WhatBecomesReadyDuringAWindowIsSeenAfterIt) {
  NamedExecutor executor = static_single_threaded({{timer("source"), subscription("sink", {0})}, {timer("other")}});
  EXPECT_EQ(executor.release_and_dispatch({"source", "other"}), Names{"source"});
  EXPECT_EQ(executor.end("source"), Names{"other"});  // the message has arrived, but the set was made before
  EXPECT_EQ(executor.end("other"), Names{"sink"});
}

// On random workloads and events, a group never runs twice at once, and no worker idles while a job could be taken.
RC_GTEST_PROP(WaitSet, KeepsGroupsApartAndWorkersBusy, (std::uint64_t seed)) {
  Rng rng(seed);
  const Workload workload = testing::random_workload(rng);
  const std::vector<TaskRef> tasks = flatten(workload);
  const auto workers = static_cast<std::uint32_t>(rng.uniform(1, 3));
  sched::Config config;
  config.workers = workers;
  const auto scheduler = make_scheduler("mte", workload, config);
  const auto group_of = [&](TaskId id) {
    const Task &task = *tasks[id.value].task;
    return task.group.empty() ? std::to_string(id.value) : task.group;
  };
  std::map<std::uint32_t, sched::Dispatch> running;  // by worker
  std::map<std::uint32_t, int> ready;                // by task
  std::vector<std::int64_t> next(tasks.size(), 0);
  for (int i = 0; i < 200; ++i) {
    const auto t = static_cast<std::size_t>(rng.uniform(0, static_cast<std::int64_t>(tasks.size()) - 1));
    const Task &task = *tasks[t].task;
    if (rng.uniform01() < 0.5 && task.activation == Activation::Timer) {
      scheduler->release(TaskId(t), task.offset + task.period * next[t]++, i);
    } else if (!running.empty()) {
      auto victim = running.begin();
      std::advance(victim, rng.uniform(0, static_cast<std::int64_t>(running.size()) - 1));
      scheduler->complete(victim->second.job, i,
                          rng.uniform01() < 0.1 ? sched::Outcome::Threw : sched::Outcome::Finished);
      running.erase(victim);
    }
    if (rng.uniform01() < 0.3) continue;

    const sched::Step step = scheduler->dispatch(i);
    for (const JobEvent &event : step.events) {
      if (event.kind == JobEventKind::Ready) ++ready[event.task.value];
      if (event.kind == JobEventKind::Dispatched) --ready[event.task.value];
      if (event.kind == JobEventKind::Skipped && event.reason == Reason::Overrun) --ready[event.task.value];
      RC_ASSERT(event.kind != JobEventKind::Deferred && event.kind != JobEventKind::Preempted);
    }
    for (const sched::Dispatch &d : step.dispatches) RC_ASSERT(running.emplace(d.worker.value, d).second);
    const auto room_of = [&](TaskId id) { return tasks[id.value].task->concurrency; };
    std::map<std::string, std::uint32_t> held;
    for (const auto &[worker, d] : running) RC_ASSERT(++held[group_of(d.task)] <= room_of(d.task));
    if (running.size() == workers) continue;
    for (const auto &[id, count] : ready) RC_ASSERT(count == 0 || held[group_of(TaskId(id))] == room_of(TaskId(id)));
  }
}

}  // namespace
}  // namespace redag::executors
