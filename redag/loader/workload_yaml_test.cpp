// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/loader/workload_yaml.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "redag/derived/clusters.hpp"
#include "redag/loader/validate.hpp"
#include "redag_lab/workload/generate.hpp"
#include "tests/testing/repository.hpp"

namespace redag {
namespace {

Workload read(std::string_view text) {
  Result<LoadedWorkload> loaded = parse_workload(text, "test.yaml");
  EXPECT_TRUE(loaded) << to_string(loaded.error());
  if (!loaded) return {};
  EXPECT_EQ(to_string(loaded->warnings), "");
  return loaded->workload;
}

TEST(ParseWorkload, GivesDefaults) {
  const Workload workload = read("dags: [{name: d, tasks: [{name: t, wcet: 1ms, period: 10ms}]}]");
  EXPECT_EQ(workload.platform, (Platform{1, PreemptionMode::Auto}));
  EXPECT_EQ(workload.policy, PolicyKind::RateMonotonic);
  EXPECT_EQ(workload.ties, Ties::Share);
  Task expected;
  expected.name = "t";
  expected.wcet = kMillisecond;
  expected.period = 10 * kMillisecond;
  expected.deadline = 10 * kMillisecond;
  EXPECT_EQ(workload.dags.at(0).tasks.at(0), expected);
}

TEST(ParseWorkload, ReadsBudgetsAndCriticality) {
  const Workload workload = read(R"(
dags:
  - name: hi
    criticality: high
    tasks:
      - {name: a, wcet: 5ms, wcet_low: 2ms, period: 50ms, budget: 6ms, on_budget: demote}
      - {name: b, wcet: 1ms, period: 50ms, budget: 2ms, on_budget: skip_next}
  - {name: stopped, degrade: stop, tasks: [{name: t, wcet: 1ms, period: 50ms}]}
  - {name: skipping, degrade: {skip: 3}, tasks: [{name: t, wcet: 1ms, period: 50ms}]}
  - {name: stretched, degrade: {stretch: 2.5}, tasks: [{name: t, wcet: 1ms, period: 50ms}]}
)");
  EXPECT_EQ(workload.dags.at(0).tasks.at(0).wcet_low, 2 * kMillisecond);
  EXPECT_EQ(workload.dags.at(0).tasks.at(0).on_budget, OnBudget::Demote);
  EXPECT_EQ(workload.dags.at(0).tasks.at(1).on_budget, OnBudget::SkipNext);
  EXPECT_EQ(workload.dags.at(1).degrade, Degrade{});
  EXPECT_EQ(workload.dags.at(2).degrade, (Degrade{Degrade::Kind::Skip, 3, 2}));
  EXPECT_EQ(workload.dags.at(3).degrade, (Degrade{Degrade::Kind::Stretch, 1, 2.5}));
}

TEST(ParseWorkload, WarnsOfACriticalityWithoutEffect) {
  const auto loaded =
      parse_workload("dags:\n- {name: d, tasks: [{name: t, wcet: 5ms, period: 50ms, criticality: high}]}\n", "w.yaml");
  ASSERT_TRUE(loaded.has_value());
  EXPECT_NE(to_string(loaded->warnings).find("w.yaml:2:69: warning: criticality high of task 't' has no effect"),
            std::string::npos)
      << to_string(loaded->warnings);
}

TEST(LoadWorkload, ANamelessOneHasTheNameOfItsFile) {
  const auto path = std::filesystem::temp_directory_path() / fmt::format("robot arm {}.yaml", ::getpid());
  std::ofstream(path) << "dags: [{name: d, tasks: [{name: t, wcet: 5ms, period: 50ms}]}]\n";
  const auto loaded = load_workload(path);
  std::filesystem::remove(path);
  ASSERT_TRUE(loaded.has_value());
  EXPECT_EQ(loaded->workload.name, path.stem().string());
}

TEST(ParseWorkload, ReadsEveryKey) {
  const Workload workload = read(R"(
name: all
platform: {workers: 3, preemption: cooperative}
policy: fixed
ties: fixed
dags:
  - name: d
    period: 10ms
    deadline: 30ms
    max_active: 2
    max_pending: 5
    edges: seen
    criticality: high
    tasks:
      - name: late
        activation: data
        after: [first, second]
        wcet: 2ms
        bcet: 1ms
        execution: {normal: {mean: 1.5ms, stddev: 100us}}
        deadline: 8ms
        criticality: high
      - {name: first, wcet: 1ms, offset: 2ms, jitter: 1ms, region: 100us, budget: 3ms, group: g, priority: -4}
      - {name: second, wcet: 1ms, period: 20ms, after: first, overrun: {queue: 3}, execution: {empirical: [1ms, 500us]}}
)");
  const Dag &dag = workload.dags.at(0);
  EXPECT_EQ(workload.name, "all");
  EXPECT_EQ(workload.platform, (Platform{3, PreemptionMode::Cooperative}));
  EXPECT_EQ(workload.policy, PolicyKind::Fixed);
  EXPECT_EQ(workload.ties, Ties::Fixed);
  EXPECT_EQ(dag.deadline, 30 * kMillisecond);
  EXPECT_EQ(dag.max_active, 2U);
  EXPECT_EQ(dag.max_pending, 5U);
  EXPECT_EQ(dag.edges, Edges::Seen);

  const Task &late = dag.tasks.at(0);
  EXPECT_EQ(late.predecessors, (std::vector<std::uint32_t>{1, 2}));
  EXPECT_EQ(late.period, 20 * kMillisecond);
  EXPECT_EQ(late.deadline, 8 * kMillisecond);
  EXPECT_EQ(late.criticality, Criticality::High);
  EXPECT_EQ(late.execution, (ExecutionTime{ExecutionTime::Kind::Normal, 1'500'000, 100'000, {}}));

  const Task &first = dag.tasks.at(1);
  EXPECT_EQ(first.offset, 2 * kMillisecond);
  EXPECT_EQ(first.jitter, kMillisecond);
  EXPECT_EQ(first.region, 100 * kMicrosecond);
  EXPECT_EQ(first.budget, 3 * kMillisecond);
  EXPECT_EQ(first.group, "g");
  EXPECT_EQ(first.priority, -4);
  EXPECT_EQ(first.period, 10 * kMillisecond);
  EXPECT_EQ(first.criticality, Criticality::High);

  const Task &second = dag.tasks.at(2);
  EXPECT_EQ(second.activation, Activation::Timer);
  EXPECT_EQ(second.overrun, Overrun::Queue);
  EXPECT_EQ(second.queue_depth, 3U);
  EXPECT_EQ(second.execution.samples, (std::vector<Duration>{kMillisecond, 500 * kMicrosecond}));
}

// A list joins its groups for all tasks, also those that name one of them alone.
TEST(ParseWorkload, ListsOfGroupsAreJoined) {
  const Workload workload = read(R"(
dags:
  - name: d
    period: 1s
    tasks:
      - {name: a, wcet: 1ms, group: [r1, r2]}
      - {name: b, wcet: 1ms, group: r3}
      - {name: c, wcet: 1ms, group: [r3, r2, r3]}
      - {name: d, wcet: 1ms, group: r1}
      - {name: e, wcet: 1ms, group: [other]}
)");
  const std::vector<Task> &tasks = workload.dags.at(0).tasks;
  for (const std::size_t t : {1U, 2U, 3U}) EXPECT_EQ(tasks.at(t).group, tasks.at(0).group);
  EXPECT_EQ(tasks.at(4).group, "other");
}

TEST(ParseWorkload, ReadsRates) {
  const Workload workload = read(R"(
dags:
  - {name: camera, rate: 30Hz, tasks: [{name: a, wcet: 1us}, {name: b, wcet: 1us, rate: 1.5kHz}]}
)");
  EXPECT_EQ(workload.dags.at(0).tasks.at(0).period, 33'333'333);
  EXPECT_EQ(workload.dags.at(0).tasks.at(1).period, 666'667);
}

TEST(ParseWorkload, ATaskWithPredecessorsAndWithoutAPeriodOfItsOwnIsADataTask) {
  constexpr std::string_view kTasks = R"(
dags:
  - name: d
    period: 10ms
    tasks:
      - {name: x, wcet: 1ms}
      - {name: plain, wcet: 1ms, after: x}
      - {name: chosen, wcet: 1ms, after: [x], activation: timer}
      - {name: slow, wcet: 1ms, after: x, period: 20ms}
      - {name: rated, wcet: 1ms, after: x, rate: 50Hz}
      - {name: ros, wcet: 1ms, after: x, callback: {node: /n, timer: any}}
      - {name: subscribed, wcet: 1ms, after: x, callback: {node: /n, subscription: /t}}
      - {name: alone, wcet: 1ms, after: []}
)";
  const auto activations = [&](LoadOptions options) {
    const Result<LoadedWorkload> loaded = parse_workload(kTasks, "w.yaml", options);
    std::string text;
    if (!loaded) return to_string(loaded.error());
    for (const Task &task : loaded->workload.dags[0].tasks) {
      if (task.activation == Activation::Data) text += task.name + " ";
    }
    return text;
  };
  EXPECT_EQ(activations({}), "plain subscribed ");
  EXPECT_EQ(activations({.timers_by_default = true}), "") << "what earlier versions wrote keeps its meaning";
}

TEST(ParseWorkload, ReadsTheProcessorsOfThePlatform) {
  const auto platform = [](std::string_view keys) {
    return read(fmt::format("platform: {{{}}}\ndags: [{{name: d, tasks: [{{name: t, wcet: 1ms, period: 1s}}]}}]", keys))
        .platform;
  };
  EXPECT_EQ(platform("cpus: [2, 3]").cpus, (std::vector<int>{2, 3}));
  EXPECT_EQ(platform("cpus: [2, 3]").workers, 2U);
  EXPECT_EQ(platform("cpus: 4-7, workers: 3").workers, 3U);
  EXPECT_EQ(
      parts_of(read("platform: {cpus: 5}\ndags: [{name: d, tasks: [{name: t, wcet: 1ms, period: 1s}]}]")).at(0).cpus,
      std::vector<int>{5});
  const auto loaded = parse_workload(
      "platform: {workers: 3, cpus: 0-1}\ndags: [{name: d, tasks: [{name: t, wcet: 1ms, period: 1s}]}]\n", "w.yaml");
  ASSERT_TRUE(loaded);
  EXPECT_TRUE(loaded->states_workers);
  EXPECT_EQ(to_string(loaded->warnings),
            "w.yaml:1:30: warning: the platform has 3 workers, but 2 processors (list more processors, or write "
            "'workers: 2': bounds and simulations assume a processor for each worker)");
}

TEST(ParseWorkload, ReadsWhatSourcesCountFrom) {
  const Workload workload = read(R"(
dags:
  - name: d
    period: 10ms
    tasks:
      - {name: scan, wcet: 1ms, activation: event}
      - {name: imu, wcet: 1ms, offset: any, jitter: 1ms}
      - {name: clock, wcet: 1ms}
)");
  const std::vector<Task> &tasks = workload.dags.at(0).tasks;
  EXPECT_EQ(tasks[0].phase, Phase::Event);
  EXPECT_EQ(tasks[0].activation, Activation::Timer);
  EXPECT_EQ(tasks[0].period, 10 * kMillisecond);
  EXPECT_EQ(tasks[1].phase, Phase::Unknown);
  EXPECT_EQ(tasks[2].phase, Phase::Common);
  EXPECT_EQ(parse_workload(to_yaml(workload), "again").value().workload, workload);
}

TEST(ParseWorkload, BcetMeansUniformUnlessSaidOtherwise) {
  const Workload workload = read(R"(dags: [{name: d, period: 10ms, tasks: [
    {name: a, wcet: 2ms, bcet: 1ms}, {name: b, wcet: 2ms, bcet: 1ms, execution: constant},
    {name: c, wcet: 2ms, execution: uniform}, {name: d, wcet: 2ms, overrun: queue}, {name: e, wcet: 2ms, overrun: skip}]}])");
  const auto &tasks = workload.dags.at(0).tasks;
  EXPECT_EQ(tasks.at(0).execution.kind, ExecutionTime::Kind::Uniform);
  EXPECT_EQ(tasks.at(1).execution.kind, ExecutionTime::Kind::Constant);
  EXPECT_EQ(tasks.at(2).execution.kind, ExecutionTime::Kind::Uniform);
  EXPECT_EQ(tasks.at(3).overrun, Overrun::Queue);
  EXPECT_EQ(tasks.at(3).queue_depth, 1U);
  EXPECT_EQ(tasks.at(4).overrun, Overrun::Skip);
}

TEST(ParseWorkload, ReadsEveryFormOfACallback) {
  using Kind = Callback::Kind;
  const Workload workload = read(R"({platform: {workers: 2}, dags: [{name: d, period: 10ms, tasks: [
    {name: a, wcet: 1ms, callback: {node: /imu_driver, timer: 2ms}, concurrency: 3},
    {name: b, wcet: 1ms, callback: {node: /imu_driver, timer: {index: 0}}},
    {name: c, wcet: 1ms, callback: {node: "*", timer: any}},
    {name: d, wcet: 1ms, callback: {timer: {period: 5ms, index: 2}, node: /n}},
    {name: e, wcet: 1ms, callback: {node: /ekf, subscription: /imu/data}, activation: data, after: a},
    {name: f, wcet: 1ms, callback: {node: "/map_?", service: /map_*/reset}, period: 1s},
    {name: g, wcet: 1ms, callback: {node: /n, client: /plan}},
    {name: h, wcet: 1ms, callback: {node: /n, action: /go}},
    {name: i, wcet: 1ms, callback: {node: /n, waitable: {index: 1}}},
    {name: j, wcet: 1ms, callback: {node: /n, waitable: any}}]}]})");
  const auto &tasks = workload.dags.at(0).tasks;
  const auto none = std::nullopt;
  EXPECT_EQ(tasks.at(0).callback, (Callback{"/imu_driver", Kind::Timer, "", 2 * kMillisecond, none}));
  EXPECT_EQ(tasks.at(0).period, 2 * kMillisecond);  // the timer's, not the DAG's
  EXPECT_EQ(tasks.at(0).deadline, 2 * kMillisecond);
  EXPECT_EQ(tasks.at(0).concurrency, 3U);
  EXPECT_EQ(tasks.at(1).callback, (Callback{"/imu_driver", Kind::Timer, "", 0, 0}));
  EXPECT_EQ(tasks.at(1).period, 10 * kMillisecond);
  EXPECT_EQ(tasks.at(1).concurrency, 1U);
  EXPECT_EQ(tasks.at(2).callback, (Callback{"*", Kind::Timer, "", 0, none}));
  EXPECT_EQ(tasks.at(3).callback, (Callback{"/n", Kind::Timer, "", 5 * kMillisecond, 2}));
  EXPECT_EQ(tasks.at(3).period, 5 * kMillisecond);
  EXPECT_EQ(tasks.at(4).callback, (Callback{"/ekf", Kind::Subscription, "/imu/data", 0, none}));
  EXPECT_EQ(tasks.at(4).period, 2 * kMillisecond);
  EXPECT_EQ(tasks.at(5).callback, (Callback{"/map_?", Kind::Service, "/map_*/reset", 0, none}));
  EXPECT_EQ(tasks.at(5).period, kSecond);
  EXPECT_EQ(tasks.at(6).callback, (Callback{"/n", Kind::Client, "/plan", 0, none}));
  EXPECT_EQ(tasks.at(7).callback, (Callback{"/n", Kind::Action, "/go", 0, none}));
  EXPECT_EQ(tasks.at(8).callback, (Callback{"/n", Kind::Waitable, "", 0, 1}));
  EXPECT_EQ(tasks.at(9).callback, (Callback{"/n", Kind::Waitable, "", 0, none}));
}

