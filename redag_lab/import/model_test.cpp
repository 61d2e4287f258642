// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/import/model.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <vector>

#include "redag_lab/import/recorded_nodes_test.hpp"

namespace redag::lab {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

class Import : public ::testing::Test {
 public:
  Recording recording;
  RecordedNodes nodes{recording};

  // Two timers send to a node whose later callback of a round works for 6 ms, by `longer` more each time.
  void fuse_two_inputs(RecordedNodes::Handle publisher, Duration longer) {
    const auto left = nodes.node("left");
    const auto right = nodes.node("right");
    const auto fuse = nodes.node("fuse");
    const auto a = nodes.timer(left, 20 * kMs);
    const auto b = nodes.timer(right, 20 * kMs);
    const auto to_a = nodes.publisher(left, "/a");
    const auto to_b = nodes.publisher(right, "/b");
    const auto from_a = nodes.subscription(fuse, "/a");
    const auto from_b = nodes.subscription(fuse, "/b");
    for (Time k = 1; k <= 40; ++k) {
      nodes.run(1, a, k * 20 * kMs, kMs, to_a);
      nodes.run(1, b, k * 20 * kMs + kMs, kMs, to_b);
      const bool a_first = k % 3 == 0;
      nodes.run(2, a_first ? from_a : from_b, k * 20 * kMs + 3 * kMs, 1000);
      nodes.run(2, a_first ? from_b : from_a, k * 20 * kMs + 4 * kMs, 6 * kMs + k * longer, publisher);
    }
  }
};

TEST_F(Import, FindsTimersAndWhatFollowsThem) {
  const auto lidar = nodes.node("lidar");
  const auto planner = nodes.node("planner");
  const auto scan = nodes.timer(lidar, 100 * kMs);
  const auto publisher = nodes.publisher(lidar, "/scan");
  const auto plan = nodes.subscription(planner, "/scan");
  for (Time k = 1; k <= 20; ++k) {
    nodes.run(1, scan, k * 100 * kMs, 2 * kMs + k, publisher);
    nodes.run(2, plan, k * 100 * kMs + 3 * kMs, 5 * kMs);
  }
  const ImportedWorkload imported = import(recording);
  ASSERT_EQ(imported.workload.dags.size(), 1U);
  const Dag &dag = imported.workload.dags.front();
  EXPECT_EQ(imported.workload.name, "robot");
  EXPECT_EQ(imported.workload.platform.workers, 2U);
  EXPECT_EQ(dag.name, "lidar");
  EXPECT_EQ(dag.edges, Edges::Seen);
  ASSERT_EQ(dag.tasks.size(), 2U);
  EXPECT_EQ(dag.tasks[0].name, "/lidar timer 100 ms (0)");
  EXPECT_EQ(dag.tasks[0].period, 100 * kMs);
  EXPECT_EQ(dag.tasks[0].phase, Phase::Unknown);
  EXPECT_EQ(dag.tasks[0].wcet, 2 * kMs + 20);
  EXPECT_EQ(dag.tasks[0].bcet, 2 * kMs + 1);
  EXPECT_EQ(dag.tasks[0].callback, (Callback{"/lidar", Callback::Kind::Timer, {}, 100 * kMs, 0U}));
  EXPECT_EQ(dag.tasks[1].activation, Activation::Data);
  EXPECT_EQ(dag.tasks[1].period, 100 * kMs);
  EXPECT_THAT(dag.tasks[1].predecessors, ElementsAre(0U));
  EXPECT_EQ(dag.tasks[1].wcet, 5 * kMs);
  EXPECT_EQ(imported.executed, imported.explained);
  EXPECT_EQ(imported.over_edges, 20U);
  EXPECT_EQ(imported.replays[0].responses.max, 2 * kMs + 20);
  EXPECT_EQ(imported.replays[1].responses.max, 6 * kMs - 1);  // from the message, at the end of the scan
  EXPECT_EQ(imported.overhead, 0);
  EXPECT_THAT(all_remarks(imported), HasSubstr("wall time"));
  EXPECT_THAT(notes_of(imported, "/lidar"), HasSubstr("longest of 20 runs"));
}

TEST_F(Import, KnowsWhenTimersExpired) {
  const auto timer = nodes.timer(nodes.node("early"), 10 * kMs);
  for (Time k = 1; k <= 100; ++k) nodes.run(1, timer, k * 10 * kMs + (k % 2 == 0 ? -2000 : 60'000), kMs);
  const ImportedWorkload imported = import(recording);
  EXPECT_EQ(imported.replays[0].responses.min, kMs);
  EXPECT_EQ(imported.replays[0].responses.max, kMs + 60'000);
}

TEST_F(Import, SplitsWhereRatesDiffer) {
  const auto node = nodes.node("camera");
  const auto timer = nodes.timer(node, 10 * kMs);
  const auto publisher = nodes.publisher(node, "/image");
  const auto slow = nodes.subscription(nodes.node("detect"), "/image");
  for (Time k = 1; k <= 100; ++k) {
    const bool sends = k % 5 == 0;
    nodes.run(1, timer, k * 10 * kMs, kMs, sends ? publisher : 0);
    if (sends) nodes.run(2, slow, k * 10 * kMs + 2 * kMs, 3 * kMs);
  }
  const ImportedWorkload imported = import(recording);
  EXPECT_EQ(imported.workload.dags.size(), 2U);
  EXPECT_EQ(task_named(imported, "/detect").period, 50 * kMs);
  EXPECT_THAT(task_named(imported, "/detect").predecessors, IsEmpty());
  EXPECT_THAT(notes_of(imported, "/detect"), HasSubstr("publishes /image 20 times in 100 runs"));
}

// The last callback of a round does the work and publishes: the round is one job.
TEST_F(Import, JoinsCallbacksThatWaitForEachOther) {
  fuse_two_inputs(nodes.publisher(nodes.node("sender"), "/c"), 0);
  const ImportedWorkload imported = import(recording);
  ASSERT_EQ(imported.workload.task_count(), 3U) << to_yaml(imported);
  const Task &joined = task_named(imported, "/fuse");
  EXPECT_EQ(joined.activation, Activation::Data);
  EXPECT_EQ(joined.predecessors.size(), 2U);
  EXPECT_EQ(joined.bcet, 6 * kMs);  // storing is no job
  EXPECT_THAT(notes_of(imported, "/fuse"), HasSubstr("one job of /a and /b: the last of a round does it"));
}

TEST_F(Import, JoinsCallbacksThatPublishNothing) {
  fuse_two_inputs(0, 1);
  const ImportedWorkload imported = import(recording);
  ASSERT_EQ(imported.workload.task_count(), 3U) << to_yaml(imported);
  EXPECT_EQ(task_named(imported, "/fuse").predecessors.size(), 2U);
  EXPECT_EQ(task_named(imported, "/fuse").bcet, 6 * kMs + 1);
  EXPECT_EQ(task_named(imported, "/fuse").wcet, 6 * kMs + 40);
}

TEST_F(Import, KeepsCallbacksApartOfWhichOneAlwaysWorks) {
  const auto node = nodes.node("both");
  const auto tiny = nodes.subscription(node, "/a");
  const auto big = nodes.subscription(node, "/b");
  for (Time k = 1; k <= 40; ++k) {
    nodes.run(1, tiny, k * 20 * kMs, 1000);
    nodes.run(1, big, k * 20 * kMs + kMs, 6 * kMs);
  }
  EXPECT_EQ(import(recording).workload.task_count(), 2U);
}

TEST_F(Import, TakesTwoPublishersAsTwoReleases) {
  const auto one = nodes.node("one");
  const auto two = nodes.node("two");
  const auto a = nodes.timer(one, 20 * kMs);
  const auto b = nodes.timer(two, 20 * kMs);
  const auto from_a = nodes.publisher(one, "/tf");
  const auto from_b = nodes.publisher(two, "/tf");
  const auto tf = nodes.subscription(nodes.node("listener"), "/tf");
  for (Time k = 1; k <= 40; ++k) {
    nodes.run(1, a, k * 20 * kMs, kMs, from_a);
    nodes.run(1, tf, k * 20 * kMs + 2 * kMs, 1000);
    nodes.run(1, b, k * 20 * kMs + 10 * kMs, kMs, from_b);
    nodes.run(1, tf, k * 20 * kMs + 12 * kMs, 1000);
  }
  const ImportedWorkload imported = import(recording);
  EXPECT_EQ(task_named(imported, "/listener").period, 10 * kMs);
  EXPECT_THAT(notes_of(imported, "/listener"), HasSubstr("several publishers"));
  EXPECT_EQ(imported.as_sources, 80U);
}

TEST_F(Import, MeasuresWhatComesFromOutside) {
  const auto image = nodes.subscription(nodes.node("viewer"), "/image");
  for (Time k = 0; k < 100; ++k) {
    nodes.now = k * 33'333'333 + 1'000'000 * (k % 7);
    nodes.take(1, image, kSecond + k * 33'333'333 + 100'000 * (k % 2));  // sent with less jitter than it is taken
    nodes.run(1, image, nodes.now, kMs);
  }
  const Task task = task_named(import(recording), "/viewer");
  EXPECT_EQ(task.period, 33'333'333);
  EXPECT_EQ(task.phase, Phase::Unknown);
  EXPECT_NEAR(static_cast<double>(task.jitter), 100'000, 5000);
}

TEST_F(Import, TakesServicesAsEvents) {
  const auto service = nodes.service(nodes.node("map"), "/map/save");
  for (const Time at : {0, 100, 190, 400, 520}) nodes.run(1, service, at * kMs, kMs);
  const ImportedWorkload imported = import(recording);
  const Task &task = task_named(imported, "/map");
  EXPECT_EQ(task.phase, Phase::Event);
  EXPECT_EQ(task.period, 90 * kMs);
  EXPECT_THAT(notes_of(imported, "/map"), HasSubstr("shortest distance"));
}

TEST_F(Import, SaysWhatHasNoRate) {
  const auto node = nodes.node("late");
  const auto timer = nodes.timer(node, 10 * kMs);
  const auto latched = nodes.subscription(node, "/map");
  const auto once = nodes.timer(node, 5 * kMs);
  (void)nodes.subscription(node, "/never");
  nodes.run(1, latched, kMs, kMs);
  nodes.run(1, once, 5 * kMs, kMs);
  for (Time k = 1; k <= 100; ++k) nodes.run(1, timer, k * 10 * kMs, kMs);
  const ImportedWorkload imported = import(recording);
  EXPECT_EQ(imported.workload.task_count(), 1U);
  EXPECT_THAT(imported.left_out,
              ElementsAre("/late subscription /map: ran 1 time: its rate is unknown",
                          "/late timer 5 ms (1): ran 1 time: its rate is unknown", "1 callback that never ran"));
  EXPECT_LT(imported.explained, imported.executed);
  EXPECT_THAT(to_yaml(imported), HasSubstr("# left out: /late subscription /map"));
}

TEST_F(Import, SubtractsTimeWithoutAProcessor) {
  const auto timer = nodes.timer(nodes.node("worker"), 10 * kMs);
  for (Time k = 1; k <= 10; ++k) {
    nodes.now = k * 10 * kMs;
    nodes.start(7, timer);
    nodes.now += kMs;
    nodes.switch_to(7, 99);
    nodes.now += 3 * kMs;
    nodes.switch_to(99, 7);
    nodes.now += kMs;
    nodes.end(7, timer);
  }
  const ImportedWorkload imported = import(recording);
  EXPECT_EQ(task_named(imported, "/worker").wcet, 2 * kMs);
  EXPECT_THAT(all_remarks(imported), HasSubstr("processor time"));
}

TEST_F(Import, AssumesOneGroupOfWhatNeverOverlapped) {
  const auto node = nodes.node("driver");
  const auto a = nodes.timer(node, 10 * kMs);
  const auto b = nodes.timer(node, 20 * kMs);
  const auto c = nodes.timer(node, 40 * kMs);
  for (Time k = 1; k <= 40; ++k) {
    nodes.run(1, a, k * 10 * kMs, kMs);
    if (k % 2 == 0) nodes.run(2, b, k * 10 * kMs + 2 * kMs, kMs);
    if (k % 4 != 0) continue;
    nodes.now = k * 10 * kMs + 5 * kMs;
    nodes.start(1, c);
    nodes.run(2, a, nodes.now + 1000, 1000);  // while c runs
    nodes.end(1, c);
  }
  const ImportedWorkload imported = import(recording);
  EXPECT_EQ(task_named(imported, "10 ms").group, "/driver");
  EXPECT_EQ(task_named(imported, "20 ms").group, "/driver");
  EXPECT_EQ(task_named(imported, "40 ms").group, "");
  EXPECT_THAT(all_remarks(imported), HasSubstr("unknown: callback groups"));
}

TEST_F(Import, SeesReentrantCallbacks) {
  const auto timer = nodes.timer(nodes.node("wide"), 10 * kMs);
  for (Time k = 1; k <= 20; ++k) {
    nodes.now = k * 10 * kMs;
    nodes.start(1, timer);
    nodes.start(2, timer);
    nodes.now += kMs;
    nodes.end(1, timer);
    nodes.end(2, timer);
  }
  EXPECT_EQ(task_named(import(recording), "/wide").concurrency, 2U);
}

TEST_F(Import, OpensCircles) {
  const auto node = nodes.node("ping");
  const auto other = nodes.node("pong");
  const auto ping = nodes.subscription(node, "/pong");
  const auto pong = nodes.subscription(other, "/ping");
  const auto to_pong = nodes.publisher(node, "/ping");
  const auto to_ping = nodes.publisher(other, "/pong");
  for (Time k = 0; k < 50; ++k) {
    nodes.run(1, ping, k * 10 * kMs, kMs, to_pong);
    nodes.run(1, pong, k * 10 * kMs + 5 * kMs, kMs, to_ping);
  }
  const ImportedWorkload imported = import(recording);
  EXPECT_EQ(task_named(imported, "/ping sub").period, 10 * kMs);
  EXPECT_THAT(task_named(imported, "/pong sub").predecessors.size(), 1U);
  EXPECT_THAT(notes_of(imported, "/ping sub"), HasSubstr("circle"));
}

// A subscription takes messages of its own process by a second object, which names its callback first.
TEST_F(Import, KnowsCallbacksOfIntraProcessMessages) {
  const auto node = nodes.node("near");
  const auto timer = nodes.timer(node, 10 * kMs);
  const auto publisher = nodes.publisher(node, "/data");
  constexpr std::uint64_t kHandle = 10;
  constexpr std::uint64_t kObject = 11;
  constexpr std::uint64_t kCallback = 12;
  nodes.add(RosEvent::Kind::SubscriptionInit, kHandle, nodes.node("taker"), 0, "/data");
  nodes.add(RosEvent::Kind::SubscriptionCallback, kObject, kCallback);
  nodes.add(RosEvent::Kind::SubscriptionObject, kHandle, kObject);
  for (Time k = 1; k <= 20; ++k) {
    nodes.now = k * 10 * kMs;
    nodes.start(1, timer);
    nodes.add(RosEvent::Kind::IntraPublish, publisher);
    nodes.publish(1, publisher);  // the same message, for other processes
    nodes.end(1, timer);
    nodes.start(1, kCallback, true);
    nodes.now += kMs;
    nodes.end(1, kCallback);
  }
  EXPECT_THAT(task_named(import(recording), "/taker").predecessors, ElementsAre(0U));
}

TEST_F(Import, SaysWhenASenderLeftNoEvents) {
  const auto hidden = nodes.subscription(nodes.node("taker"), "/data");
  for (Time k = 1; k <= 20; ++k) {
    nodes.now = k * 10 * kMs;
    nodes.start(1, hidden, true);
    nodes.end(1, hidden);
  }
  EXPECT_THAT(notes_of(import(recording), "/taker"), HasSubstr("unknown callback"));
}

TEST_F(Import, CountsWhatWasNotRecorded) {
  const auto timer = nodes.timer(nodes.node("seen"), 10 * kMs);
  nodes.end(1, timer);  // it began before the recording
  for (Time k = 1; k <= 10; ++k) {
    nodes.run(1, timer, k * 10 * kMs, kMs);
    nodes.run(1, 77, k * 10 * kMs + 2 * kMs, kMs);
  }
  nodes.start(1, timer);
  nodes.run(1, 77, nodes.now, kMs);
  const ImportedWorkload imported = import(recording);
  EXPECT_EQ(imported.executed, 21 * kMs);
  EXPECT_EQ(imported.explained, 10 * kMs);
  EXPECT_THAT(all_remarks(imported), HasSubstr("unknown: 11 runs of callbacks whose creation was not recorded"));
  EXPECT_THAT(all_remarks(imported), HasSubstr("unknown: 1 run whose begin or end"));
}

// A callback that spins another executor inside does not execute what runs there.
TEST_F(Import, DividesTimeBetweenNestedCallbacks) {
  const auto node = nodes.node("outer");
  const auto outer = nodes.timer(node, 10 * kMs);
  const auto inner = nodes.timer(node, 20 * kMs);
  for (Time k = 1; k <= 10; ++k) {
    nodes.now = k * 20 * kMs;
    nodes.start(1, outer);
    nodes.run(1, inner, nodes.now + kMs, 2 * kMs);
    nodes.now += kMs;
    nodes.end(1, outer);
  }
  const ImportedWorkload imported = import(recording);
  EXPECT_EQ(task_named(imported, " 10 ms").wcet, 2 * kMs);
  EXPECT_EQ(task_named(imported, " 20 ms").wcet, 2 * kMs);
}

TEST_F(Import, DoubtsTheClockOfATimer) {
  const auto node = nodes.node("sim");
  const auto fast = nodes.timer(node, 100 * kMs);
  const auto slow = nodes.timer(node, 10 * kMs);
  for (Time k = 1; k <= 50; ++k) {
    nodes.run(1, fast, k * 50 * kMs, kMs);
    nodes.run(1, slow, k * 50 * kMs + 2 * kMs, kMs);
  }
  const ImportedWorkload imported = import(recording);
  EXPECT_EQ(task_named(imported, "100 ms").period, 50 * kMs);
  EXPECT_EQ(task_named(imported, " 10 ms").period, 10 * kMs);
  EXPECT_THAT(notes_of(imported, " 10 ms"), HasSubstr("unknown"));
}

TEST_F(Import, KeepsProcessesApart) {
  RecordedNodes second(recording, 2);  // the same handles as in the first process
  const auto talk = nodes.timer(nodes.node("talker"), 10 * kMs);
  const auto listen = second.timer(second.node("listener"), 20 * kMs);
  for (Time k = 1; k <= 20; ++k) {
    nodes.run(1, talk, k * 20 * kMs, kMs);
    second.run(1, listen, k * 20 * kMs, 2 * kMs);
  }
  EXPECT_EQ(task_named(import(recording, 1), "/talker").wcet, kMs);
  EXPECT_EQ(task_named(import(recording, 2), "/listener").wcet, 2 * kMs);
}

TEST_F(Import, RefusesCallbacksThatWereNotSeenToBeCreated) {
  for (Time k = 1; k <= 5; ++k) nodes.run(1, 77, k * 10 * kMs, kMs);
  const Result<ImportedWorkload> imported = import_workload(recording, 1);
  ASSERT_FALSE(imported);
  EXPECT_THAT(to_string(imported.error()), HasSubstr("before the nodes start"));
}

TEST_F(Import, RefusesNamesThatNoFileCanHold) {
  const auto timer = nodes.timer(nodes.node("a\nplatform: {workers: 1}"), 10 * kMs);
  for (Time k = 1; k <= 5; ++k) nodes.run(1, timer, k * 10 * kMs, kMs);
  EXPECT_FALSE(import_workload(recording, 1));
}

TEST_F(Import, TellsWakeUpsFromWaiting) {
  const auto node = nodes.node("busy");
  const auto first = nodes.timer(node, 10 * kMs);
  const auto second = nodes.timer(node, 10 * kMs);
  for (Time k = 1; k <= 100; ++k) {
    nodes.run(1, first, k * 10 * kMs + 80'000, kMs);                // the thread slept
    nodes.run(1, second, k * 10 * kMs + 80'000 + kMs + 7000, kMs);  // the thread was busy
  }
  const ImportedWorkload imported = import(recording);
  EXPECT_EQ(imported.wake_ups.count, 100U);
  EXPECT_EQ(imported.wake_ups.p50, 80'000);
  EXPECT_EQ(imported.overhead, 7000);
  EXPECT_EQ(imported.replays[0].executions, std::vector<Duration>(100, kMs));
  EXPECT_EQ(imported.replays[0].delays, std::vector<Duration>(100, 80'000));
  EXPECT_EQ(imported.replays[1].delays, std::vector<Duration>(100, 7000));
}

// No event tells that a timer was reset. What began while the executor was idle shows its new grid.
TEST_F(Import, SeesThatATimerWasReset) {
  const auto node = nodes.node("reset");
  const auto timer = nodes.timer(node, 10 * kMs);
  const auto other = nodes.timer(node, 100 * kMs);
  for (Time k = 1; k <= 100; ++k) {
    const Time expires = k * 10 * kMs + 4 * kMs;
    if (k % 10 != 0) nodes.run(1, timer, expires + k * 1000, kMs);
    if (k % 10 != 0) continue;
    nodes.run(1, other, k * 10 * kMs, 6 * kMs);  // makes the other one late
    nodes.run(1, timer, k * 10 * kMs + 6 * kMs, kMs);
  }
  const ImportedWorkload imported = import(recording);
  EXPECT_EQ(imported.replays[0].responses.max, 3 * kMs - 1000);
  EXPECT_EQ(imported.replays[0].offset, 14 * kMs + 1000);
  EXPECT_EQ(imported.replays[1].responses.max, 6 * kMs);
}

TEST_F(Import, NumbersReleasesThatNoRunAnswered) {
  const auto timer = nodes.timer(nodes.node("late"), 10 * kMs);
  for (Time k = 1; k <= 30; ++k) {
    if (k % 10 != 4 && k % 10 != 5) nodes.run(1, timer, k * 10 * kMs, k % 10 == 3 ? 25 * kMs : k * 1000);
  }
  const std::vector<Duration> executions = import(recording).replays[0].executions;
  ASSERT_EQ(executions.size(), 30U);
  EXPECT_EQ(executions[2], 25 * kMs);
  EXPECT_EQ(executions[5], 6000);
  EXPECT_EQ(executions[29], 30'000);
}

// rclcpp walks through what a wait returned in an order of its own.
TEST_F(Import, SeesTheOrderOfReadyCallbacks) {
  const auto node = nodes.node("ordered");
  const std::vector<RecordedNodes::Handle> timers{nodes.timer(node, 10 * kMs), nodes.timer(node, 10 * kMs),
                                                  nodes.timer(node, 10 * kMs)};
  for (Time k = 1; k <= 20; ++k) {
    nodes.now = k * 10 * kMs;
    nodes.add(RosEvent::Kind::Wait, 0);
    for (const std::size_t i : {2U, 0U, 1U}) {
      nodes.add(RosEvent::Kind::Look, 0);
      nodes.run(1, timers[i], nodes.now, kMs);
    }
  }
  std::vector<std::uint32_t> ranks;
  for (const Replay &replay : import(recording).replays) ranks.push_back(replay.rank);
  EXPECT_THAT(ranks, ElementsAre(1U, 2U, 0U));
}

// A response counts from the message that was taken, though a later one was sent before the callback began.
TEST_F(Import, KnowsWhichMessageWasTaken) {
  const auto sender = nodes.node("sender");
  const auto timer = nodes.timer(sender, 10 * kMs);
  const auto publisher = nodes.publisher(sender, "/x");
  const auto taker = nodes.subscription(nodes.node("taker"), "/x");
  for (Time k = 1; k <= 20; ++k) {
    nodes.run(1, timer, k * 10 * kMs, kMs, publisher);
    if (k == 1) continue;
    nodes.now = k * 10 * kMs + 2 * kMs;
    nodes.take(2, taker, (k - 1) * 10 * kMs + kMs + 20'000);  // the middleware stamps it a little later
    nodes.run(2, taker, nodes.now, 3 * kMs);
  }
  EXPECT_EQ(import(recording).replays[1].responses.p50, 14 * kMs);
}

// LTTng loses events where a process is killed.
TEST_F(Import, TrustsTheStampOfAMessageWhoseEventIsLost) {
  const auto sender = nodes.node("sender");
  const auto timer = nodes.timer(sender, 10 * kMs);
  const auto publisher = nodes.publisher(sender, "/x");
  const auto taker = nodes.subscription(nodes.node("taker"), "/x");
  for (Time k = 1; k <= 40; ++k) {
    if (k <= 20) nodes.run(1, timer, k * 10 * kMs, kMs, publisher);
    nodes.now = k * 10 * kMs + 2 * kMs;
    nodes.take(2, taker, k * 10 * kMs + kMs);
    nodes.run(2, taker, nodes.now, kMs);
  }
  EXPECT_EQ(import(recording).replays[1].responses.max, 2 * kMs);
}

// The simulation of the recorded run repeats when messages came, of which the file says the period and jitter only.
TEST_F(Import, ReplaysMessagesAsTheyCame) {
  const auto taker = nodes.subscription(nodes.node("taker"), "/x");
  std::vector<Time> sent;
  for (Time k = 1; k <= 20; ++k) {
    sent.push_back(k * 10 * kMs + (k % 3) * kMs / 2);
    nodes.now = sent.back() + kMs;
    nodes.take(1, taker, sent.back());
    nodes.run(1, taker, nodes.now, kMs);
  }
  const ImportedWorkload imported = import(recording);
  const Task &task = task_named(imported, "taker");
  const Replay &replay = imported.replays[0];
  EXPECT_NEAR(static_cast<double>(task.jitter), 1.0 * kMs, 0.1 * kMs);
  ASSERT_EQ(replay.gaps.size(), sent.size());
  for (std::size_t i = 1; i < sent.size(); ++i) EXPECT_EQ(task.period + replay.gaps[i], sent[i] - sent[i - 1]);
}

TEST_F(Import, TrustsTheClockOfANearSender) {
  const auto near = nodes.subscription(nodes.node("near"), "/near");
  const auto far = nodes.subscription(nodes.node("far"), "/far");
  for (Time k = 1; k <= 20; ++k) {
    nodes.now = k * 10 * kMs;
    nodes.take(1, near, nodes.now - kMs);
    nodes.run(1, near, nodes.now, kMs);
    nodes.now += 2 * kMs;
    nodes.take(1, far, nodes.now + kMs);  // sent later than taken
    nodes.run(1, far, nodes.now, kMs);
  }
  const ImportedWorkload imported = import(recording);
  EXPECT_EQ(imported.replays[0].responses.p50, 2 * kMs);
  EXPECT_EQ(imported.replays[1].responses.count, 0U);
}

TEST_F(Import, KnowsTheGroupsThatCaretRecords) {
  const auto node = nodes.node("grouped");
  std::vector<RecordedNodes::Handle> timers;
  for (std::uint64_t i = 0; i < 4; ++i) {
    timers.push_back(nodes.timer(node, 10 * kMs));
    const RecordedNodes::Handle group = i < 2 ? 1 : i;
    nodes.add(RosEvent::Kind::GroupMember, timers.back() - 1, group);
    nodes.add(RosEvent::Kind::Group, group, 0, 0, i == 3 ? "reentrant" : "mutually_exclusive");
  }
  for (Time k = 1; k <= 20; ++k) {
    for (std::size_t i = 0; i < timers.size(); ++i) {
      nodes.run(1, timers[i], k * 10 * kMs + static_cast<Time>(i) * kMs, kMs);
    }
  }
  const ImportedWorkload imported = import(recording);
  std::vector<std::string> groups;
  for (const TaskRef &ref : flatten(imported.workload)) groups.push_back(ref.task->group);
  EXPECT_THAT(groups, ElementsAre("group 1", "group 1", "", ""));
  EXPECT_THAT(all_remarks(imported), Not(HasSubstr("callback groups")));
}

}  // namespace
}  // namespace redag::lab
