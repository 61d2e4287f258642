// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/import/model.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>

#include "redag/loader/workload_yaml.hpp"
#include "redag_lab/import/self_check.hpp"
#include "redag_lab/run/session.hpp"
#include "redag_lab/run/variant.hpp"
#include "redag_lab/workload/generate.hpp"

namespace redag::lab {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr Time kMs = kMillisecond;

// Writes the events of one process as rclcpp records them. Handles are numbers that it gives out.
class RecordedNodes {
 public:
  using Kind = RosEvent::Kind;
  using Handle = std::uint64_t;

  explicit RecordedNodes(Recording &recording, std::uint32_t process = 1) : recording_(recording), process_(process) {}

  Time now = 0;

  Handle node(const std::string &name) {
    const Handle handle = next_++;
    add(Kind::NodeInit, handle, 0, 0, name, "/");
    return handle;
  }
  Handle publisher(Handle node, const std::string &topic) {
    const Handle handle = next_++;
    add(Kind::PublisherInit, handle, node, 0, topic);
    return handle;
  }
  /// Returns the callback, as the functions below do.
  Handle subscription(Handle node, const std::string &topic) {
    const Handle handle = next_;
    next_ += 4;
    RosEvent event = made(Kind::SubscriptionInit, handle, node, 0, topic);
    event.third = handle + 1;
    recording_.add(event);
    add(Kind::SubscriptionObject, handle, handle + 2);
    add(Kind::SubscriptionCallback, handle + 2, handle + 3);
    taking_[handle + 3] = handle + 1;
    return handle + 3;
  }
  Handle service(Handle node, const std::string &name) {
    const Handle handle = next_;
    next_ += 2;
    add(Kind::ServiceInit, handle, node, 0, name);
    add(Kind::CallbackAdded, handle, handle + 1);
    return handle + 1;
  }
  Handle timer(Handle node, Duration period) {
    const Handle handle = next_;
    next_ += 2;
    add(Kind::TimerInit, handle, 0, period);
    add(Kind::CallbackAdded, handle, handle + 1);
    add(Kind::TimerNode, handle, node);
    return handle + 1;
  }

  void start(std::uint32_t thread, Handle callback, bool intra_process = false) {
    thread_ = thread;
    add(Kind::Start, callback, 0, intra_process ? 1 : 0);
  }
  void take(std::uint32_t thread, Handle callback, Time sent) {
    thread_ = thread;
    add(Kind::Take, taking_.at(callback), 0, sent);
  }
  void publish(std::uint32_t thread, Handle publisher) {
    thread_ = thread;
    add(Kind::Publish, publisher);
  }
  void end(std::uint32_t thread, Handle callback) {
    thread_ = thread;
    add(Kind::End, callback);
  }
  /// A whole run of a callback at this time.
  void run(std::uint32_t thread, Handle callback, Time at, Duration length, Handle publisher = 0) {
    now = at;
    start(thread, callback);
    now = at + length;
    if (publisher != 0) publish(thread, publisher);
    end(thread, callback);
  }
  void switch_to(std::uint64_t leaving, std::uint64_t coming) { add(Kind::Switch, leaving, coming); }
  void add(Kind kind, Handle handle, Handle other = 0, std::int64_t value = 0, std::string_view name = {},
           std::string_view space = {}) {
    recording_.add(made(kind, handle, other, value, name, space));
  }

 private:
  [[nodiscard]] RosEvent made(Kind kind, Handle handle, Handle other, std::int64_t value, std::string_view name,
                              std::string_view space = {}) const {
    RosEvent event;
    event.kind = kind;
    event.time = now;
    event.process = process_;
    event.thread = thread_;
    event.handle = handle;
    event.other = other;
    event.value = value;
    event.name = name;
    event.space = space;
    event.program = "robot";
    return event;
  }