TEST(ParseWorkload, MayLeaveTheWcetOfACallbackOpen) {
  const std::string text = "dags: [{name: d, tasks: [{name: t, callback: {node: /n, timer: 2ms}}]}]";
  const Result<LoadedWorkload> strict = parse_workload(text, "w.yaml");
  ASSERT_FALSE(strict);
  EXPECT_EQ(to_string(strict.error()),
            "w.yaml:1:26: error: task 't' has no wcet (run the node with learning and save the measured value, or add "
            "'wcet:', the worst-case execution time)");
  const LoadOptions open{.wcet_optional = true};
  const Result<LoadedWorkload> loaded = parse_workload(text, "w.yaml", open);
  ASSERT_TRUE(loaded) << to_string(loaded.error());
  EXPECT_EQ(to_string(loaded->warnings), "");
  EXPECT_EQ(loaded->workload.dags.at(0).tasks.at(0).wcet, 0);
  EXPECT_EQ(parse_workload(to_yaml(loaded->workload), "again", open).value().workload, loaded->workload);

  const auto mistakes = [&](const std::string &task) {
    const auto result = parse_workload("dags: [{name: d, tasks: [" + task + "]}]", "w.yaml", open);
    return result ? std::string() : to_string(result.error());
  };
  EXPECT_EQ(mistakes("{name: t, period: 1s}"),
            "w.yaml:1:26: error: task 't' has no wcet (add 'wcet:', the worst-case execution time)");
  EXPECT_EQ(mistakes("{name: t, wcet: 0, callback: {node: /n, timer: 2ms}}"),
            "w.yaml:1:42: error: wcet must be greater than zero, not '0'");
}

