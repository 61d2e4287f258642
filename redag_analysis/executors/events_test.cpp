// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/executors/events.hpp"

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

NamedExecutor events(std::vector<std::vector<Task>> dags) { return {"events", std::move(dags), 1}; }
NamedExecutor cbg(std::vector<std::vector<Task>> dags, std::uint32_t workers = 1) {
  return {"cbg", std::move(dags), workers};
}

TEST(Events, WhoCameFirstGoesFirst) {
  NamedExecutor executor = events({{timer("slow", 100), subscription("sink", {0})}, {timer("fast")}});
  EXPECT_EQ(executor.release_and_dispatch({"slow"}), Names{"slow"});
  executor.release("fast");
  EXPECT_EQ(executor.end("slow"), Names{"fast"});  // it expired before the message was sent
  EXPECT_EQ(executor.end("fast"), Names{"sink"});
}

TEST(Events, NoPeriodOfATimerIsLost) {
  NamedExecutor executor = events({{timer("slow", 100)}, {timer("fast")}});
  EXPECT_EQ(executor.release_and_dispatch({"slow"}), Names{"slow"});
  for (int i = 0; i < 50; ++i) executor.release("fast");
  EXPECT_EQ(executor.end("slow"), Names{"fast"});
  for (int i = 1; i < 50; ++i) EXPECT_EQ(executor.end("fast"), Names{"fast"});
  EXPECT_EQ(executor.end("fast"), Names{});
  EXPECT_EQ(executor.accounting("fast").finished, 50U);
  EXPECT_EQ(executor.accounting("fast").skipped, 0U);
}

// The event of the overwritten message takes the newer one; the newer one's event finds nothing.
TEST(Events, AnEventTakesTheNewestMessage) {
  NamedExecutor executor = events({{timer("source"), subscription("sink", {0})}, {timer("other")}});
  EXPECT_EQ(executor.release_and_dispatch({"source", "source", "other"}), Names{"source"});
  EXPECT_EQ(executor.end("source"), Names{"source"});  // queued: source, other, sink
  executor.release("other");
  EXPECT_EQ(executor.end("source"), Names{"other"});  // sink's message was overwritten
  EXPECT_EQ(executor.accounting("sink").skipped, 1U);
  EXPECT_EQ(executor.end("other"), Names{"sink"});
  EXPECT_EQ(executor.end("sink"), Names{"other"});
  EXPECT_EQ(executor.end("other"), Names{});
}

TEST(Events, WhatARemovedDagQueuedIsPassedOver) {
  NamedExecutor executor = events({{timer("a")}, {timer("b")}, {timer("c")}});
  EXPECT_EQ(executor.release_and_dispatch({"a", "b", "c"}), Names{"a"});
  executor.remove_dag(1);
  EXPECT_EQ(executor.end("a"), Names{"c"});
}

TEST(EventsCbg, ATimerExpiresAgainOnlyAfterItsCallback) {
  NamedExecutor executor = cbg({{timer("fast")}, {timer("slow", 100)}});
  EXPECT_EQ(executor.release_and_dispatch({"fast"}), Names{"fast"});
  executor.release("fast");
  executor.release("fast");
  executor.release("slow");
  EXPECT_EQ(executor.end("fast"), Names{"slow"});  // the timer's next event is queued only after its callback
  EXPECT_EQ(executor.end("slow"), Names{"fast"});
  EXPECT_EQ(executor.end("fast"), Names{});
  EXPECT_EQ(executor.accounting("fast").skipped, 1U);
}

TEST(EventsCbg, PeriodsThatPassWhileTheEventWaitsAreOne) {
  NamedExecutor executor = cbg({{timer("long", 100)}, {timer("fast")}, {timer("other", 50)}});
  EXPECT_EQ(executor.release_and_dispatch({"long"}), Names{"long"});
  for (int i = 0; i < 3; ++i) executor.release("fast");
  executor.release("other");
  EXPECT_EQ(executor.end("long"), Names{"fast"});
  EXPECT_EQ(executor.end("fast"), Names{"other"});
  EXPECT_EQ(executor.accounting("fast").skipped, 2U);
}

TEST(EventsCbg, GroupsTakeTurns) {
  std::vector<Task> driver = {timer("a"), timer("b"), timer("c")};
  for (Task &task : driver) task.group = "driver";
  NamedExecutor executor = cbg({driver, {timer("other")}});
  EXPECT_EQ(executor.release_and_dispatch({"a", "b", "c", "other"}), Names{"a"});
  EXPECT_EQ(executor.end("a"), Names{"other"});  // although it arrived last
  EXPECT_EQ(executor.end("other"), Names{"b"});
  EXPECT_EQ(executor.end("b"), Names{"c"});
}