  Recording &recording_;
  std::uint32_t process_;
  std::uint32_t thread_ = 1;
  Handle next_ = 1000;
  std::map<Handle, Handle> taking_;
};

ImportedWorkload import(const Recording &recording, std::uint32_t process = 1) {
  Result<ImportedWorkload> imported = import_workload(recording, process);
  if (!imported) {
    ADD_FAILURE() << to_string(imported.error());
    return {};
  }
  // The file is read as it was meant.
  const Result<LoadedWorkload> loaded = parse_workload(to_yaml(*imported), "robot.yaml");
  if (loaded) {
    EXPECT_EQ(loaded->workload, imported->workload) << to_yaml(*imported);
  } else {
    ADD_FAILURE() << to_yaml(*imported) << to_string(loaded.error());
  }
  return *std::move(imported);
}

const Task &task_named(const ImportedWorkload &imported, const std::string &part) {
  static const Task kNone;
  for (const TaskRef &ref : flatten(imported.workload)) {
    if (ref.task->name.find(part) != std::string::npos) return *ref.task;
  }
  ADD_FAILURE() << "no task " << part << " in\n" << to_yaml(imported);
  return kNone;
}

std::string notes_of(const ImportedWorkload &imported, const std::string &part) {
  std::string text;
  for (const TaskRef &ref : flatten(imported.workload)) {
    if (ref.task->name.find(part) == std::string::npos) continue;
    for (const std::string &note : imported.notes[ref.id.value]) text += note + "\n";
  }
  return text;
}

std::string all_remarks(const ImportedWorkload &imported) {
  std::string text;
  for (const std::string &remark : imported.remarks) text += remark + "\n";
  return text;
}

class Import : public ::testing::Test {
 public:
  Recording recording;
  RecordedNodes nodes{recording};
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
  EXPECT_EQ(imported.responses[0].max, 2 * kMs + 20);
  EXPECT_EQ(imported.responses[1].max, 6 * kMs - 1);  // from the message, at the end of the scan
  EXPECT_EQ(imported.overhead, 0);
  EXPECT_THAT(all_remarks(imported), HasSubstr("wall time"));
  EXPECT_THAT(notes_of(imported, "/lidar"), HasSubstr("longest of 20 runs"));
}

TEST_F(Import, KnowsWhenTimersExpired) {
  const auto timer = nodes.timer(nodes.node("early"), 10 * kMs);
  for (Time k = 1; k <= 100; ++k) nodes.run(1, timer, k * 10 * kMs + (k % 2 == 0 ? -2000 : 60'000), kMs);
  const ImportedWorkload imported = import(recording);
  EXPECT_EQ(imported.responses[0].min, kMs);
  EXPECT_EQ(imported.responses[0].max, kMs + 60'000);
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
  const auto left = nodes.node("left");
  const auto right = nodes.node("right");
  const auto fuse = nodes.node("fuse");
  const auto a = nodes.timer(left, 20 * kMs);
  const auto b = nodes.timer(right, 20 * kMs);
  const auto to_a = nodes.publisher(left, "/a");
  const auto to_b = nodes.publisher(right, "/b");
  const auto to_c = nodes.publisher(fuse, "/c");
  const auto from_a = nodes.subscription(fuse, "/a");
  const auto from_b = nodes.subscription(fuse, "/b");
  for (Time k = 1; k <= 40; ++k) {
    nodes.run(1, a, k * 20 * kMs, kMs, to_a);
    nodes.run(1, b, k * 20 * kMs + kMs, kMs, to_b);
    const bool a_first = k % 3 == 0;
    nodes.run(2, a_first ? from_a : from_b, k * 20 * kMs + 3 * kMs, 1000);
    nodes.run(2, a_first ? from_b : from_a, k * 20 * kMs + 4 * kMs, 6 * kMs, to_c);
  }
  const ImportedWorkload imported = import(recording);
  ASSERT_EQ(imported.workload.task_count(), 3U) << to_yaml(imported);
  const Task &joined = task_named(imported, "/fuse");
  EXPECT_EQ(joined.activation, Activation::Data);
  EXPECT_EQ(joined.predecessors.size(), 2U);
  EXPECT_EQ(joined.bcet, 6 * kMs);  // storing is no job
  EXPECT_THAT(notes_of(imported, "/fuse"), HasSubstr("one job of /a and /b: the last of a round does it"));
}

TEST_F(Import, JoinsCallbacksThatPublishNothing) {
  const auto left = nodes.node("left");
  const auto fuse = nodes.node("fuse");
  const auto a = nodes.timer(left, 20 * kMs);
  const auto b = nodes.timer(left, 20 * kMs);
  const auto to_a = nodes.publisher(left, "/a");
  const auto to_b = nodes.publisher(left, "/b");
  const auto from_a = nodes.subscription(fuse, "/a");
  const auto from_b = nodes.subscription(fuse, "/b");
  for (Time k = 1; k <= 40; ++k) {
    nodes.run(1, a, k * 20 * kMs, kMs, to_a);
    nodes.run(1, b, k * 20 * kMs + kMs, kMs, to_b);
    const bool a_first = k % 3 == 0;
    nodes.run(2, a_first ? from_a : from_b, k * 20 * kMs + 3 * kMs, 1000);
    nodes.run(2, a_first ? from_b : from_a, k * 20 * kMs + 4 * kMs, 6 * kMs + k);
  }
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

TEST(Arrivals, OfALossyBus) {
  std::vector<Time> instants;
  for (Time k = 0; k < 200; ++k) {
    if (k % 10 != 3) instants.push_back(k * 5 * kMs + (k % 3) * 20'000);
  }
  const Arrivals arrivals = estimate_arrivals(instants);
  EXPECT_EQ(arrivals.period, 5 * kMs);
  EXPECT_FALSE(arrivals.sporadic);
  EXPECT_NEAR(static_cast<double>(arrivals.jitter), 40'000, 1000);
  EXPECT_THAT(arrivals.note, HasSubstr("20 of 200 did not come"));
}

TEST(Arrivals, OfBursts) {
  std::vector<Time> instants;
  for (Time k = 0; k < 100; ++k) {
    for (const Time at : {0, 10'000, 70'000}) instants.push_back(k * 100 * kMs + at);
  }
  const Arrivals arrivals = estimate_arrivals(instants);
  EXPECT_NEAR(static_cast<double>(arrivals.period), 100.0 / 3 * kMs, kMs);
  EXPECT_EQ(arrivals.jitter, arrivals.period);
  EXPECT_THAT(arrivals.note, HasSubstr("unknown"));
}

TEST(Arrivals, AtOneInstant) { EXPECT_EQ(estimate_arrivals({5, 5, 5}).period, 1); }

// ---- random workloads, simulated, and recorded as ros2_tracing would ----

// Nodes that run a workload: one for each task, with a timer, or a subscription for each predecessor. The message that
// completes the predecessors of a data task runs its job; earlier ones are stored. Every third timer task takes
// messages from outside instead.
class SimulatedNodes {
 public:
  SimulatedNodes(const Workload &workload, Recording &recording, bool some_outside = true) : nodes_(recording) {
    for (const TaskRef &ref : flatten(workload)) {
      Node &node = tasks_.emplace_back();
      node.name = name_of(ref.id);
      const auto handle = nodes_.node(node.name);
      const std::size_t first = ref.id.value - ref.index;
      for (const std::uint32_t p : ref.task->predecessors) {
        node.inputs.emplace_back(first + p, nodes_.subscription(handle, "/" + name_of(TaskId(first + p)) + "/out"));
      }
      node.is_outside = some_outside && node.inputs.empty() && ref.id.value % 3 == 2;
      if (node.is_outside) {
        node.source = nodes_.subscription(handle, "/outside/" + node.name);
      } else if (node.inputs.empty()) {
        nodes_.now = ref.task->offset;  // where the timer's grid begins
        node.source = nodes_.timer(handle, ref.task->period);
        nodes_.now = 0;
      }
      node.output = nodes_.publisher(handle, "/" + node.name + "/out");
    }
    for (std::size_t task = 0; task < tasks_.size(); ++task) {
      for (const auto &[from, callback] : tasks_[task].inputs) tasks_[from].successors.push_back(task);
    }
  }

  static std::string name_of(TaskId task) { return "n" + std::to_string(task.value); }

  /// Longest execution of each task in the recording.
  std::vector<Duration> longest;

  // Returns false if something happened that these nodes do not do.
  bool play(const std::vector<JobEvent> &events) {
    longest.assign(tasks_.size(), 0);
    for (const JobEvent &event : events) {
      nodes_.now = event.time;
      Node &node = tasks_[event.task.value];
      switch (event.kind) {
        case JobEventKind::Released: node.released = event.value; break;
        case JobEventKind::Dispatched:
          if (node.is_outside) nodes_.take(event.worker, node.source, kEpoch + node.released);
          node.running = node.inputs.empty() ? node.source : node.trigger;
          node.started = event.time;
          nodes_.start(event.worker, node.running);
          break;
        case JobEventKind::Finished:
          if (!node.successors.empty()) nodes_.publish(event.worker, node.output);
          nodes_.end(event.worker, node.running);
          longest[event.task.value] = std::max(longest[event.task.value], event.time - node.started);
          node.running = 0;
          for (const std::size_t to : node.successors) deliver(event.task.value, tasks_[to], event.worker);
          break;
        case JobEventKind::Ready:
        case JobEventKind::Started:
        case JobEventKind::Executed: break;
        default: return false;
      }
      if (overlapped_) return false;
    }
    return true;
  }

 private:
  static constexpr Time kEpoch = 1'700'000'000 * kSecond;  // messages have another clock than events

  struct Node {
    std::string name;
    std::vector<std::pair<std::size_t, RecordedNodes::Handle>> inputs;
    std::vector<std::size_t> successors;
    std::set<std::size_t> fresh;
    RecordedNodes::Handle source = 0;
    RecordedNodes::Handle output = 0;
    RecordedNodes::Handle trigger = 0;
    RecordedNodes::Handle running = 0;
    Time released = 0;
    Time started = 0;
    bool is_outside = false;
  };

  void deliver(std::size_t from, Node &to, std::uint32_t thread) {
    if (to.running != 0) overlapped_ = true;  // would wait for the node's group
    to.fresh.insert(from);
    const auto input = std::find_if(to.inputs.begin(), to.inputs.end(), [&](const auto &i) { return i.first == from; });
    if (to.fresh.size() == to.inputs.size()) {
      to.trigger = input->second;
      to.fresh.clear();
    } else {
      nodes_.start(thread, input->second);
      nodes_.end(thread, input->second);
    }
  }

  RecordedNodes nodes_;
  std::vector<Node> tasks_;
  bool overlapped_ = false;
};

GenerateOptions random_robots() {
  GenerateOptions options;
  options.dags = 3;
  options.utilization = 0.7;
  options.period_min = 10 * kMillisecond;
  options.period_max = 200 * kMillisecond;
  options.bcet_min = 0.5;
  return options;
}

trace::Trace simulated(const Workload &workload, std::uint64_t seed, Duration duration = 20 * kSecond) {
  SessionOptions session;
  session.duration = duration;
  session.seed = seed;
  Result<Session> run = run_session(workload, *parse_variant("mte"), session);
  if (run) return std::move(run->trace);
  ADD_FAILURE() << to_string(run.error());
  return {};
}

TEST(SimulatedRecording, IsImportedAsTheWorkload) {
  std::size_t used = 0;
  std::size_t edges = 0;
  std::size_t found_edges = 0;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    SCOPED_TRACE(seed);
    const Result<Workload> generated = generate(random_robots(), seed);
    ASSERT_TRUE(generated);
    Recording recording;
    SimulatedNodes nodes(*generated, recording);
    if (!nodes.play(simulated(*generated, seed).events)) continue;
    ++used;
    const Result<ImportedWorkload> imported = import_workload(recording, 1);
    ASSERT_TRUE(imported) << to_string(imported.error());

    std::map<std::string, std::vector<TaskRef>> by_node;
    for (const TaskRef &ref : flatten(imported->workload)) by_node[ref.task->callback->node].push_back(ref);
    const auto node_of = [&](const TaskRef &ref, std::uint32_t p) {
      return imported->workload.dags[ref.dag.value].tasks[p].callback->node;
    };
    for (const TaskRef &original : flatten(*generated)) {
      const std::vector<TaskRef> &tasks = by_node["/" + SimulatedNodes::name_of(original.id)];
      // The task is the longest: others only store messages.
      const auto main = std::max_element(
          tasks.begin(), tasks.end(), [](const TaskRef &a, const TaskRef &b) { return a.task->wcet < b.task->wcet; });
      ASSERT_NE(main, tasks.end()) << to_yaml(*imported);
      EXPECT_EQ(main->task->period, original.task->period) << to_yaml(*imported);
      EXPECT_EQ(main->task->wcet, nodes.longest[original.id.value]) << to_yaml(*imported);
      EXPECT_EQ(main->task->activation, original.task->activation);
      std::set<std::string> expected;
      for (const std::uint32_t p : original.task->predecessors) {
        expected.insert("/" + SimulatedNodes::name_of(TaskId(original.id.value - original.index + p)));
      }
      // If the message of one predecessor is always the last, nothing tells that the task waits for the others, too:
      // they have tasks of their own, which store.
      std::set<std::string> waits_for;
      std::set<std::string> all;
      for (const TaskRef &ref : tasks) {
        for (const std::uint32_t p : ref.task->predecessors) {
          all.insert(node_of(ref, p));
          if (ref.id == main->id) waits_for.insert(node_of(ref, p));
        }
      }
      EXPECT_EQ(all, expected) << to_yaml(*imported);
      EXPECT_EQ(waits_for.empty(), expected.empty()) << to_yaml(*imported);
      edges += expected.size();
      found_edges += waits_for.size();
    }
    EXPECT_EQ(imported->explained, imported->executed);
    EXPECT_LE(imported->workload.platform.workers, generated->platform.workers);
  }
  EXPECT_GE(used, 50U);
  EXPECT_GT(static_cast<double>(found_edges), 0.7 * static_cast<double>(edges));
  RecordProperty("workloads", static_cast<int>(used));
  RecordProperty("edges", static_cast<int>(edges));
  RecordProperty("found", static_cast<int>(found_edges));
}

TEST(SimulatedRecording, IsReproducedByTheModelOfItsExecutor) {
  GenerateOptions options = random_robots();
  options.shape = DagShape::Chain;
  options.offsets = true;
  std::size_t tasks = 0;
  std::size_t reproduced = 0;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    const Result<Workload> generated = generate(options, seed);
    ASSERT_TRUE(generated);
    Recording recording;
    SimulatedNodes nodes(*generated, recording, false);
    ASSERT_TRUE(nodes.play(simulated(*generated, seed, 100 * kSecond).events));
    Result<ImportedWorkload> imported = import_workload(recording, 1);
    ASSERT_TRUE(imported) << to_string(imported.error());
    const Result<SelfCheck> check = check_against_recording(*imported);
    ASSERT_TRUE(check) << to_string(check.error());
    EXPECT_EQ(check->executor, "mte");
    EXPECT_EQ(check->tasks.size(), generated->task_count());
    for (const ReproducedTask &task : check->tasks) {
      EXPECT_LE(task.p50_error, 0.1) << task.name;
      ++tasks;
      if (task.is_reproduced()) ++reproduced;
    }
    // On one worker it is another robot.
    imported->workload.platform.workers = 1;
    const Result<SelfCheck> other = check_against_recording(*imported);
    ASSERT_TRUE(other) << to_string(other.error());
    EXPECT_FALSE(
        std::all_of(other->tasks.begin(), other->tasks.end(), [](const auto &t) { return t.is_reproduced(); }));
  }
}

}  // namespace
}  // namespace redag::lab
