#include "redag/sched/models/wait_set.hpp"

#include <algorithm>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "redag/base/rng.hpp"
#include "redag/testing/random_workloads.hpp"

namespace redag::sched {
namespace {

using Names = std::vector<std::string>;

Task timer(std::string name, Duration period = 10) {
  Task task;
  task.name = std::move(name);
  task.wcet = 1;
  task.period = task.deadline = period;
  return task;
}

Task subscription(std::string name, std::vector<std::uint32_t> after) {
  Task task = timer(std::move(name), 0);
  task.activation = Activation::Data;
  task.predecessors = std::move(after);
  return task;
}

/// Drives an executor by the names of tasks. Time is 0: only the order of events matters.
class Executor {
 public:
  Executor(std::vector<std::vector<Task>> dags, std::uint32_t workers) {
    for (std::vector<Task> &tasks : dags) {
      Dag dag;
      dag.tasks = std::move(tasks);
      dag.max_active = 1;  // which these executors do not know
      inherit_periods(dag);
      workload_.dags.push_back(dag);
    }
    for (const TaskRef &ref : flatten(workload_)) names_.push_back(ref.task->name);
    scheduler_ = make_multi_threaded(workload_, workers);
  }

  void release(const std::string &name) {
    const TaskId task = id(name);
    const Duration period = flatten(workload_)[task.value].task->period;
    scheduler_->release(task, period * releases_[name]++, 0);
  }

  /// What starts now.
  Names dispatch() {
    Names started;
    for (const Dispatch &d : scheduler_->dispatch(0).dispatches) {
      started.push_back(names_[d.task.value]);
      running_[started.back()] = d.job;
    }
    return started;
  }

  Names end(const std::string &name, Outcome outcome = Outcome::Finished) {
    scheduler_->complete(running_.at(name), 0, outcome);
    running_.erase(name);
    return dispatch();
  }

  Names release_and_dispatch(const Names &names) {
    for (const std::string &name : names) release(name);
    return dispatch();
  }

  [[nodiscard]] Accounting accounting(const std::string &name) const { return scheduler_->accounting(id(name)); }
  void remove_dag(std::size_t dag) { scheduler_->remove_dag(DagId(dag), 0); }

 private:
  [[nodiscard]] TaskId id(const std::string &name) const {
    return TaskId(static_cast<std::size_t>(std::find(names_.begin(), names_.end(), name) - names_.begin()));
  }