TEST(ParseWorkload, KnowsWhetherTheFileStatesTheWorkers) {
  const auto states = [](const std::string &platform) {
    const std::string dag = "dags: [{name: d, period: 1s, tasks: [{name: t, wcet: 1ms}]}]\n";
    return parse_workload(platform + dag, "w.yaml").value().states_workers;
  };
  EXPECT_TRUE(states("platform: {workers: 1}\n"));
  EXPECT_FALSE(states("platform: {preemption: none}\n"));
  EXPECT_FALSE(states(""));
}

TEST(ParseWorkload, AcceptsAByteOrderMarkAndWindowsLineEnds) {
  EXPECT_EQ(read("\xEF\xBB\xBF"
                 "dags:\r\n  - name: d\r\n    tasks:\r\n      - {name: t, wcet: 1ms, period: 1s}\r\n")
                .dags.at(0)
                .name,
            "d");
}

// --- files ---

class TemporaryFile {
 public:
  explicit TemporaryFile(const char *name) : path_(std::filesystem::path(::testing::TempDir()) / name) {}
  ~TemporaryFile() { std::filesystem::remove(path_); }
  TemporaryFile(const TemporaryFile &) = delete;
  TemporaryFile &operator=(const TemporaryFile &) = delete;
  [[nodiscard]] const std::filesystem::path &path() const { return path_; }

