// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Tests the monitor's parts in virtual time: bounds, diagnostics, and the saved workload.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "bounds.hpp"
#include "monitor_test.hpp"
#include "report.hpp"

namespace redag_rclcpp {
namespace {

using redag::JobEvent;
using redag::JobEventKind;
using redag::kMillisecond;
using redag::TaskId;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr const char *kTwoTimers = R"(
name: test
dags:
  - name: control
    tasks:
      - {name: fast, wcet: 1ms, callback: {node: /robot, timer: {period: 10ms, index: 0}}}
      - {name: slow, wcet: 2ms, callback: {node: /robot, timer: {period: 20ms, index: 1}}}
)";

// ---- bounds ----

CallbackStats stats_of(const std::string &task, redag::Duration period, std::uint32_t index = 0) {
  CallbackStats stats;
  stats.id.node = "/robot";
  stats.id.period = period;
  stats.id.index = index;
  stats.dag = "control";
  stats.task = task;
  stats.period = stats.deadline = period;
  return stats;
}

redag::sched::Config one_worker() {
  redag::sched::Config config;
  config.workers = 1;
  config.preemption = redag::sched::Preemption::None;
  return config;
}

JobEvent event(JobEventKind kind, std::uint32_t task, std::uint32_t job, redag::Time value) {
  JobEvent event;
  event.kind = kind;
  event.task = TaskId(task);
  event.job = job;
  event.time = event.value = value;
  return event;
}

TEST(Bounds, AreThoseOfTheModeThatRuns) {
  const redag::Workload workload = parse(kTwoTimers);
  const std::vector<CallbackStats> stats{stats_of("control.fast", 10 * kMillisecond, 0),
                                         stats_of("control.slow", 20 * kMillisecond, 1)};
  const auto learned = [&] { return workload; };
  Bounds none(workload);
  EXPECT_TRUE(none.update(stats, one_worker(), learned));
  EXPECT_EQ(none.absent(), "");
  // With one worker, the fast task can wait for a slow one that began just before. The slow task can wait for the fast
  // one.
  EXPECT_EQ(none.tasks().at("control.fast").response, 3 * kMillisecond - 1);
  EXPECT_EQ(none.tasks().at("control.slow").response, 3 * kMillisecond);

  redag::sched::Config full = one_worker();
  full.preemption = redag::sched::Preemption::Full;
  Bounds preemptive(workload);
  EXPECT_TRUE(preemptive.update(stats, full, learned));
  EXPECT_EQ(preemptive.tasks().at("control.fast").response, 1 * kMillisecond);
  EXPECT_EQ(preemptive.tasks().at("control.slow").response, 3 * kMillisecond);
}

TEST(Bounds, TheGroupsAreThoseOfRos) {
  const redag::Workload workload = parse(kTwoTimers);
  const std::vector<CallbackStats> stats{stats_of("control.fast", 10 * kMillisecond, 0),
                                         stats_of("control.slow", 20 * kMillisecond, 1)};
  redag::Workload grouped = workload;
  for (redag::Task &task : grouped.dags[0].tasks) task.group = "g0";
  redag::sched::Config full = one_worker();
  full.preemption = redag::sched::Preemption::Full;
  Bounds bounds(workload);
  EXPECT_TRUE(bounds.update(stats, full, [&] { return grouped; }));
  ASSERT_EQ(bounds.tasks().count("control.fast"), 1U) << bounds.absent();
  EXPECT_EQ(bounds.tasks().at("control.fast").response, 3 * kMillisecond - 1) << "it can find the group taken";
}

TEST(Bounds, ATimerWithPredecessorsWaitsForThemWhereEdgesAreExecuted) {
  redag::Workload workload = parse(kTwoTimers);
  workload.dags[0].tasks[1].predecessors = {0};
  const std::vector<CallbackStats> stats{stats_of("control.fast", 10 * kMillisecond, 0),
                                         stats_of("control.slow", 20 * kMillisecond, 1)};
  const auto bound_of_slow = [&] {
    Bounds bounds(workload);
    EXPECT_TRUE(bounds.update(stats, one_worker(), [&] { return workload; }));
    const auto found = bounds.tasks().find("control.slow");
    return found == bounds.tasks().end() ? redag::kNever : found->second.response;
  };
  workload.dags[0].edges = redag::Edges::Seen;
  EXPECT_EQ(bound_of_slow(), 3 * kMillisecond);
  // Its predecessor can end just after the timer's last job began, and then once more a period later.
  workload.dags[0].edges = redag::Edges::Executed;
  EXPECT_GE(bound_of_slow(), 12 * kMillisecond);
}

TEST(Bounds, CountTheSegmentsOfTasksThatWait) {
  const redag::Workload workload = parse(R"(
name: test
platform: {devices: {gpu: {slots: 1}}}
dags:
  - name: control
    tasks:
      - name: sees
        segments: [{cpu: 1ms}, {device: gpu, for: 4ms}, {cpu: 1ms}]
        callback: {node: /robot, timer: {period: 10ms, index: 0}}
      - {name: slow, wcet: 2ms, callback: {node: /robot, timer: {period: 20ms, index: 1}}}
)");
  std::vector<CallbackStats> stats{stats_of("control.sees", 10 * kMillisecond, 0),
                                   stats_of("control.slow", 20 * kMillisecond, 1)};
  stats[0].waits = 1;
  redag::sched::Config full = one_worker();
  full.preemption = redag::sched::Preemption::Full;
  const auto learned = [&] { return workload; };
  Bounds bounds(workload);
  EXPECT_TRUE(bounds.update(stats, full, learned));
  ASSERT_EQ(bounds.tasks().count("control.sees"), 1U) << bounds.absent();
  EXPECT_EQ(bounds.tasks().at("control.sees").response, 6 * kMillisecond);
  EXPECT_EQ(bounds.tasks().count("control.slow"), 1U) << bounds.absent();
  stats[0].waits = 2;
  EXPECT_TRUE(bounds.update(stats, full, learned));
  EXPECT_EQ(bounds.absent(),
            "a job of control.sees waited 2 times (co_await), but the segments of its task have 1 waits");
}

TEST(Bounds, AreAnalysedAnewOnlyForOtherCallbacks) {
  const redag::Workload workload = parse(kTwoTimers);
  int asked = 0;
  const auto learned = [&] { return ++asked, workload; };
  std::vector<CallbackStats> stats{stats_of("control.fast", 10 * kMillisecond, 0)};
  Bounds bounds(workload);
  EXPECT_FALSE(bounds.update({}, one_worker(), learned));
  EXPECT_TRUE(bounds.update(stats, one_worker(), learned));
  EXPECT_FALSE(bounds.update(stats, one_worker(), learned));
  stats.push_back(stats_of("control.slow", 20 * kMillisecond, 1));
  EXPECT_TRUE(bounds.update(stats, one_worker(), learned));
  EXPECT_EQ(asked, 2);
}

TEST(Bounds, SayWhyThereAreNone) {
  std::string text = kOneTimer;
  text.replace(text.find("wcet: 2ms, "), 11, "");
  Bounds open(parse(text));
  const auto nothing = [] { return redag::Workload(); };
  open.update({stats_of("control.loop", 10 * kMillisecond)}, one_worker(), nothing);
  EXPECT_THAT(open.tasks(), IsEmpty());
  EXPECT_EQ(open.absent(), "control.loop has no wcet");

  text = kOneTimer;
  text.replace(text.find("timer: 10ms"), 11, "timer: any}, period: 10ms");
  text.replace(text.find("10ms}}"), 6, "10ms}");
  Bounds any(parse(text));
  any.update({stats_of("control.loop", 10 * kMillisecond, 0), stats_of("control.loop", 10 * kMillisecond, 1)},
             one_worker(), nothing);
  EXPECT_THAT(any.absent(), HasSubstr("task control.loop has 2 callbacks"));
  any.update({stats_of("control.loop", 5 * kMillisecond)}, one_worker(), nothing);
  EXPECT_THAT(any.absent(), AllOf(HasSubstr("control.loop"), HasSubstr("5ms"), HasSubstr("10ms")));
}

TEST(Bounds, ResponsesAboveThemAreCountedAndTheFirstIsTold) {
  const redag::Workload workload = parse(kOneTimer);
  Bounds bounds(workload);
  bounds.update({stats_of("control.loop", 10 * kMillisecond)}, one_worker(), [&] { return workload; });
  ASSERT_EQ(bounds.tasks().at("control.loop").response, 2 * kMillisecond);

  std::vector<std::string> told;
  int asked = 0;
  const auto name_of = [&](TaskId task) {
    ++asked;
    return std::string(task.value == 5 ? "control.loop" : "ros.other");
  };
  const auto first = [&](const std::string &name, const TaskBound &bound) {
    told.push_back(name + " " + redag::format_duration(bound.worst));
  };
  using Kind = JobEventKind;
  const redag::Time ms = kMillisecond;
  // Events: of another task; a response at the bound; one above it, split over two calls; a skipped and an aborted job;
  // a second response above the bound.
  bounds.count(
      std::vector{event(Kind::Released, 9, 0, 0), event(Kind::Finished, 9, 0, 50 * ms), event(Kind::Released, 5, 0, 0),
                  event(Kind::Finished, 5, 0, 2 * ms), event(Kind::Released, 5, 1, 10 * ms)},
      name_of, first);
  EXPECT_THAT(told, IsEmpty());
  bounds.count(std::vector{event(Kind::Finished, 5, 1, 13 * ms), event(Kind::Released, 5, 2, 20 * ms),
                           event(Kind::Skipped, 5, 2, 0), event(Kind::Released, 5, 3, 30 * ms),
                           event(Kind::Aborted, 5, 3, 39 * ms), event(Kind::Released, 5, 4, 40 * ms),
                           event(Kind::Finished, 5, 4, 45 * ms)},
               name_of, first);
  EXPECT_THAT(told, ElementsAre("control.loop 3ms"));
  EXPECT_EQ(bounds.tasks().at("control.loop").exceeded, 2U);
  EXPECT_EQ(bounds.tasks().at("control.loop").worst, 5 * ms);
  EXPECT_EQ(asked, 4) << "once a task, and for each response above its bound";
}

// ---- diagnostics ----

std::string value_of(const DiagnosticStatus &status, const std::string &key) {
  for (const auto &pair : status.values) {
    if (pair.key == key) return pair.value;
  }
  return "(none)";
}

Snapshot snapshot_of(std::vector<TaskFigures> tasks) {
  Snapshot snapshot;
  snapshot.workers = 2;
  snapshot.mode.mode = redag::PreemptionMode::Cooperative;
  snapshot.tasks = std::move(tasks);
  return snapshot;
}

TEST(Diagnoser, MissesAreNewOnce) {
  TaskFigures task;
  task.stats = stats_of("control.loop", 10 * kMillisecond);
  task.has_deadline = true;
  Diagnoser diagnoser;
  const auto level_with = [&](std::uint64_t misses) {
    task.stats.misses = misses;
    const auto statuses = diagnoser.diagnose(snapshot_of({task}));
    return find_status(statuses, "ReDAG: DAG control")->level;
  };
  EXPECT_EQ(level_with(0), DiagnosticStatus::OK);
  EXPECT_EQ(level_with(3), DiagnosticStatus::WARN);
  EXPECT_EQ(level_with(3), DiagnosticStatus::OK);
  EXPECT_EQ(level_with(4), DiagnosticStatus::WARN);
  EXPECT_EQ(level_with(0), DiagnosticStatus::OK) << "the node was loaded again";
  EXPECT_EQ(level_with(1), DiagnosticStatus::WARN);

  task.has_deadline = false;
  EXPECT_EQ(level_with(7), DiagnosticStatus::OK) << "nobody stated that deadline";
}

// A message for thousands of callbacks would have megabytes.
TEST(Diagnoser, MessagesShowTheWorstCallbacks) {
  std::vector<TaskFigures> tasks(5);
  for (std::size_t i = 0; i < tasks.size(); ++i) {
    tasks[i].stats = stats_of("control.t" + std::to_string(i), 10 * kMillisecond);
    tasks[i].has_deadline = true;
  }
  tasks[3].stats.misses = 2;
  tasks[4].stats.misses = 1;
  Snapshot snapshot = snapshot_of(tasks);
  EXPECT_THAT(to_json(snapshot), HasSubstr(R"("left_out":0)"));
  show_most(snapshot, 2);
  EXPECT_THAT(to_json(snapshot), HasSubstr(R"("left_out":3)"));
  Diagnoser diagnoser;
  const auto statuses = diagnoser.diagnose(snapshot);
  const DiagnosticStatus &status = *find_status(statuses, "ReDAG: DAG control");
  EXPECT_EQ(value_of(status, "t3 misses"), "2");
  EXPECT_EQ(value_of(status, "t4 misses"), "1");
  EXPECT_EQ(value_of(status, "t0 misses"), "(none)");
  // One that was not shown before has no new misses.
  snapshot.tasks[0].stats.misses = 5;
  snapshot.tasks[0].is_shown = true;
  EXPECT_THAT(find_status(diagnoser.diagnose(snapshot), "ReDAG: DAG control")->message, HasSubstr("missed 5 more"));
  EXPECT_EQ(find_status(diagnoser.diagnose(snapshot), "ReDAG: DAG control")->message, "no new misses");
}

TEST(Diagnoser, DeadlocksAreErrorsWhileTheyLast) {
  Snapshot snapshot = snapshot_of({});
  Diagnoser diagnoser;
  const auto status = [&] { return diagnoser.diagnose(snapshot).at(0); };
  EXPECT_EQ(status().level, DiagnosticStatus::OK);
  EXPECT_EQ(value_of(status(), "deadlocks that ended"), "0");
  Deadlock deadlock;
  deadlock.waiting = "/n timer";
  deadlock.blocked = "/n client /map";
  deadlock.text = "/n timer waits";
  deadlock.certain = false;
  snapshot.deadlocks = {deadlock};
  EXPECT_EQ(status().level, DiagnosticStatus::WARN);
  EXPECT_THAT(status().message, HasSubstr("possible deadlock: /n timer waits for /n client /map"));
  deadlock.certain = true;
  snapshot.deadlocks.push_back(deadlock);
  EXPECT_EQ(status().level, DiagnosticStatus::ERROR);
  EXPECT_THAT(status().message, HasSubstr("; deadlock: /n timer waits for /n client /map"));
  EXPECT_EQ(value_of(status(), "deadlock 2"), "/n timer waits");
  for (Deadlock &each : snapshot.deadlocks) each.ended = redag::kSecond;
  EXPECT_EQ(status().level, DiagnosticStatus::OK);
  EXPECT_EQ(value_of(status(), "deadlocks that ended"), "2");
}

TEST(Diagnoser, BrokenPromisesAboutDeadlinesAreErrors) {
  Snapshot snapshot = snapshot_of({});
  Diagnoser diagnoser;
  const auto status = [&] { return diagnoser.diagnose(snapshot).at(0); };
  snapshot.warnings = {"memory is not locked", "the system refused 3 changes"};
  EXPECT_EQ(status().level, DiagnosticStatus::WARN);
  EXPECT_EQ(value_of(status(), "warning 1"), "memory is not locked");
  snapshot.errors = {"the system refused 3 changes"};
  EXPECT_EQ(status().level, DiagnosticStatus::ERROR);
  EXPECT_THAT(status().message, HasSubstr("; the system refused 3 changes"));
  snapshot.errors.clear();
  EXPECT_EQ(status().level, DiagnosticStatus::WARN);
}

TEST(Diagnoser, WarnsOfExecutionsThatAreAllSomewhatLongerThanTheWcet) {
  TaskFigures task;
  task.stats = stats_of("control.loop", 10 * kMillisecond);
  task.stats.wcet = 2 * kMillisecond;
  task.stats.jobs.finished = 100;
  task.stats.execution_p50 = task.stats.execution_p99 = 2 * kMillisecond;
  task.stats.execution_max = 3 * kMillisecond;
  Diagnoser diagnoser;
  const auto level = [&] { return find_status(diagnoser.diagnose(snapshot_of({task})), "ReDAG: DAG control")->level; };
  EXPECT_EQ(level(), DiagnosticStatus::OK) << "a stall of the machine can do that";
  task.stats.execution_p50 = task.stats.execution_p99 = task.stats.execution_max;
  EXPECT_EQ(level(), DiagnosticStatus::WARN);
}

TEST(Diagnoser, SaysWhatWasWrong) {
  TaskFigures task;
  task.stats = stats_of("control.loop", 10 * kMillisecond);
  task.stats.wcet = 2 * kMillisecond;
  task.stats.execution_max = 5 * kMillisecond;
  task.bound = TaskBound{4 * kMillisecond, "rta_preemptive", 2, 6 * kMillisecond};
  task.has_deadline = true;
  TaskFigures other;
  other.stats.id.kind = redag::Callback::Kind::Subscription;
  other.stats.id.node = "/lidar";
  other.stats.id.name = "/scan";
  other.stats.task = to_string(other.stats.id);
  TaskFigures idle = other;
  idle.stats.id.node = "/idle";
  other.stats.jobs.released = 3;
  TaskFigures internal = other;
  internal.stats.id.name = "/parameter_events";
  internal.stats.id.node = "/clock_node";
  Diagnoser diagnoser;
  const auto statuses = diagnoser.diagnose(snapshot_of({task, other, internal, idle}));

  const DiagnosticStatus *dag = find_status(statuses, "ReDAG: DAG control");
  ASSERT_NE(dag, nullptr);
  EXPECT_EQ(dag->level, DiagnosticStatus::WARN);
  EXPECT_THAT(dag->message, AllOf(HasSubstr("loop executed for 5ms, but its wcet is 2ms"),
                                  HasSubstr("2 responses of loop exceeded the bound of 4ms; the longest was 6ms")));
  EXPECT_EQ(value_of(*dag, "loop period"), "10ms");
  EXPECT_EQ(value_of(*dag, "loop wcet"), "2ms");
  EXPECT_EQ(value_of(*dag, "loop bound"), "4ms");

  const DiagnosticStatus *node = find_status(statuses, "ReDAG: node /lidar");
  ASSERT_NE(node, nullptr);
  EXPECT_EQ(node->level, DiagnosticStatus::OK);
  EXPECT_EQ(value_of(*node, "subscription /scan released"), "3");
  EXPECT_EQ(find_status(statuses, "ReDAG: node /clock_node"), nullptr) << "ROS' own";
  EXPECT_EQ(find_status(statuses, "ReDAG: node /idle"), nullptr) << "never ran";
  EXPECT_NE(find_status(statuses, "ReDAG: executor"), nullptr);
}

TEST(DropIdleTasks, LeavesWhatCanBeAnalysed) {
  redag::Workload workload = parse(R"(
name: test
dags:
  - name: ros
    tasks:
      - {name: idle, period: 10ms, callback: {node: /a, waitable: any}}
      - {name: source, wcet: 1ms, callback: {node: /a, timer: 10ms}}
      - {name: sink, wcet: 1ms, activation: data, after: source, callback: {node: /b, subscription: /x}}
      - {name: orphan, wcet: 1ms, activation: data, after: idle, callback: {node: /b, subscription: /y}}
  - {name: control, tasks: [{name: loop, callback: {node: /robot, timer: 10ms}}]}
  - {name: unused, tasks: [{name: never, period: 10ms, callback: {node: /c, service: /c/s}}]}
)");
  drop_idle_tasks(workload, {"control"});
  ASSERT_EQ(workload.dags.size(), 2U);
  const redag::Dag &ros = workload.dags[0];
  ASSERT_EQ(ros.tasks.size(), 3U);
  EXPECT_EQ(ros.tasks[0].name, "source");
  EXPECT_THAT(ros.tasks[1].predecessors, ElementsAre(0));
  EXPECT_EQ(ros.tasks[1].activation, redag::Activation::Data);
  EXPECT_EQ(ros.tasks[2].name, "orphan");
  EXPECT_THAT(ros.tasks[2].predecessors, IsEmpty());
  EXPECT_EQ(ros.tasks[2].activation, redag::Activation::Timer);
  EXPECT_EQ(workload.dags[1].name, "control") << "as its file has it";
}

// ---- the lines at the end ----

TaskFigures late_one(const std::string &name, redag::Duration period, std::uint64_t misses) {
  TaskFigures task{.stats = stats_of(name, period), .bound = {}, .has_deadline = true};
  task.stats.jobs.released = 100;
  task.stats.misses = misses;
  return task;
}

TEST(ClosingLines, NameTheWorstCallbackItsLikelyCauseAndWhatHelps) {
  Snapshot snapshot;
  snapshot.workers = 1;
  snapshot.mode.mode = redag::PreemptionMode::None;
  snapshot.tasks = {late_one("control.fast", 10 * kMillisecond, 25), late_one("control.slow", 500 * kMillisecond, 1)};
  snapshot.tasks[1].stats.execution_max = 60 * kMillisecond;
  std::vector<std::string> lines = closing_lines(snapshot);
  ASSERT_EQ(lines.size(), 3);
  EXPECT_EQ(lines[0], "preemption none on 1 worker: all was as promised");
  EXPECT_EQ(lines[1], "rates are known of 2 callbacks");
  EXPECT_THAT(lines[2], AllOf(HasSubstr("200 jobs with deadlines, 26 missed, most by control.fast (25 of 100)"),
                              HasSubstr("control.slow, which executes for up to 60ms"), HasSubstr("preemption os")));

  snapshot.mode.mode = redag::PreemptionMode::Os;  // preempts it: that is no cause any more
  EXPECT_THAT(closing_lines(snapshot)[2],
              HasSubstr("(25 of 100): it probably blocks, or waits for its callback group"));
  std::swap(snapshot.tasks[0].stats.misses, snapshot.tasks[1].stats.misses);
  snapshot.tasks[1].stats.execution_max = kMillisecond;
  EXPECT_THAT(closing_lines(snapshot)[2], HasSubstr("waits for callbacks that are more urgent"));
  std::swap(snapshot.tasks[0].stats.misses, snapshot.tasks[1].stats.misses);

  snapshot.tasks[0].stats.execution_p99 = snapshot.tasks[0].stats.execution_max = 12 * kMillisecond;
  EXPECT_THAT(closing_lines(snapshot)[2], HasSubstr("executes for up to 12ms, longer than its deadline of 10ms"));
}

TEST(ClosingLines, SayWhatIsNotKnownAndNotAsPromised) {
  Snapshot snapshot;
  snapshot.workers = 2;
  snapshot.warnings = {"the record is lost", "a limit is low"};
  snapshot.tasks = {late_one("/robot subscription /odd (0)", 100 * kMillisecond, 3)};
  snapshot.deadlocks.push_back({.waiting = "a", .blocked = "b", .resource = "c", .text = "a waits for b"});
  snapshot.tasks[0].has_deadline = false;
  snapshot.tasks[0].stats.id.kind = redag::Callback::Kind::Subscription;
  EXPECT_THAT(closing_lines(snapshot), ElementsAre(HasSubstr("not as promised: the record is lost and 2 others"),
                                                   HasSubstr("0 callbacks, but not of /robot subscription /odd (0)"),
                                                   "0 jobs with deadlines, 0 missed"));
}

}  // namespace
}  // namespace redag_rclcpp
