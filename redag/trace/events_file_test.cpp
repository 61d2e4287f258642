// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/trace/events_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>

#include "redag/derived/rng.hpp"
#include "redag/loader/text_file.hpp"
#include "redag/loader/workload_yaml.hpp"
#include "redag/trace/run_info_json.hpp"
#include "redag/trace/this_machine.hpp"
#include "tests/testing/builders.hpp"

namespace redag::trace {
namespace {

using ::testing::HasSubstr;

namespace fs = std::filesystem;

Trace example() {
  Trace trace;
  trace.info.workload = testing::make_workload({testing::make_dag("control", {{"imu", 5, 1}, {"ekf", 0, 1, {0}}}, 2),
                                                testing::make_dag("map", {{"lidar", 100, 20, {}, "g"}})},
                                               2, PreemptionMode::Cooperative, PolicyKind::Edf);
  trace.info.executor = "redag";
  trace.info.config = sched::Config{2, sched::Preemption::Cooperative, PolicyKind::Edf, 3, 7};
  trace.info.preemption = "cooperative";
  trace.info.preemption_why = "no rtprio: \"ulimit -r\" is 0\n";
  trace.info.driver = Driver::Threads;
  trace.info.seed = 0xffff'ffff'ffff'fff0ULL;
  trace.info.start = 123'456'789'012'345;
  trace.info.end = trace.info.start + kSecond;
  trace.info.warm_up = 5;
  trace.info.overheads = "dispatch 3us";
  trace.info.machine = Machine{8, "Linux 6.1", "a processor"};
  trace.info.provenance = {"2026-01-31T12:00:00Z", "0.1.0", "0123abc", "robot", "Linux 6.1", "redag run 'a b'", "none"};
  Rng rng(1);
  for (int i = 0; i < 300; ++i) {
    JobEvent event;
    event.time = i;
    event.value = rng.uniform(-kMaxDuration, kMaxDuration);
    event.task = TaskId(static_cast<std::size_t>(rng.uniform(0, 2)));
    event.job = static_cast<std::uint32_t>(rng());
    event.worker = i % 3 == 0 ? WorkerId::kNoneValue : static_cast<std::uint32_t>(rng.uniform(0, 1));
    event.kind = static_cast<JobEventKind>(rng.uniform(0, 9));
    event.reason = static_cast<Reason>(rng.uniform(0, 7));
    trace.events.push_back(event);
  }
  return trace;
}

class EventsFile : public ::testing::Test {
 protected:
  void TearDown() override { fs::remove(path_); }

  std::string written(const Trace &trace) const {
    const Result<void> result = write_trace(path_, trace);
    EXPECT_TRUE(result) << (result ? "" : to_string(result.error()));
    return read_file(path_).value();
  }

