// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// DagBuilder can say all that a workload file can.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <set>
#include <string>

#include "redag/loader/text_file.hpp"
#include "redag/loader/workload_yaml.hpp"
#include "redag/runtime/executor.hpp"
#include "tests/testing/one_worker.hpp"
#include "tests/testing/repository.hpp"

namespace redag::runtime {
namespace {

using namespace std::chrono_literals;

constexpr const char *kFile = R"(
platform: {workers: 2, preemption: none}
policy: fixed
dags:
  - name: control
    period: 5ms
    deadline: 9ms
    max_active: 2
    max_pending: 7
    criticality: high
    tasks:
      - {name: imu, wcet: 300us, bcet: 100us, wcet_low: 200us, offset: 1ms, jitter: 50us, priority: 9, criticality: high}
      - {name: ekf, wcet: 900us, activation: data, after: [imu], budget: 1ms, on_budget: demote, group: filter}
      - {name: pid, wcet: 400us, activation: data, after: ekf, deadline: 4ms, region: 50us, execution: constant}
      - {name: log, wcet: 1ms, rate: 20Hz, after: [pid], overrun: {queue: 3}, on_budget: log, budget: 2ms}
  - name: vision
    degrade: {skip: 2}
    tasks:
      - {name: camera, wcet: 8ms, bcet: 2ms, period: 33ms, concurrency: 2, execution: {normal: {mean: 4ms, stddev: 1ms}}}
      - {name: map, wcet: 9ms, period: 200ms, activation: event, execution: {empirical: [1ms, 9ms]}, overrun: queue, budget: 10ms,
         on_budget: skip_next}
  - name: mapping
    criticality: low
    degrade: {stretch: 2.5}
    tasks:
      - {name: t, wcet: 1ms, bcet: 1us, period: 1s, budget: 1ms, on_budget: abort}
)";

std::vector<Dag> built() {
  const auto nothing = [] {};
  DagBuilder control("control", {.max_active = 2, .max_pending = 7, .criticality = Criticality::High, .deadline = 9ms});
  const TaskHandle imu =
      control.timer("imu", 5ms, nothing,
                    {.wcet = 300us,
                     .bcet = 100us,
                     .wcet_low = 200us,
                     .offset = 1ms,
                     .jitter = 50us,
                     .priority = 9,
                     .execution = {.kind = ExecutionTime::Kind::Uniform, .mean = 0, .stddev = 0, .samples = {}}});
  const TaskHandle ekf = control.data("ekf", {imu}, nothing,
                                      {.wcet = 900us, .budget = 1ms, .on_budget = OnBudget::Demote, .group = "filter"});
  const TaskHandle pid = control.data("pid", {ekf}, nothing, {.wcet = 400us, .deadline = 4ms, .region = 50us});
  control.timer("log", 50ms, nothing,
                {.wcet = 1ms,
                 .budget = 2ms,
                 .on_budget = OnBudget::Log,
                 .overrun = Overrun::Queue,
                 .queue_depth = 3,
                 .after = {pid}});

  DagBuilder vision("vision", {.degrade = {.kind = Degrade::Kind::Skip, .skip = 2}});
  vision.timer(
      "camera", 33ms, nothing,
      {.wcet = 8ms,
       .bcet = 2ms,
       .concurrency = 2,
       .execution = {
           .kind = ExecutionTime::Kind::Normal, .mean = 4 * kMillisecond, .stddev = kMillisecond, .samples = {}}});
  vision.event("map", 200ms, nothing,
               {.wcet = 9ms,
                .budget = 10ms,
                .on_budget = OnBudget::SkipNext,
                .overrun = Overrun::Queue,
                .execution = {.kind = ExecutionTime::Kind::Empirical,
                              .mean = 0,
                              .stddev = 0,
                              .samples = {kMillisecond, 9 * kMillisecond}}});

  DagBuilder mapping("mapping",
                     {.criticality = Criticality::Low, .degrade = {.kind = Degrade::Kind::Stretch, .stretch = 2.5}});
  mapping.timer("t", 1s, nothing,
                {.wcet = 1ms,
                 .bcet = 1us,
                 .budget = 1ms,
                 .execution = {.kind = ExecutionTime::Kind::Uniform, .mean = 0, .stddev = 0, .samples = {}}});
  return {control.dag(), vision.dag(), mapping.dag()};
}

TEST(DagBuilder, BuildsWhatAFileSays) {
  const Result<LoadedWorkload> loaded = parse_workload(kFile, "keys.yaml");
  ASSERT_TRUE(loaded) << to_string(loaded.error());
  const std::vector<Dag> dags = built();
  ASSERT_EQ(dags.size(), loaded->workload.dags.size());
  for (std::size_t d = 0; d < dags.size(); ++d) {
    const Dag &expected = loaded->workload.dags[d];
    ASSERT_EQ(dags[d].tasks.size(), expected.tasks.size());
    for (std::size_t t = 0; t < expected.tasks.size(); ++t) {
      EXPECT_EQ(dags[d].tasks[t], expected.tasks[t]) << expected.name << "." << expected.tasks[t].name;
    }
    EXPECT_EQ(dags[d], expected) << expected.name;
  }
}

// A key that is new to the schema must come to the file above, and to the builder.
TEST(DagBuilder, KnowsEveryKeyOfTheSchema) {
  const auto text = read_file((testing::repository() / "docs/workload.schema.json").string());
  ASSERT_TRUE(text);
  const nlohmann::json schema = nlohmann::json::parse(*text);
  // Of ROS 2; an Executor is one cluster; its bodies do not wait without a worker.
  const std::set<std::string> elsewhere = {"callback", "cluster", "edges", "segments"};
  for (const char *part : {"dag", "task"}) {
    for (const auto &[key, value] : schema["definitions"][part]["properties"].items()) {
      if (elsewhere.count(key) > 0) continue;
      EXPECT_NE(std::string(kFile).find(key + ":"), std::string::npos) << key;
    }
  }
}

TEST(DagBuilder, AnExecutorTakesEveryOption) {
  ExecutorOptions options;
  options.workers = 2;
  options.preemption = PreemptionMode::None;
  options.policy = PolicyKind::Fixed;
  Executor executor(options);
  DagBuilder control("control", {.criticality = Criticality::High, .deadline = 9ms});
  control.timer("imu", 5ms, [] {}, {.wcet = 300us, .bcet = 100us, .wcet_low = 200us, .jitter = 50us, .region = 50us});
  const DagId id = executor.add(std::move(control));
  EXPECT_EQ(executor.dag_stats(id).deadline, 9 * kMillisecond);
}

TEST(DagBuilder, NamesTheOptionOfAMistake) {
  Executor executor(testing::one_worker());
  const auto refusal = [&](const DagOptions &dag, const TaskOptions &task) {
    DagBuilder builder("d", dag);
    builder.timer(
        "t", 10ms, [] {}, task);
    try {
      executor.add(std::move(builder));
    } catch (const std::invalid_argument &error) {
      return std::string(error.what());
    }
    return std::string();
  };
  struct Case {
    DagOptions dag;
    TaskOptions task;
    const char *says;
  };
  const std::vector<Case> cases = {
      {{.deadline = -1ms}, {}, "DagOptions::deadline"},
      {{.criticality = Criticality::High, .degrade = {.kind = Degrade::Kind::Skip, .skip = 2}},
       {},
       "DagOptions::degrade"},
      {{}, {.wcet = 1ms, .bcet = 2ms}, "TaskOptions::bcet"},
      {{}, {.wcet_low = 1ms}, "TaskOptions::wcet_low"},
      {{}, {.jitter = -1ms}, "TaskOptions::jitter"},
      {{}, {.region = -1ms}, "TaskOptions::region"},
      {{}, {.concurrency = 0}, "TaskOptions::concurrency"},
      {{}, {.concurrency = 2, .group = "g"}, "TaskOptions::concurrency"},
      {{},
       {.execution = {.kind = ExecutionTime::Kind::Normal, .mean = 5, .stddev = 1, .samples = {}}},
       "TaskOptions::execution"},
  };
  for (const Case &bad : cases) {
    const std::string text = refusal(bad.dag, bad.task);
    EXPECT_NE(text.find(bad.says), std::string::npos) << bad.says << ": " << text;
    EXPECT_EQ(text.find("criticality: high"), std::string::npos) << "a file's words: " << text;
  }
}

}  // namespace
}  // namespace redag::runtime