  Workload workload_;
  Names names_;
  std::unique_ptr<Scheduler> scheduler_;
  std::map<std::string, Time> releases_;
  std::map<std::string, JobSlot> running_;
};

TEST(SingleThreaded, ALongSubscriptionBlocksAFastTimer) {
  Executor ste({{timer("camera", 100), subscription("detect", {0})}, {timer("control")}}, 1);
  EXPECT_EQ(ste.release_and_dispatch({"camera"}), Names{"camera"});
  EXPECT_EQ(ste.end("camera"), Names{"detect"});
  for (int i = 0; i < 3; ++i) EXPECT_EQ(ste.release_and_dispatch({"control"}), Names{});
  EXPECT_EQ(ste.end("detect"), Names{"control"});
  EXPECT_EQ(ste.accounting("control").released, 3U);
  EXPECT_EQ(ste.accounting("control").skipped, 2U);  // rclcpp's timers lose the periods that they miss
}

TEST(SingleThreaded, TimersGoBeforeSubscriptionsAndBothInTheOrderOfRegistration) {
  Executor ste({{timer("source", 50), subscription("first", {0}), subscription("second", {0})},
                {timer("slow", 90)},
                {timer("fast", 10)}},
               1);
  EXPECT_EQ(ste.release_and_dispatch({"source"}), Names{"source"});
  ste.release("fast");
  ste.release("slow");
  EXPECT_EQ(ste.end("source"), Names{"slow"});  // neither the rate nor who came first counts
  EXPECT_EQ(ste.end("slow"), Names{"fast"});
  EXPECT_EQ(ste.end("fast"), Names{"first"});
  EXPECT_EQ(ste.end("first"), Names{"second"});
  EXPECT_EQ(ste.end("second"), Names{});
}

// The priority inversion of Casini et al.: even a timer waits for all subscriptions of the window.
TEST(SingleThreaded, WhatBecomesReadyDuringAWindowIsSeenAfterIt) {
  Executor ste({{timer("source"), subscription("first", {0}), subscription("second", {0})}, {timer("urgent", 1)}}, 1);
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
  Executor ste({{often}, {timer("other", 100)}}, 1);
  EXPECT_EQ(ste.release_and_dispatch({"often", "often", "often", "other"}), Names{"often"});
  EXPECT_EQ(ste.end("often"), Names{"other"});
  EXPECT_EQ(ste.end("other"), Names{"often"});
  ste.release("other");
  EXPECT_EQ(ste.end("often"), Names{"often"});  // "other" came during the window of one; both are in the next one
  EXPECT_EQ(ste.end("often"), Names{"other"});
}

TEST(SingleThreaded, AnAbortedJobFeedsNobody) {
  Executor ste({{timer("source"), subscription("sink", {0})}}, 1);
  EXPECT_EQ(ste.release_and_dispatch({"source"}), Names{"source"});
  EXPECT_EQ(ste.end("source", Outcome::Threw), Names{});
}

TEST(SingleThreaded, ARemovedDagLeavesTheWindow) {
  Executor ste({{timer("a")}, {timer("b")}, {timer("c")}}, 1);
  EXPECT_EQ(ste.release_and_dispatch({"a", "b", "c"}), Names{"a"});
  ste.remove_dag(1);
  EXPECT_EQ(ste.end("a"), Names{"c"});
  EXPECT_EQ(ste.accounting("b").skipped, 1U);
}

TEST(MultiThreaded, TasksOfADagRunAtTheSameTimeWhateverItsBound) {
  Executor mte({{timer("a"), timer("b"), timer("c")}}, 2);
  EXPECT_EQ(mte.release_and_dispatch({"c", "b", "a"}), (Names{"a", "b"}));
  EXPECT_EQ(mte.end("b"), Names{"c"});
}

TEST(MultiThreaded, AnExclusiveGroupIsPassedOver) {
  Task a = timer("a");
  Task b = timer("b");
  a.group = b.group = "driver";
  Executor mte({{a}, {b}, {timer("c")}}, 2);
  EXPECT_EQ(mte.release_and_dispatch({"a", "b", "c"}), (Names{"a", "c"}));
  EXPECT_EQ(mte.end("c"), Names{});  // b's group is busy: the thread waits
  EXPECT_EQ(mte.end("a"), Names{"b"});
}

TEST(MultiThreaded, WhatABusyGroupLeavesInTheWindowGoesBeforeWhatCameLater) {
  Task a = timer("a");
  Task b = timer("b");
  a.group = b.group = "driver";
  Executor mte({{timer("late")}, {a}, {b}, {timer("c")}}, 2);
  EXPECT_EQ(mte.release_and_dispatch({"a", "b", "c"}), (Names{"a", "c"}));
  mte.release("late");
  EXPECT_EQ(mte.end("a"), Names{"b"});  // although "late" is registered before it
  EXPECT_EQ(mte.end("c"), Names{"late"});
}

TEST(MultiThreaded, AWaitForgetsWhatABusyGroupLeft) {
  Task a = timer("a");
  Task b = timer("b");
  a.group = b.group = "driver";
  Executor mte({{timer("late")}, {a}, {b}, {timer("c")}}, 2);
  EXPECT_EQ(mte.release_and_dispatch({"a", "b", "c"}), (Names{"a", "c"}));
  EXPECT_EQ(mte.end("c"), Names{});  // nothing to take but b: the window is given up
  EXPECT_EQ(mte.release_and_dispatch({"late"}), Names{"late"});
  mte.release("c");
  EXPECT_EQ(mte.end("late"), Names{"c"});
  mte.release("late");
  EXPECT_EQ(mte.end("a"), Names{"late"});  // b starts anew among the ready ones
  EXPECT_EQ(mte.end("c"), Names{"b"});
}

// On random workloads and events: a group never runs twice, and no worker idles while a job could be taken.
RC_GTEST_PROP(WaitSet, KeepsGroupsApartAndWorkersBusy, (std::uint64_t seed)) {
  Rng rng(seed);
  const Workload workload = testing::random_workload(rng);
  const std::vector<TaskRef> tasks = flatten(workload);
  const auto workers = static_cast<std::uint32_t>(rng.uniform(1, 3));
  const auto scheduler = make_multi_threaded(workload, workers);
  const auto group_of = [&](TaskId id) {
    const Task &task = *tasks[id.value].task;
    return task.group.empty() ? std::to_string(id.value) : task.group;
  };
  std::map<std::uint32_t, Dispatch> running;  // by worker
  std::map<std::uint32_t, int> ready;         // by task
  std::vector<std::int64_t> next(tasks.size(), 0);
  for (int i = 0; i < 200; ++i) {
    const auto t = static_cast<std::size_t>(rng.uniform(0, static_cast<std::int64_t>(tasks.size()) - 1));
    const Task &task = *tasks[t].task;
    if (rng.uniform01() < 0.5 && task.activation == Activation::Timer) {
      scheduler->release(TaskId(t), task.offset + task.period * next[t]++, i);
    } else if (!running.empty()) {
      auto victim = running.begin();
      std::advance(victim, rng.uniform(0, static_cast<std::int64_t>(running.size()) - 1));
      scheduler->complete(victim->second.job, i, rng.uniform01() < 0.1 ? Outcome::Threw : Outcome::Finished);
      running.erase(victim);
    }
    if (rng.uniform01() < 0.3) continue;

    const Step step = scheduler->dispatch(i);
    for (const JobEvent &event : step.events) {
      if (event.kind == JobEventKind::Ready) ++ready[event.task.value];
      if (event.kind == JobEventKind::Dispatched) --ready[event.task.value];
      if (event.kind == JobEventKind::Skipped && event.reason == Reason::Overrun) --ready[event.task.value];
      RC_ASSERT(event.kind != JobEventKind::Deferred && event.kind != JobEventKind::Preempted);
    }
    for (const Dispatch &d : step.dispatches) RC_ASSERT(running.emplace(d.worker.value, d).second);
    const auto room_of = [&](TaskId id) { return tasks[id.value].task->concurrency; };
    std::map<std::string, std::uint32_t> held;
    for (const auto &[worker, d] : running) RC_ASSERT(++held[group_of(d.task)] <= room_of(d.task));
    if (running.size() == workers) continue;
    for (const auto &[id, count] : ready) RC_ASSERT(count == 0 || held[group_of(TaskId(id))] == room_of(TaskId(id)));
  }
}

}  // namespace
}  // namespace redag::sched