 private:
  std::filesystem::path path_;
};

TEST(LoadWorkload, SaysWhyAFileCannotBeRead) {
  const auto missing = load_workload("/nonexistent/w.yaml");
  ASSERT_FALSE(missing);
  EXPECT_EQ(to_string(missing.error()), "/nonexistent/w.yaml: error: cannot open: No such file or directory");
  const auto directory = load_workload(::testing::TempDir());
  ASSERT_FALSE(directory);
  EXPECT_NE(to_string(directory.error()).find("is a directory"), std::string::npos);
}

TEST(LoadWorkload, RefusesHugeFilesBeforeParsingThem) {
  const TemporaryFile file("redag_huge.yaml");
  { std::ofstream(file.path()) << "name: x\n"; }
  std::filesystem::resize_file(file.path(), kMaxWorkloadBytes + 1);  // sparse
  const auto loaded = load_workload(file.path());
  ASSERT_FALSE(loaded);
  EXPECT_NE(to_string(loaded.error()).find("larger than 16 MiB"), std::string::npos);
}

TEST(SaveWorkload, RoundTripsThroughAFile) {
  const Workload workload = generate(lab::GenerateOptions{}, 1).value();
  const TemporaryFile file("redag_saved.yaml");
  ASSERT_TRUE(save_workload(workload, file.path()));
  EXPECT_EQ(load_workload(file.path()).value().workload, workload);
  const auto failed = save_workload(workload, "/nonexistent/w.yaml");
  ASSERT_FALSE(failed);
  EXPECT_NE(to_string(failed.error()).find("cannot write: No such file"), std::string::npos);
  EXPECT_FALSE(save_workload(Workload{}, file.path()));
}