  std::string path_ = (fs::path(::testing::TempDir()) / ("redag_events." + std::to_string(::getpid()))).string();
};

TEST_F(EventsFile, ReadsBackEverything) {
  const Trace before = example();
  written(before);
  const Result<Trace> after = read_trace(path_);
  ASSERT_TRUE(after) << to_string(after.error());
  EXPECT_EQ(after->events, before.events);
  EXPECT_EQ(after->info.workload, before.info.workload);
  EXPECT_EQ(run_info_to_json(after->info), run_info_to_json(before.info));
  EXPECT_EQ(after->info.seed, before.info.seed);
  EXPECT_EQ(after->info.end, before.info.end);
  EXPECT_EQ(after->info.machine, before.info.machine);
  EXPECT_EQ(after->info.provenance, before.info.provenance);
  EXPECT_EQ(after->info.preemption_why, before.info.preemption_why);
}

TEST_F(EventsFile, OfBeforeThereWasProvenanceIsRead) {
  Trace before = example();
  before.info.provenance = {};
  written(before);
  const Result<Trace> after = read_trace(path_);
  ASSERT_TRUE(after) << to_string(after.error());
  EXPECT_FALSE(after->info.provenance.is_known());
  EXPECT_FALSE(run_header_from_json(R"({"format":"f","provenance":7,"run":{}})", "f", "a file", "file"));
}

// Reads the description of example() after a change of its text.
Result<RunInfo> with(const std::string &before, const std::string &after) {
  std::string text = run_info_to_json(example().info);
  const std::size_t place = text.find(before);
  EXPECT_NE(place, std::string::npos) << before;
  return run_info_from_json(text.replace(place, before.size(), after), "f", 1);
}

TEST_F(EventsFile, PreemptionHasTheNameOfItsMode) {
  RunInfo info = example().info;
  info.config.preemption = sched::Preemption::Full;
  EXPECT_THAT(run_info_to_json(info), HasSubstr(R"("preemption":"os")"));
  const auto older = with(R"("preemption":"cooperative")", R"("preemption":"full")");
  ASSERT_TRUE(older) << to_string(older.error());
  EXPECT_EQ(older->config.preemption, sched::Preemption::Full);
}

TEST_F(EventsFile, EveryDriverIsReadBack) {
  for (const char *name : {"simulator", "threads", "ros", "ros_nodes"}) {
    const std::string driver = std::string(R"("driver":")") + name + '"';
    const Result<RunInfo> read = with(R"("driver":"threads")", driver);
    ASSERT_TRUE(read) << to_string(read.error());
    EXPECT_STREQ(to_string(read->driver), name);
    EXPECT_THAT(run_info_to_json(*read), HasSubstr(driver));
  }
}

TEST_F(EventsFile, WrongDescriptionsAreErrors) {
  for (const std::string key :
       {"executor", "config", "workers", "levels", "driver", "seed", "machine", "workload", "policy"}) {
    EXPECT_FALSE(with('"' + key, "\"X" + key.substr(1))) << key;
  }
  EXPECT_FALSE(with("\"workers\":2", "\"workers\":0"));
  const auto error = [](const char *bytes) { return to_string(parse_trace(bytes, "f").error()); };
  EXPECT_THAT(error(""), HasSubstr("the file is empty"));
  for (const char *bytes : {"\n", "{\"format\":\"redag.events/1\",\"run\":{}}\n", "redag.events/3\r\n"}) {
    EXPECT_THAT(error(bytes), HasSubstr("f: error: not a file of events")) << bytes;
  }
}

TEST_F(EventsFile, EndAndLossesAreKnownAtTheEnd) {
  const Trace trace = example();
  auto writer = EventsWriter::create(path_, trace.info);
  ASSERT_TRUE(writer);
  for (const JobEvent &event : trace.events) writer->add(std::span(&event, 1));
  EXPECT_FALSE(fs::exists(path_));
  const Time end = trace.info.start + 77;
  ASSERT_TRUE(writer->commit(end, 5));
  const Result<Trace> read = read_trace(path_);
  ASSERT_TRUE(read) << to_string(read.error());
  EXPECT_EQ(read->info.end, end);
  EXPECT_EQ(read->info.lost_events, 5U);
  EXPECT_EQ(read->events, trace.events);
}

TEST_F(EventsFile, ARunThatEndsBeforeItBeginsIsRefused) {
  const Trace trace = example();
  auto writer = EventsWriter::create(path_, trace.info);
  ASSERT_TRUE(writer);
  ASSERT_TRUE(writer->commit(trace.info.start - 1, 0));
  EXPECT_FALSE(read_trace(path_));
}

TEST_F(EventsFile, AnInvalidWorkloadIsNotWritten) {
  Trace trace = example();
  trace.info.workload.dags[0].tasks[0].wcet = -1;
  EXPECT_FALSE(write_trace(path_, trace));
  EXPECT_FALSE(fs::exists(path_));
}

TEST(TaskName, IsDagAndTask) {
  const Trace trace = example();
  EXPECT_EQ(task_name(trace.info.workload, TaskId(1)), "control.ekf");
  EXPECT_EQ(task_name(trace.info.workload, TaskId(2)), "map.lidar");
  EXPECT_EQ(task_name(trace.info.workload, TaskId(3)), "task 3");
}

TEST(ThisMachine, IsDescribed) {
  const Machine machine = this_machine();
  EXPECT_GT(machine.cpus, 0U);
  EXPECT_NE(machine.kernel, "");
}

TEST_F(EventsFile, RemarksAreKept) {
  Trace trace = example();
  trace.info.remarks = {{.begun = 5, .ended = 9, .text = "deadlock: a"}, {.begun = 7, .text = "deadlock: b"}};
  written(trace);
  EXPECT_EQ(read_trace(path_).value().info.remarks, trace.info.remarks);
}

TEST_F(EventsFile, WhatChangedInTheRunIsKept) {
  Trace trace = example();
  trace.info.removals = {{TaskId(0), 70}};
  trace.info.edges = {{.from = TaskId(0), .to = TaskId(1), .since = 5, .until = 70},
                      {.from = TaskId(1), .to = TaskId(0), .since = 80}};
  trace.info.settled = 80;
  trace.info.origin = 1234;
  written(trace);
  const RunInfo read = read_trace(path_).value().info;
  EXPECT_EQ(read.removals, trace.info.removals);
  EXPECT_EQ(read.edges, trace.info.edges);
  EXPECT_EQ(read.settled, trace.info.settled);
  EXPECT_EQ(read.origin, trace.info.origin);
  std::string bad = run_info_to_json(trace.info);
  const std::string task = "\"task\":0";
  bad.replace(bad.find(task), task.size(), "\"task\":99");
  EXPECT_THAT(to_string(run_info_from_json(bad, "x", 1).error()), HasSubstr("positions of tasks"));
}

TEST_F(EventsFile, MistakesInRemarksAreSaid) {
  RunInfo info = example().info;
  info.remarks = {{.begun = 5, .ended = 9, .text = "deadlock: a"}};
  const std::string text = run_info_to_json(info);
  const auto error_with = [&](const std::string &old, const std::string &changed) {
    std::string bad = text;
    bad.replace(bad.find(old), old.size(), changed);
    const Result<RunInfo> read = run_info_from_json(bad, "x", 1);
    return read ? "" : to_string(read.error());
  };
  EXPECT_EQ(error_with("\"begun_ns\":5", "\"begun_ns\":6"), "");
  EXPECT_THAT(error_with("\"begun_ns\":5", "\"begun_ns\":\"5\""), HasSubstr("'begun_ns' must be a whole number"));
  EXPECT_THAT(error_with("\"text\":\"deadlock: a\"", "\"text\":1"), HasSubstr("'text' must be a string"));
  EXPECT_THAT(error_with("\"remarks\":[", "\"remarks\":7,\"others\":["), HasSubstr("'remarks' must be a list"));
  EXPECT_THAT(error_with("\"remarks\":[", "\"remarks\":[7,"), HasSubstr("x:1"));
}

// Files from before equals took turns were recorded in a fixed order.
TEST_F(EventsFile, WithoutAnOrderOfTiesItWasFixed) {
  const RunInfo info = example().info;
  std::string text = run_info_to_json(info);
  EXPECT_EQ(run_info_from_json(text, "x", 1).value().config.ties, Ties::Share);
  const std::size_t key = text.find("\"ties\"");
  ASSERT_NE(key, std::string::npos);
  text.erase(key, text.find(',', key) + 1 - key);
  EXPECT_EQ(run_info_from_json(text, "x", 1).value().config.ties, Ties::Fixed);
}

// Earlier versions did not state that a task with predecessors is a timer task.
TEST_F(EventsFile, WithoutAnActivationATaskWithPredecessorsWasATimer) {
  RunInfo info = example().info;
  info.workload = parse_workload(
                      "dags: [{name: d, period: 10ms, tasks: [{name: a, wcet: 1ms}, {name: b, wcet: 1ms, after: a, "
                      "activation: timer}]}]",
                      "w.yaml")
                      .value()
                      .workload;
  std::string text = run_info_to_json(info);
  EXPECT_EQ(run_info_from_json(text, "x", 1).value().workload, info.workload);
  constexpr std::string_view kStated = "activation: timer, ";
  ASSERT_NE(text.find(kStated), std::string::npos) << text;
  text.erase(text.find(kStated), kStated.size());
  EXPECT_EQ(run_info_from_json(text, "x", 1).value().workload, info.workload);
}

}  // namespace
}  // namespace redag::trace
