// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "workload_nodes.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <tuple>

#include "node_events.hpp"
#include "peers.hpp"
#include "redag/derived/demand.hpp"
#include "redag/loader/callback_match.hpp"
#include "redag/loader/workload_yaml.hpp"
#include "redag/threads/setup.hpp"
#include "redag/trace/trace.hpp"
#include "redag_analysis/metrics/check/trace_checker.hpp"
#include "redag_analysis/metrics/jobs.hpp"
#include "workload_run.hpp"

namespace redag_rclcpp::lab {
namespace {

using redag::JobEvent;
using redag::JobEventKind;
using redag::kMillisecond;
using redag::Reason;
using redag::TaskId;
using redag::Time;
using redag::Workload;
using redag::metrics::JobOutcome;
using redag::metrics::JobRecord;
using testing::ElementsAre;
using testing::HasSubstr;

Workload workload_of(const std::string &text) {
  auto loaded = redag::parse_workload(text, "test.yaml");
  if (!loaded) throw std::runtime_error(redag::to_string(loaded.error()));
  return std::move(loaded->workload);
}

// ---- jobs out of what the nodes saw; times in ms ----

class Bodies {
 public:
  Bodies &ran(std::uint32_t task, std::uint32_t job, double start, double end, double trigger = 0,
              std::uint32_t worker = 0) {
    events_.push_back({ms(start), ms(trigger), TaskId(task), job, worker, JobEventKind::Started});
    events_.push_back({ms(end), ms(end), TaskId(task), job, worker, JobEventKind::Finished});
    return *this;
  }
  Bodies &was_absent(std::uint32_t task, std::uint32_t job, double from, double to, std::uint32_t worker = 0) {
    events_.push_back({ms(from), 0, TaskId(task), job, worker, JobEventKind::Preempted});
    events_.push_back({ms(to), 0, TaskId(task), job, worker, JobEventKind::Resumed});
    return *this;
  }
  [[nodiscard]] std::vector<JobRecord> jobs(const Workload &workload, double end, bool timers_queue = false) const {
    return redag::metrics::fold_jobs(workload, stream(workload, end, timers_queue));
  }
  [[nodiscard]] std::vector<JobEvent> stream(const Workload &workload, double end, bool timers_queue = false,
                                             redag::Duration phase_error = 0) const {
    return node_events(workload, events_, {ms(end), phase_error, timers_queue});
  }
  static Time ms(double value) { return static_cast<Time>(value * kMillisecond); }