// --- size ---

TEST(ParseWorkload, ReadsAHundredThousandTasksInOneDag) {
  std::string text = "dags:\n- name: d\n  tasks:\n  - {name: t0, wcet: 1us, period: 1s}\n";
  constexpr std::uint32_t kCount = 100'000;
  for (std::uint32_t i = 1; i < kCount; ++i) {
    text += fmt::format("  - {{name: t{}, wcet: 1us, activation: data, after: [t{}, t{}]}}\n", i, i - 1,
                        i / 2 == i - 1 ? i - 1 : i / 2);
    if (i / 2 == i - 1) text.replace(text.rfind(", t"), std::string::npos, "]}\n");
  }
  const Workload workload = read(text);
  EXPECT_EQ(workload.task_count(), kCount);
  EXPECT_EQ(workload.dags.at(0).tasks.back().period, kSecond);
}

// --- what the repository ships ---

std::vector<std::filesystem::path> shipped_workloads() {
  std::vector<std::filesystem::path> paths;
  for (const auto &entry : std::filesystem::recursive_directory_iterator(testing::repository() / "workloads")) {
    if (entry.path().extension() == ".yaml") paths.push_back(entry.path());
  }
  std::sort(paths.begin(), paths.end());
  return paths;
}

TEST(ShippedWorkloads, LoadWithoutAWarning) {
  const auto paths = shipped_workloads();
  EXPECT_GE(paths.size(), 7U);
  for (const auto &path : paths) {
    const auto loaded = load_workload(path, {.waits = true});
    ASSERT_TRUE(loaded) << to_string(loaded.error());
    EXPECT_EQ(to_string(loaded->warnings), "");
  }
}

TEST(ShippedWorkloads, ThePaperOnesHaveTheirUtilizationAndShape) {
  for (const auto &[file, expected] : {std::pair{"harmonic_u06", 0.6}, std::pair{"harmonic_u08", 0.8},
                                       std::pair{"nonharmonic_u06", 0.6}, std::pair{"nonharmonic_u08", 0.8}}) {
    const auto path = testing::repository() / "workloads/paper" / (std::string(file) + ".yaml");
    const Workload workload = load_workload(path).value().workload;
    ASSERT_EQ(workload.dags.size(), 2U);
    EXPECT_EQ(workload.dags[0].tasks.size(), 6U);
    EXPECT_EQ(workload.dags[1].tasks.size(), 8U);
    double mean = 0;
    for (const TaskRef &ref : flatten(workload)) {
      const Task &task = *ref.task;
      mean += static_cast<double>(task.bcet + task.wcet) / 2 / static_cast<double>(task.period);
    }
    EXPECT_NEAR(mean, expected, 0.0005) << file;
  }
}

}  // namespace
}  // namespace redag