// The message was sent before the sender's group went to the end of the queue.
TEST(EventsCbg, AMessageIsQueuedBeforeTheSendersNextTurn) {
  std::vector<Task> dag = {timer("source"), timer("twin"), subscription("sink", {0})};
  dag[0].group = dag[1].group = "sensors";
  NamedExecutor executor = cbg({dag});
  EXPECT_EQ(executor.release_and_dispatch({"source", "twin"}), Names{"source"});
  EXPECT_EQ(executor.end("source"), Names{"sink"});
  EXPECT_EQ(executor.end("sink"), Names{"twin"});
}

TEST(EventsCbg, ThreadsRunDifferentGroups) {
  std::vector<Task> driver = {timer("a"), timer("b")};
  for (Task &task : driver) task.group = "driver";
  NamedExecutor executor = cbg({driver, {timer("c")}}, 2);
  EXPECT_EQ(executor.release_and_dispatch({"a", "b", "c"}), (Names{"a", "c"}));
  EXPECT_EQ(executor.end("c"), Names{});
  EXPECT_EQ(executor.end("a"), Names{"b"});
}

TEST(EventsCbg, JobsOfAReentrantTaskDoNotOverlap) {
  Task task = timer("often");
  task.concurrency = 2;
  task.overrun = Overrun::Queue;
  task.queue_depth = 4;
  NamedExecutor executor = cbg({{task}}, 2);
  EXPECT_EQ(executor.release_and_dispatch({"often", "often"}), Names{"often"});
  EXPECT_EQ(executor.end("often"), Names{"often"});
}

// On random workloads and events, a group never runs twice at once, no job is forgotten, and no worker idles while a
// job is ready.
void keeps_groups_apart_and_workers_busy(std::string_view executor, std::uint64_t seed) {
  Rng rng(seed);
  const Workload workload = testing::random_workload(rng);
  const std::vector<TaskRef> tasks = flatten(workload);
  sched::Config config;
  config.workers = static_cast<std::uint32_t>(rng.uniform(1, 3));
  const std::uint32_t workers = effective_config(*find_executor(executor), config).workers;
  const auto scheduler = make_scheduler(executor, workload, config);
  const auto group_of = [&](TaskId id) {
    const Task &task = *tasks[id.value].task;
    return task.group.empty() ? std::to_string(id.value) : task.group;
  };
  std::map<std::uint32_t, sched::Dispatch> running;  // by worker
  std::vector<std::int64_t> next(tasks.size(), 0);
  Time now = 0;
  const auto dispatch = [&] {
    for (const sched::Dispatch &d : scheduler->dispatch(now).dispatches)
      RC_ASSERT(running.emplace(d.worker.value, d).second);
    std::map<std::string, int> held;
    for (const auto &[worker, d] : running) RC_ASSERT(++held[group_of(d.task)] == 1);
    if (running.size() == workers) return;
    for (const TaskRef &ref : tasks) RC_ASSERT(scheduler->ready(ref.id) == 0 || held[group_of(ref.id)] == 1);
  };
  const auto end_one = [&] {
    auto victim = running.begin();
    std::advance(victim, rng.uniform(0, static_cast<std::int64_t>(running.size()) - 1));
    scheduler->complete(victim->second.job, now,
                        rng.uniform01() < 0.1 ? sched::Outcome::Threw : sched::Outcome::Finished);
    running.erase(victim);
  };
  for (; now < 200; ++now) {
    const auto t = static_cast<std::size_t>(rng.uniform(0, static_cast<std::int64_t>(tasks.size()) - 1));
    const Task &task = *tasks[t].task;
    if (rng.uniform01() < 0.5 && task.activation == Activation::Timer) {
      scheduler->release(TaskId(t), task.offset + task.period * next[t]++, now);
    } else if (!running.empty()) {
      end_one();
    }
    if (rng.uniform01() < 0.7) dispatch();
  }
  for (dispatch(); !running.empty(); dispatch()) end_one();
  for (const TaskRef &ref : tasks) RC_ASSERT(scheduler->ready(ref.id) == 0U);
}

RC_GTEST_PROP(Events, KeepsGroupsApartAndTheWorkerBusy, (std::uint64_t seed)) {
  keeps_groups_apart_and_workers_busy("events", seed);
}

RC_GTEST_PROP(EventsCbg, KeepsGroupsApartAndWorkersBusy, (std::uint64_t seed)) {
  keeps_groups_apart_and_workers_busy("cbg", seed);
}

}  // namespace
}  // namespace redag::executors