 private:
  std::vector<JobEvent> events_;
};

// Task, number, release in ms, start in ms (-1: none), outcome, reason.
using Row = std::tuple<std::uint32_t, std::uint32_t, double, double, JobOutcome, Reason>;

std::vector<Row> rows(const std::vector<JobRecord> &jobs) {
  std::vector<Row> result;
  for (const JobRecord &job : jobs) {
    result.emplace_back(job.task.value, job.number, static_cast<double>(job.release) / kMillisecond,
                        job.has_started() ? static_cast<double>(job.start) / kMillisecond : -1, job.outcome,
                        job.reason);
  }
  std::sort(result.begin(), result.end());
  return result;
}

constexpr auto kDone = JobOutcome::Finished;
constexpr auto kSkipped = JobOutcome::Skipped;
constexpr auto kOpen = JobOutcome::InFlight;
constexpr auto kNone = Reason::None;

const char *const kTimer = "{dags: [{name: d, tasks: [{name: a, wcet: 1ms, period: 10ms, offset: 2ms}]}]}";
const char *const kChain =
    "{dags: [{name: d, tasks: [{name: a, wcet: 1ms, period: 10ms}, {name: b, wcet: 1ms, activation: data, after: "
    "a}]}]}";

redag::metrics::CheckReport check(const Workload &workload, std::vector<JobEvent> events, Time end) {
  redag::trace::Trace trace;
  trace.info.workload = workload;
  trace.info.driver = redag::trace::Driver::RosNodes;
  trace.info.end = end;
  trace.events = std::move(events);
  return redag::metrics::check_trace(trace, redag::metrics::rules_for(trace.info));
}

TEST(NodeEvents, ExpiriesThatNeverRanAreSkippedAtTheNextOne) {
  const Workload workload = workload_of(kTimer);
  const auto jobs = Bodies().ran(0, 0, 3, 4).ran(0, 3, 33, 34).jobs(workload, 45);
  EXPECT_THAT(rows(jobs), ElementsAre(Row{0, 0, 2, 3, kDone, kNone}, Row{0, 1, 12, -1, kSkipped, Reason::Overrun},
                                      Row{0, 2, 22, -1, kSkipped, Reason::Overrun}, Row{0, 3, 32, 33, kDone, kNone},
                                      Row{0, 4, 42, -1, kOpen, kNone}));
  EXPECT_EQ(jobs[1].finish, Bodies::ms(22));
}

TEST(NodeEvents, WhatAnExecutorQueuesIsInFlightAtTheEnd) {
  const auto jobs = Bodies().ran(0, 0, 3, 34).jobs(workload_of(kTimer), 40, true);
  EXPECT_THAT(rows(jobs), ElementsAre(Row{0, 0, 2, 3, kDone, kNone}, Row{0, 1, 12, -1, kOpen, kNone},
                                      Row{0, 2, 22, -1, kOpen, kNone}, Row{0, 3, 32, -1, kOpen, kNone}));
}

TEST(NodeEvents, AJobThatBeganAfterTheNextReleaseIsNotSkipped) {
  const Workload workload = workload_of(kTimer);
  const auto bodies = Bodies().ran(0, 0, 12.5, 13).ran(0, 1, 13.1, 14);
  EXPECT_THAT(rows(bodies.jobs(workload, 20)),
              ElementsAre(Row{0, 0, 2, 12.5, kDone, kNone}, Row{0, 1, 12, 13.1, kDone, kNone}));
  const auto report = check(workload, bodies.stream(workload, 20), Bodies::ms(20));
  EXPECT_TRUE(report.ok()) << report.to_string();
}

// The timer was called in time, but the body had no processor for more than two periods. The releases of two jobs are
// overlooked; each ends the job before it.
TEST(NodeEvents, ReleasesOverlookedTogetherFollowEachOther) {
  const Workload workload = workload_of(kTimer);
  const auto bodies = Bodies().ran(0, 0, 32.5, 33).ran(0, 3, 33.1, 34);
  EXPECT_THAT(rows(bodies.jobs(workload, 40)),
              ElementsAre(Row{0, 0, 2, 32.5, kDone, kNone}, Row{0, 1, 12, -1, kSkipped, Reason::Overrun},
                          Row{0, 2, 22, -1, kSkipped, Reason::Overrun}, Row{0, 3, 32, 33.1, kDone, kNone}));
  const auto report = check(workload, bodies.stream(workload, 40), Bodies::ms(40));
  EXPECT_TRUE(report.ok()) << report.to_string();
}

TEST(NodeEvents, MessagesOverlookedTogetherFollowEachOther) {
  const Workload workload = workload_of(kChain);
  const auto bodies = Bodies()
                          .ran(0, 0, 0, 1)
                          .ran(0, 1, 10, 11)
                          .ran(0, 2, 20, 21)
                          .ran(1, 0, 25, 26, 1, 1)  // takes the message of time 1
                          .ran(1, 2, 26, 27, 21, 1);
  const auto all = rows(bodies.jobs(workload, 30));
  EXPECT_THAT(std::vector<Row>(all.begin() + 3, all.end()),
              ElementsAre(Row{1, 0, 1, 25, kDone, kNone}, Row{1, 1, 11, -1, kSkipped, Reason::Overrun},
                          Row{1, 2, 21, 26, kDone, kNone}));
  const auto report = check(workload, bodies.stream(workload, 30), Bodies::ms(30));
  EXPECT_TRUE(report.ok()) << report.to_string();
}

TEST(NodeEvents, ACallJustBeforeItsPointIsOnTime) {
  const Workload workload = workload_of(kTimer);
  const auto bodies = Bodies().ran(0, 0, 1.99, 4).ran(0, 1, 13, 14);
  EXPECT_FALSE(check(workload, bodies.stream(workload, 20), Bodies::ms(20)).ok());  // timers are never this early
  const auto events = bodies.stream(workload, 20, false, Bodies::ms(0.01));
  EXPECT_THAT(rows(redag::metrics::fold_jobs(workload, events)),
              ElementsAre(Row{0, 0, 2, 2, kDone, kNone}, Row{0, 1, 12, 13, kDone, kNone}));
  const auto report = check(workload, events, Bodies::ms(20));
  EXPECT_TRUE(report.ok()) << report.to_string();
}

TEST(NodeEvents, WhatEndsAfterTheHorizonIsInFlight) {
  EXPECT_THAT(rows(Bodies().ran(0, 0, 3, 14).jobs(workload_of(kTimer), 10)),
              ElementsAre(Row{0, 0, 2, 3, kOpen, kNone}));
}

TEST(NodeEvents, AnOverwrittenMessageIsASkippedJob) {
  const auto jobs = Bodies()
                        .ran(0, 0, 0, 1)
                        .ran(0, 1, 10, 11)
                        .ran(0, 2, 20, 21)
                        .ran(1, 0, 1, 2, 1, 1)
                        .ran(1, 2, 25, 26, 21, 1)  // the message of time 11 was overwritten
                        .jobs(workload_of(kChain), 30);
  EXPECT_EQ(jobs.size(), 6U);
  const auto all = rows(jobs);
  EXPECT_THAT(std::vector<Row>(all.begin() + 3, all.end()),
              ElementsAre(Row{1, 0, 1, 1, kDone, kNone}, Row{1, 1, 11, -1, kSkipped, Reason::Overrun},
                          Row{1, 2, 21, 25, kDone, kNone}));
  // The end-to-end response counts from the release of the source's job.
  EXPECT_EQ(jobs.back().origin, Bodies::ms(20));
}

const char *const kJoin =
    "{dags: [{name: d, tasks: [{name: a, wcet: 1ms, period: 10ms}, {name: b, wcet: 1ms, period: 30ms},"
    " {name: j, wcet: 1ms, activation: data, after: [a, b]}]}]}";

TEST(NodeEvents, AJoinIsReleasedByTheLastOfItsPredecessors) {
  const auto jobs = Bodies()
                        .ran(0, 0, 0, 1)
                        .ran(0, 1, 10, 11)
                        .ran(0, 2, 20, 21)
                        .ran(0, 3, 30, 31)
                        .ran(0, 4, 40, 41)
                        .ran(1, 0, 1, 5, 0, 1)
                        .ran(1, 1, 32, 45, 0, 1)
                        .ran(2, 0, 6, 7, 5, 1)
                        .ran(2, 1, 46, 47, 45, 1)
                        .jobs(workload_of(kJoin), 50);
  const auto all = rows(jobs);
  EXPECT_THAT(std::vector<Row>(all.begin() + 7, all.end()),
              ElementsAre(Row{2, 0, 5, 6, kDone, kNone}, Row{2, 1, 45, 46, kDone, kNone}));
  EXPECT_EQ(jobs.back().origin, Bodies::ms(30));  // b's second job; a's fifth was released later
}

const char *const kWaiting =
    "{dags: [{name: d, tasks: [{name: a, wcet: 1ms, period: 10ms}, {name: t, wcet: 1ms, period: 10ms, after: a}]}]}";

TEST(NodeEvents, ATimerTaskWithoutItsDataIsSkippedForThatReason) {
  const Workload workload = workload_of(kWaiting);
  const auto jobs = Bodies()
                        .ran(0, 0, 1, 3)
                        .ran(1, 0, 4, 5, 3, 1)
                        .ran(0, 1, 12, 22)  // too late for t's second job, which needed the data of this one
                        .ran(0, 2, 22, 23)
                        .ran(1, 2, 24, 25, 23, 1)
                        .jobs(workload, 30);
  const auto all = rows(jobs);
  EXPECT_THAT(std::vector<Row>(all.begin() + 3, all.end()),
              ElementsAre(Row{1, 0, 0, 4, kDone, kNone}, Row{1, 1, 10, -1, kSkipped, Reason::Precedence},
                          Row{1, 2, 20, 24, kDone, kNone}));
  EXPECT_EQ(jobs[1].ready, Bodies::ms(3));
}

TEST(NodeEvents, ABodyInsideABodySuspendsIt) {
  const Workload workload = workload_of(
      "{dags: [{name: d, tasks: [{name: a, wcet: 1ms, period: 10ms}, {name: b, wcet: 9ms, period: 20ms}]}]}");
  const auto jobs = Bodies().ran(1, 0, 1, 9).ran(0, 0, 3, 5).jobs(workload, 10);
  ASSERT_EQ(jobs.size(), 2U);
  const JobRecord &outer = jobs[0].task.value == 1 ? jobs[0] : jobs[1];
  EXPECT_EQ(outer.preemptions, 1U);
  EXPECT_EQ(outer.on_worker, Bodies::ms(6));
}

TEST(NodeEvents, ABodyWithoutAProcessorHoldsNone) {
  const Workload workload = workload_of(kTimer);
  const auto bodies = Bodies()
                          .ran(0, 0, 3, 8)
                          .was_absent(0, 0, 4, 5)
                          .was_absent(0, 0, 6, 7.5)
                          .was_absent(0, 1, 12.000001, 15)  // from its start to its end
                          .ran(0, 1, 12, 15);
  const auto jobs = bodies.jobs(workload, 20);
  ASSERT_EQ(jobs.size(), 2U);
  EXPECT_EQ(jobs[0].preemptions, 2U);
  EXPECT_EQ(jobs[0].on_worker, Bodies::ms(2.5));
  EXPECT_EQ(jobs[1].preemptions, 1U);
  EXPECT_EQ(jobs[1].on_worker, 2);  // one nanosecond after the start and one before the end
  const auto report = check(workload, bodies.stream(workload, 20), Bodies::ms(20));
  EXPECT_TRUE(report.ok()) << report.to_string();
}

TEST(NodeEvents, ABodyThatIsAbsentWhenTheRunEndsIsInFlight) {
  const Workload workload = workload_of(kTimer);
  const auto bodies = Bodies().ran(0, 0, 3, 8).was_absent(0, 0, 4, 7);
  const auto events = bodies.stream(workload, 5);
  ASSERT_FALSE(events.empty());
  EXPECT_EQ(events.back().kind, JobEventKind::Preempted);
  EXPECT_THAT(rows(bodies.jobs(workload, 5)), ElementsAre(Row{0, 0, 2, 3, kOpen, kNone}));
  const auto report = check(workload, events, Bodies::ms(5));
  EXPECT_TRUE(report.ok()) << report.to_string();
}

// ---- real nodes ----

class Nodes : public testing::Test {
 protected:
  static void SetUpTestSuite() { rclcpp::init(0, nullptr); }
  static void TearDownTestSuite() { rclcpp::shutdown(); }
};

struct Collected {
  std::vector<JobEvent> bodies;
  redag::Duration phase_error = 0;
};

// Runs the nodes on an rclcpp executor for `duration`. It must far exceed the pauses of a busy machine if jobs are to
// be seen.
template <class Executor>
Collected collect(const Workload &workload, Executor &executor, NodesOptions options, redag::Duration duration) {
  options.threads = 8;
  WorkloadNodes nodes(workload, options);
  if (const auto connected = nodes.connect(20 * redag::kSecond); !connected) {
    throw std::runtime_error(redag::to_string(connected.error()));
  }
  nodes.arm(timer_clock_now() + 200 * kMillisecond);
  for (const auto &node : nodes.nodes()) executor.add_node(node);
  std::thread spinning([&] { executor.spin(); });
  while (nodes.now() < duration) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  nodes.halt();
  EXPECT_TRUE(nodes.wait_idle(timer_clock_now() + 20 * redag::kSecond));
  executor.cancel();
  spinning.join();
  Collected collected;
  collected.phase_error = nodes.phase_error();
  nodes.drain(collected.bodies);
  EXPECT_EQ(nodes.lost_events(), 0U);
  for (const auto &node : nodes.nodes()) executor.remove_node(node);
  return collected;
}

// A light load: even on a busy machine every release is seen, and joins follow exactly.
const char *const kLight =
    "{name: light, platform: {workers: 2}, dags: ["
    " {name: fast, tasks: [{name: a, wcet: 100us, period: 20ms}, {name: b, wcet: 100us, activation: data, after: a}]},"
    " {name: slow, tasks: [{name: x, wcet: 200us, period: 40ms, offset: 5ms}, {name: y, wcet: 200us, period: 20ms},"
    "   {name: j, wcet: 100us, activation: data, after: [x, y]},"
    "   {name: t, wcet: 100us, period: 40ms, offset: 5ms, after: [x]}]}]}";

void expect_jobs_add_up(const Workload &workload, const std::vector<JobRecord> &jobs) {
  std::vector<std::uint64_t> counts(workload.task_count(), 0);
  for (const JobRecord &job : jobs) {
    EXPECT_EQ(job.number, counts[job.task.value]++);
    if (job.outcome == JobOutcome::Finished) {
      EXPECT_GE(job.start, job.release);
      EXPECT_GE(job.finish, job.start);
    }
  }
  // 400 ms: a and y run every 20 ms, x and t every 40 ms from 5 ms on. No release is at 400 ms.
  EXPECT_EQ(counts[0], 20U);
  EXPECT_EQ(counts[2], 10U);
  EXPECT_EQ(counts[3], 20U);
  EXPECT_EQ(counts[5], 10U);
  std::uint64_t a_finished = 0;
  for (const JobRecord &job : jobs) a_finished += job.task.value == 0 && job.outcome == JobOutcome::Finished ? 1 : 0;
  EXPECT_EQ(counts[1], a_finished);
}

TEST_F(Nodes, EveryPointOfTheGridIsAJob) {
  const Workload workload = workload_of(kLight);
  for (const bool intra_process : {true, false}) {
    SCOPED_TRACE(intra_process ? "intra" : "inter");
    rclcpp::executors::SingleThreadedExecutor executor;
    NodesOptions options;
    options.intra_process = intra_process;
    const Collected collected = collect(workload, executor, options, 400 * kMillisecond);
    const auto events = node_events(workload, collected.bodies, {400 * kMillisecond, collected.phase_error});
    expect_jobs_add_up(workload, redag::metrics::fold_jobs(workload, events));
    const auto report = check(workload, events, 400 * kMillisecond);
    EXPECT_TRUE(report.ok()) << report.to_string();
  }
}

TEST_F(Nodes, BodiesUseTheProcessorTimeOfTheirJob) {
  const Workload workload = workload_of("{dags: [{name: d, tasks: [{name: a, wcet: 8ms, bcet: 1ms, period: 20ms}]}]}");
  rclcpp::executors::SingleThreadedExecutor executor;
  NodesOptions options;
  options.seed = 7;
  const Collected collected = collect(workload, executor, options, 400 * kMillisecond);
  std::size_t bodies = 0;
  for (std::size_t i = 0; i + 1 < collected.bodies.size(); i += 2) {
    const JobEvent &start = collected.bodies[i];
    const JobEvent &end = collected.bodies[i + 1];
    ASSERT_EQ(start.kind, JobEventKind::Started);
    EXPECT_GE(end.time - start.time, redag::execution_time(workload.dags[0].tasks[0], TaskId(0), start.job, 7));
    ++bodies;
  }
  EXPECT_GE(bodies, 1U);
}

TEST_F(Nodes, ABudgetCutsOffAndReleasesNobody) {
  const Workload workload = workload_of(
      "{dags: [{name: d, tasks: [{name: a, wcet: 2ms, budget: 1ms, period: 20ms},"
      " {name: b, wcet: 1ms, activation: data, after: a}]}]}");
  rclcpp::executors::SingleThreadedExecutor executor;
  const Collected collected = collect(workload, executor, {}, 400 * kMillisecond);
  EXPECT_FALSE(collected.bodies.empty());
  for (const JobEvent &event : collected.bodies) {
    EXPECT_EQ(event.task, TaskId(0));
    if (event.kind != JobEventKind::Started) {
      EXPECT_EQ(event.kind, JobEventKind::Aborted);
      EXPECT_EQ(event.reason, Reason::Budget);
    }
  }
}

// 25 ms of work every 10 ms: more than half of the releases cannot run. With one thread every count is known, except
// around the end of the run.
TEST_F(Nodes, ExpiriesThatATimerDropsAreCounted) {
  const Workload workload =
      workload_of("{dags: [{name: d, tasks: [{name: a, wcet: 25ms, period: 10ms, deadline: 10ms}]}]}");
  rclcpp::executors::SingleThreadedExecutor executor;
  const Collected collected = collect(workload, executor, {}, 300 * kMillisecond);
  const auto jobs = redag::metrics::fold_jobs(
      workload, node_events(workload, collected.bodies, {300 * kMillisecond, collected.phase_error}));
  ASSERT_EQ(jobs.size(), 30U);
  std::size_t skipped = 0;
  for (const JobRecord &job : jobs) skipped += job.outcome == JobOutcome::Skipped ? 1 : 0;
  EXPECT_GE(skipped, 30U - 300 / 25 - 2);  // at most 12 bodies fit; the last release is open
  for (std::size_t i = 1; i < jobs.size(); ++i) EXPECT_EQ(jobs[i].release - jobs[i - 1].release, 10 * kMillisecond);
}

// The thread that calls halt() may come late: under SCHED_FIFO an overloaded executor can keep it from every processor.
TEST_F(Nodes, NoBodyBeginsAtOrAfterTheEndThoughNobodySaysHalt) {
  const Workload workload =
      workload_of("{dags: [{name: d, tasks: [{name: a, wcet: 4ms, period: 2ms, deadline: 2ms}]}]}");
  rclcpp::executors::SingleThreadedExecutor executor;
  NodesOptions options;
  options.end = 400 * kMillisecond;
  const Collected collected = collect(workload, executor, options, 500 * kMillisecond);
  std::size_t began = 0;
  for (const JobEvent &event : collected.bodies) {
    if (event.kind != JobEventKind::Started) continue;
    EXPECT_LT(event.time, options.end);
    ++began;
  }
  EXPECT_GT(began, 0U);
}

// Twice the load that the processors can take, in each mode of ReDAGExecutor. The record must be complete and valid,
// also if the run is broken off.
TEST_F(Nodes, ARunInOverloadIsRecordedWhole) {
  const Workload workload = workload_of(
      "{name: overload, platform: {workers: 2}, dags: ["
      " {name: fast, deadline: 2ms, tasks: [{name: a, wcet: 1ms, period: 2ms},"
      "   {name: b, wcet: 500us, activation: data, after: a}]},"
      " {name: slow, tasks: [{name: x, wcet: 30ms, period: 20ms, region: 500us},"
      "   {name: y, wcet: 40ms, period: 50ms, region: 500us}]},"
      " {name: never, tasks: [{name: z, wcet: 150ms, period: 200ms, region: 500us}]}]}");
  for (const char *executor : {"redag-none", "redag-cooperative", "redag-os"}) {
    for (const bool broken_off : {false, true}) {
      SCOPED_TRACE(std::string(executor) + (broken_off ? ", broken off" : ""));
      const bool os = std::string(executor) == "redag-os";
      if (os && redag::runtime::probe_priority_band().top_job == 0) continue;
      const std::atomic<bool> stop{broken_off};  // stops at once: perhaps nothing has run
      WorkloadRunOptions options;
      options.executor = executor;
      options.duration = 300 * kMillisecond;
      options.stop = &stop;
      const auto run = run_as_nodes(workload, options);
      ASSERT_TRUE(run.has_value()) << redag::to_string(run.error());
      EXPECT_EQ(run->trace.info.lost_events, 0U);
      EXPECT_TRUE(run->check.ok()) << run->check.to_string();
      EXPECT_TRUE(run->scheduler->check.ok()) << run->scheduler->check.to_string();
      EXPECT_EQ(run->stopped, broken_off);
      EXPECT_EQ(redag::trace::worker_count(run->trace.info), 2U);
    }
  }
}

// The middleware learns late that the nodes of an earlier run have gone.
TEST_F(Nodes, AUserOfATopicWhoLeavesIsNoneWhoStays) {
  const Workload workload = workload_of(
      "{name: w, dags: [{name: fast, tasks: [{name: a, wcet: 1ms, period: 10ms},"
      " {name: b, wcet: 1ms, activation: data, after: a}]}]}");
  WorkloadNodes nodes(workload, NodesOptions());
  const auto other = std::make_shared<rclcpp::Node>("other");
  const auto publish = [&] {
    auto publisher = other->create_publisher<std_msgs::msg::Int64MultiArray>("/fast/a/output", 1);
    while (other->count_publishers("/fast/a/output") < 2) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return publisher;
  };
  auto leaving = publish();
  std::thread leaver([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    leaving.reset();
  });
  const auto connected = nodes.connect(20 * redag::kSecond);
  leaver.join();
  EXPECT_TRUE(connected) << redag::to_string(connected.error());
  const auto staying = publish();
  const auto refused = nodes.connect(20 * redag::kSecond);
  ASSERT_FALSE(refused);
  EXPECT_THAT(redag::to_string(refused.error()), HasSubstr("another process uses the topic '/fast/a/output'"));
}

TEST_F(Nodes, TasksOfAGroupShareANodeAndDoNotOverlap) {
  const Workload workload = workload_of(
      "{platform: {workers: 2}, dags: [{name: d, tasks: [{name: a, wcet: 3ms, period: 10ms, group: g},"
      " {name: b, wcet: 3ms, period: 10ms, group: g}]}, {name: e, tasks: [{name: c, wcet: 3ms, period: 10ms}]}]}");
  rclcpp::executors::MultiThreadedExecutor executor(rclcpp::ExecutorOptions(), 2);
  NodesOptions options;
  options.threads = 2;
  EXPECT_EQ(WorkloadNodes(workload, options).nodes().size(), 2U);
  const Collected collected = collect(workload, executor, options, 400 * kMillisecond);
  std::vector<JobEvent> group;
  for (const JobEvent &event : collected.bodies) {
    if (event.task.value < 2) group.push_back(event);
  }
  std::stable_sort(group.begin(), group.end(), [](const auto &a, const auto &b) { return a.time < b.time; });
  ASSERT_GE(group.size(), 4U);
  for (std::size_t i = 0; i + 1 < group.size(); i += 2) EXPECT_EQ(group[i].task, group[i + 1].task);
}

TEST_F(Nodes, EveryCallbackIsBoundToATaskOfItsOwn) {
  const Workload workload = workload_of(kLight);
  const WorkloadNodes nodes(workload, {});
  const Workload bound = nodes.bound_workload();
  EXPECT_FALSE(std::any_of(bound.dags.begin(), bound.dags.end(), [](const redag::Dag &dag) {
    return std::any_of(dag.tasks.begin(), dag.tasks.end(), [](const redag::Task &task) { return !task.callback; });
  }));
  EXPECT_EQ(bound.task_count(), workload.task_count() + 2);  // a second input of j, the data of t
  std::set<std::string> texts;
  for (const redag::Dag &dag : bound.dags) {
    for (const redag::Task &task : dag.tasks) EXPECT_TRUE(texts.insert(to_string(*task.callback)).second);
  }
  EXPECT_TRUE(texts.contains("/slow/j subscription /slow/x/output"));
  EXPECT_TRUE(texts.contains("/slow/j subscription /slow/y/output"));
}

TEST_F(Nodes, TimersAreOnTheGrid) {
  const Workload workload = workload_of(kLight);
  WorkloadNodes nodes(workload, {});
  nodes.arm(timer_clock_now() + 100 * kMillisecond);
  EXPECT_LT(nodes.phase_error(), kMillisecond);
}

TEST(RosLimits, WhatRosTimersCannotDoIsRefused) {
  const auto found =
      ros_limits(workload_of("{dags: [{name: d, max_pending: 3, tasks: ["
                             "{name: a, wcet: 1ms, period: 10ms, jitter: 1ms}]}]}"));
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].severity, redag::Severity::Warning);
  EXPECT_EQ(found[1].severity, redag::Severity::Error);
  EXPECT_THAT(found[1].message, HasSubstr("'d.a'"));
}

TEST(Executors, OnlyThoseOfThisDistributionAreAccepted) {
  EXPECT_TRUE(check_executor("mte").has_value());
  EXPECT_FALSE(check_executor("mtf").has_value());
  EXPECT_EQ(check_executor("events").has_value(), kHasEvents);
  const auto fixed = check_executor("static");
  ASSERT_EQ(fixed.has_value(), kHasStatic);
  if (!fixed) {
    EXPECT_THAT(fixed.error().front().hint, HasSubstr("'ste'"));
  }
  const auto cbg = check_executor("cbg");
  ASSERT_EQ(cbg.has_value(), kHasCbg);
  if (!cbg) {
    EXPECT_THAT(cbg.error().front().hint, HasSubstr("cm_executors"));
  }
}

}  // namespace
}  // namespace redag_rclcpp::lab
