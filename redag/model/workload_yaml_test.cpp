// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/model/workload_yaml.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <ostream>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <unistd.h>
#include <nlohmann/json.hpp>

#include "redag/model/validate.hpp"
#include "redag_lab/workload/generate.hpp"

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

TEST(ParseWorkload, ExplainsMistakesInBudgetsAndCriticality) {
  const auto mistakes = [](std::string_view dag, std::string_view task) {
    const std::string text =
        fmt::format("dags:\n- {{name: d, {}tasks: [{{name: t, wcet: 5ms, period: 50ms{}}}]}}\n", dag, task);
    const Result<LoadedWorkload> loaded = parse_workload(text, "w.yaml");
    return loaded ? std::string() : to_string(loaded.error());
  };
  const auto says = [&](std::string_view dag, std::string_view task, std::string_view what) {
    EXPECT_NE(mistakes(dag, task).find(what), std::string::npos) << mistakes(dag, task);
  };
  EXPECT_EQ(mistakes("criticality: high, ", ", wcet_low: 5ms"), "");
  says("criticality: high, ", ", wcet_low: 6ms", "wcet_low 6ms of task 't' exceeds its wcet 5ms");
  says("criticality: high, ", ", wcet_low: 0", "wcet_low must be greater than zero");
  says("", ", wcet_low: 2ms", "DAG 'd' is not of high criticality");
  says("", ", on_budget: log", "has 'on_budget: log', but no budget");
  says("", ", budget: 5ms, on_budget: kill", "on_budget must be one of abort, log, demote, skip_next");
  says("criticality: high, degrade: {skip: 2}, ", "", "of high criticality is never degraded");
  says("degrade: {skip: 0}, ", "", "skip must be a whole number from 1");
  says("degrade: {skip: 1000001}, ", "", "skip must be a whole number from 1 to 1000000, not '1000001'");
  says("degrade: {stretch: 0.5}, ", "", "stretch of DAG 'd' must be from 1 to 1000000, not 0.5");
  says("degrade: {stretch: nan}, ", "", "stretch must be a number such as 2.5");
  says("degrade: {skip: 2, stretch: 2}, ", "", "degrade must have either 'skip' or 'stretch'");
  says("degrade: pause, ", "", "degrade must be one of stop, {skip: N}, {stretch: FACTOR}");
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

TEST(ParseWorkload, AcceptsAByteOrderMarkAndWindowsLineEnds) {
  EXPECT_EQ(read("\xEF\xBB\xBF"
                 "dags:\r\n  - name: d\r\n    tasks:\r\n      - {name: t, wcet: 1ms, period: 1s}\r\n")
                .dags.at(0)
                .name,
            "d");
}

// --- mistakes ---

/// A DAG with these tasks, each on a line of its own, from line 4 at column 7.
std::string tasks(std::initializer_list<const char *> lines) {
  std::string text = "dags:\n  - name: d\n    tasks:\n";
  for (const char *line : lines) text += fmt::format("    - {}\n", line);
  return text;
}

struct Mistake {
  std::string text;
  std::vector<std::string> expected;  // parts of the reported lines, in order; there are no other lines

  friend std::ostream &operator<<(std::ostream &out, const Mistake &mistake) {
    return out << mistake.text.substr(0, 300);
  }
};

class ParseWorkloadRefuses : public testing::TestWithParam<Mistake> {};

TEST_P(ParseWorkloadRefuses, AtThePlace) {
  const Result<LoadedWorkload> loaded = parse_workload(GetParam().text, "w.yaml");
  ASSERT_FALSE(loaded);
  const Diagnostics &found = loaded.error();
  ASSERT_EQ(found.size(), GetParam().expected.size()) << to_string(found);
  for (std::size_t i = 0; i < found.size(); ++i) {
    EXPECT_NE(found[i].to_string().find(GetParam().expected[i]), std::string::npos)
        << "expected: " << GetParam().expected[i] << "\nfound:    " << found[i].to_string();
  }
}

INSTANTIATE_TEST_SUITE_P(
    Text, ParseWorkloadRefuses,
    testing::Values(
        Mistake{"", {"w.yaml: error: the file has no workload"}},
        Mistake{"# only a comment\n", {"the file has no workload"}},
        Mistake{"- a\n", {"w.yaml:1:1: error: a workload must be a map"}},
        Mistake{"just text",
                {"w.yaml:1:1: error: a workload must be a map of name, platform, policy, ties, dags, not"}},
        Mistake{"dags: [\n", {"w.yaml:2:1: error: invalid YAML: end of sequence flow not found"}},
        Mistake{"name: 'x\ndags: 3\n", {"w.yaml:1:7: error: invalid YAML: a quote is not closed"}},
        Mistake{"name: \"x\\\"\ndags: 3\n", {"w.yaml:1:7: error: invalid YAML: a quote is not closed"}},
        Mistake{"name: a: b\n", {"w.yaml:1:8: error: invalid YAML: illegal map value"}},
        Mistake{"dags:\n\t- name: d\n", {"w.yaml:2:2: error: invalid YAML"}},
        Mistake{"name: x\n--- \nname: y\n", {"w.yaml:3:1: error: the file has a second document"}},
        Mistake{"name: &a x\ndags: *a\n", {"w.yaml:1:7: error: aliases and anchors"}},
        Mistake{"dags: *a\n", {"w.yaml:1:7: error: invalid YAML: the referenced anchor"}},
        Mistake{"name: !!str x\n", {"w.yaml:1:7: error: tags (here 'tag:yaml.org,2002:str')"}},
        Mistake{"name: \xff\n", {"w.yaml:1:7: error: byte 0xff is not valid UTF-8"}},
        Mistake{"name: \xc0\xaf\n", {"w.yaml:1:7: error: byte 0xc0 is not valid UTF-8"}},
        Mistake{"name: \xed\xa0\x80\n", {"w.yaml:1:7: error: byte 0xed is not valid UTF-8"}},
        Mistake{"name: \xe2\x82", {"w.yaml:1:7: error: byte 0xe2 is not valid UTF-8"}},
        Mistake{std::string("name: a\nb\0", 10), {"w.yaml:2:2: error: the file contains control character 0x00"}},
        Mistake{"name: a\x04: b", {"w.yaml:1:8: error: the file contains control character 0x04"}},
        Mistake{"\xff\xfe"
                "n",
                {"w.yaml:1:1: error: byte 0xff is not valid UTF-8"}},
        Mistake{"? [a]\n: b\n",
                {"w.yaml:1:1: error: the workload has no DAGs", "1:3: error: a key must be a name, not a list"}},
        Mistake{std::string(100'000, '['), {"error: the file is nested more than 32 levels deep"}},
        Mistake{std::string(100'000, '{'), {"error: the file is nested more than 32 levels deep"}}));

INSTANTIATE_TEST_SUITE_P(
    Keys, ParseWorkloadRefuses,
    testing::Values(Mistake{"nam: x\ndags: []\n",
                            {"w.yaml:1:1: error: unknown key 'nam' in a workload (did you mean 'name'?)",
                             "w.yaml:2:7: error: the workload has no DAGs"}},
                    Mistake{"name: x\n", {"w.yaml:1:1: error: the workload has no DAGs"}},
                    Mistake{"dags: 5\n", {"w.yaml:1:7: error: dags must be a list, not '5'"}},
                    Mistake{"dags: [3]\n", {"w.yaml:1:8: error: a DAG must be a map of name, period"}},
                    Mistake{"dags: [{name: d}]\n", {"w.yaml:1:8: error: DAG 'd' has no tasks"}},
                    Mistake{"dags: [{name: d, tasks: []}]\n", {"w.yaml:1:25: error: DAG 'd' has no tasks"}},
                    Mistake{"dags: [{tasks: [{name: t, wcet: 1ms, period: 1s}]}]\n",
                            {"w.yaml:1:8: error: a DAG has no name"}},
                    Mistake{tasks({"{wcet: 1ms, period: 1s}"}), {"w.yaml:4:7: error: a task has no name"}},
                    Mistake{tasks({"{name: '', wcet: 1ms, period: 1s}"}),
                            {"w.yaml:4:14: error: name must be a non-empty string, not ''"}},
                    Mistake{tasks({"{name: [x], wcet: 1ms, period: 1s}"}),
                            {"w.yaml:4:14: error: name must be a non-empty string, not a list"}},
                    Mistake{tasks({"{name: \"a\\nb\", wcet: 1ms, period: 1s}"}),
                            {"w.yaml:4:14: error: name 'a\\u{A}b' contains U+000A, which cannot be displayed"}},
                    Mistake{tasks({"5"}), {"w.yaml:4:7: error: a task must be a map of name, wcet"}},
                    Mistake{tasks({"{name: t, wect: 1ms, period: 1s}"}),
                            {"w.yaml:4:7: error: task 't' has no wcet",
                             "w.yaml:4:17: error: unknown key 'wect' in a task (did you mean 'wcet'?)"}},
                    Mistake{tasks({"{name: t, wcet: 1ms, period: 1s, colour: red}"}),
                            {"w.yaml:4:40: error: unknown key 'colour' in a task (known: name, wcet, bcet"}},
                    Mistake{tasks({"{name: t, wcet: 1ms, period: 1s, wcet: 2ms}"}),
                            {"w.yaml:4:40: error: key 'wcet' is given twice"}},
                    Mistake{"platform: {worker: 2}\n" + tasks({"{name: t, wcet: 1ms, period: 1s}"}),
                            {"w.yaml:1:12: error: unknown key 'worker' in platform (did you mean 'workers'?)"}},
                    Mistake{"platform: 4\n" + tasks({"{name: t, wcet: 1ms, period: 1s}"}),
                            {"w.yaml:1:11: error: platform must be a map of workers, preemption, not '4'"}},
                    Mistake{"dags:\n- {name: d, tasks: [{name: t, wcet: 1ms, period: 1s}]}\n"
                            "- {name: d, tasks: [{name: t, wcet: 1ms, period: 1s}]}\n",
                            {"w.yaml:3:10: error: the name 'd' is used by another DAG"}},
                    Mistake{tasks({"{name: t, wcet: 1ms, period: 1s}", "{name: t, wcet: 1ms, period: 1s}"}),
                            {"w.yaml:5:14: error: the name 't' is used by another task of DAG 'd'"}}));

std::string with(const char *keys) { return tasks({fmt::format("{{name: t, {}}}", keys).c_str()}); }

INSTANTIATE_TEST_SUITE_P(
    Values, ParseWorkloadRefuses,
    testing::Values(
        Mistake{with("wcet: 1, period: 1s"), {"w.yaml:4:23: error: wcet: '1' is not a duration: it has no unit"}},
        Mistake{with("wcet: , period: 1s"), {"error: wcet must be a duration such as 5ms, not nothing"}},
        Mistake{with("wcet: [1ms], period: 1s"),
                {"w.yaml:4:23: error: wcet must be a duration such as 5ms, not a list"}},
        Mistake{with("wcet: 0, period: 1s"),
                {"w.yaml:4:23: error: wcet of task 't' must be greater than zero, not 0s"}},
        Mistake{with("wcet: -1ms, period: 1s"), {"4:23: error: wcet of task 't' must be greater than zero, not -1ms"}},
        Mistake{with("wcet: 1ms, period: 0"), {"w.yaml:4:36: error: period must be greater than zero, not '0'"}},
        Mistake{with("wcet: 1ms, period: -5ms"), {"4:36: error: period must be greater than zero, not '-5ms'"}},
        Mistake{with("wcet: 1ms, period: 999999999999h"),
                {"4:36: error: period: '999999999999h' is not a duration: it is too large; at most 1281023h (146 "
                 "years) is allowed"}},
        Mistake{with("wcet: 0.5ns, period: 1s"), {"4:23: error: wcet: '0.5ns' is not a duration: it is not a whole"}},
        Mistake{with("wcet: 1ms"), {"w.yaml:4:7: error: timer task 't' has no period"}},
        Mistake{with("wcet: 1ms, bcet: 2ms, period: 1s"),
                {"w.yaml:4:34: error: bcet 2ms of task 't' exceeds its wcet 1ms"}},
        Mistake{with("wcet: x, bcet: 2ms, period: 1s"), {"w.yaml:4:23: error: wcet: 'x' is not a duration"}},
        Mistake{with("wcet: 1ms, period: 1s, deadline: 0"),
                {"w.yaml:4:50: error: deadline must be greater than zero, not '0'"}},
        Mistake{with("wcet: 1ms, period: 1s, offset: -1ms"),
                {"4:48: error: offset of task 't' must not be negative, not -1ms"}},
        Mistake{with("wcet: 1ms, period: 1s, jitter: 2s"),
                {"4:48: error: jitter 2s of task 't' exceeds its period 1s"}},
        Mistake{with("wcet: 1ms, period: 1s, activation: tmier"),
                {"4:52: error: activation must be one of timer, data, not 'tmier' (did you mean 'timer'?)"}},
        Mistake{with("wcet: 1ms, period: 1s, criticality: [high]"),
                {"4:53: error: criticality must be one of low, normal, high, not a list"}},
        Mistake{with("wcet: 1ms, period: 1s, overrun: drop"),
                {"4:49: error: overrun must be one of skip, queue, {queue: N}, not 'drop'"}},
        Mistake{with("wcet: 1ms, period: 1s, overrun: {queue: 0}"),
                {"4:57: error: queue must be a whole number from 1 to 65536, not '0'"}},
        Mistake{with("wcet: 1ms, period: 1s, overrun: {queue: 70000}"),
                {"4:57: error: queue must be a whole number from 1 to 65536, not '70000'"}},
        Mistake{with("wcet: 1ms, period: 1s, budget: 0"), {"4:48: error: budget must be greater than zero"}},
        Mistake{with("wcet: 1ms, period: 1s, region: 0"), {"4:48: error: region must be greater than zero"}},
        Mistake{with("wcet: 1ms, period: 1s, group: \"\\e[31m\""),
                {"4:47: error: group '\\u{1B}[31m' contains U+001B"}},
        Mistake{with("wcet: 1ms, period: 1s, concurrency: 0"), {"concurrency must be a whole number from 1 to 1024"}},
        Mistake{with("wcet: 1ms, period: 1s, overrun: {}"), {"4:49: error: overrun 'queue' needs a depth"}},
        Mistake{with("wcet: 1ms, period: 1s, priority: high"),
                {"4:50: error: priority must be a whole number from -2147483648"}},
        Mistake{with("wcet: 1ms, period: 1s, priority: \"3\""), {"4:50: error: priority must be a whole number"}},
        Mistake{with("wcet: 1ms, period: 1s, priority: 99999999999"), {"4:50: error: priority must be a whole number"}},
        Mistake{with("wcet: 1ms, period: 1s, execution: normal"),
                {"4:51: error: execution must be one of constant, uniform, {normal: {mean, stddev}}"}},
        Mistake{with("wcet: 1ms, period: 1s, execution: {}"),
                {"4:51: error: execution must have either 'normal' or 'empirical'"}},
        Mistake{with("wcet: 1ms, period: 1s, execution: {normal: {mean: 1ms}}"), {"4:60: error: normal has no stddev"}},
        Mistake{with("wcet: 1ms, period: 1s, execution: {normal: {mean: 2ms, stddev: 1us}}"),
                {"4:51: error: mean 2ms of task 't' is not between its bcet and its wcet"}},
        Mistake{with("wcet: 1ms, period: 1s, execution: {empirical: []}"),
                {"4:51: error: task 't' has no execution-time samples"}},
        Mistake{with("wcet: 1ms, period: 1s, execution: {empirical: [1ms, 2ms]}"),
                {"4:69: error: sample 2ms of task 't' is not between"}},
        Mistake{with("wcet: 1ms, period: 1s, execution: {empirical: 1ms}"),
                {"4:63: error: empirical must be a list of durations, not '1ms'"}},
        Mistake{"platform: {workers: 0}\n" + with("wcet: 1ms, period: 1s"),
                {"w.yaml:1:21: error: workers must be a whole number from 1"}},
        Mistake{"platform: {workers: 5000}\n" + with("wcet: 1ms, period: 1s"),
                {"w.yaml:1:21: error: workers must be a whole number from 1 to 4096, not '5000'"}},
        Mistake{"platform: {workers: -1}\n" + with("wcet: 1ms, period: 1s"),
                {"w.yaml:1:21: error: workers must be a whole number from 1"}},
        Mistake{"policy: rm\n" + with("wcet: 1ms, period: 1s"),
                {"w.yaml:1:9: error: policy must be one of rate_monotonic, deadline_monotonic, fixed, edf, fifo, "
                 "chain_aware, not 'rm'"}},
        Mistake{"ties: no\n" + with("wcet: 1ms, period: 1s"),
                {"w.yaml:1:7: error: ties must be one of share, fixed, not 'no'"}},
        Mistake{"policy: edf\nplatform: {preemption: os}\n" + with("wcet: 1ms, period: 1s"),
                {"w.yaml:2:24: error: preemption 'os' needs a static policy, and 'edf' is not one"}}));

// The callback begins at column 50.
std::string with_callback(const char *callback) {
  return with(fmt::format("wcet: 1ms, period: 1s, callback: {}", callback).c_str());
}

INSTANTIATE_TEST_SUITE_P(
    Callbacks, ParseWorkloadRefuses,
    testing::Values(
        Mistake{with_callback("/ekf"),
                {"w.yaml:4:50: error: callback must be a map of node, timer, subscription, service, client, action, "
                 "waitable, not '/ekf'"}},
        Mistake{with_callback("{node: /n, timer: any, service: /s}"),
                {"w.yaml:4:73: error: callback has both timer and service (use one task for each callback)"}},
        Mistake{with_callback("{timer: any}"), {"w.yaml:4:50: error: callback has no node (add 'node:', the full"}},
        Mistake{with_callback("{node: /n}"),
                {"w.yaml:4:50: error: callback does not say which callback of the node it is (add one of timer, "
                 "subscription, "
                 "service, client, action, waitable)"}},
        Mistake{with_callback("{node: /n, subscripton: /imu}"),
                {"w.yaml:4:50: error: callback does not say",
                 "w.yaml:4:61: error: unknown key 'subscripton' in callback (did you mean 'subscription'?)"}},
        Mistake{with_callback("{node: /n, timer: any, timer: 2ms}"), {"4:73: error: key 'timer' is given twice"}},
        Mistake{with_callback("{node: ekf, subscription: /imu}"),
                {"w.yaml:4:57: error: node 'ekf' of the callback of task 't' does not begin with '/' (write full names "
                 "as"}},
        Mistake{with_callback("{node: /ekf, subscription: imu/data}"),
                {"4:77: error: subscription 'imu/data' of the callback of task 't' does not begin with '/'"}},
        Mistake{with_callback("{node: /ekf/, service: ~/reset}"),
                {"4:57: error: node '/ekf/' of the callback of task 't' ends with '/'",
                 "4:73: error: service '~/reset' of the callback of task 't' contains '~', which a ROS name cannot "
                 "contain"}},
        Mistake{with_callback("{node: [/a], timer: any}"),
                {"4:57: error: node must be a non-empty string, not a list"}},
        Mistake{with_callback("{node: /n, action: }"), {"4:69: error: action must be a non-empty string, not nothing"}},
        Mistake{with_callback("{node: /n, timer: 0}"),
                {"4:68: error: timer must be greater than zero, not '0' (or 'any'"}},
        Mistake{with_callback("{node: /n, timer: 2}"), {"4:68: error: timer: '2' is not a duration: it has no unit"}},
        Mistake{with_callback("{node: /n, timer: [2ms]}"),
                {"4:68: error: timer must be a period, any, or a map of period, index, not a list"}},
        Mistake{with_callback("{node: /n, timer: {}}"),
                {"4:68: error: timer is empty (write 'any' to match any one of the node)"}},
        Mistake{with_callback("{node: /n, timer: {index: -1}}"),
                {"4:76: error: index must be a whole number from 0 to 4294967295, not '-1'"}},
        Mistake{with_callback("{node: /n, timer: {indx: 1}}"),
                {"4:69: error: unknown key 'indx' in timer (did you mean 'index'?)"}},
        Mistake{with_callback("{node: /n, waitable: 2ms}"),
                {"4:71: error: waitable must be any, or a map of index, not '2ms'"}},
        Mistake{with_callback("{node: /n, waitable: {period: 2ms}}"),
                {"4:72: error: unknown key 'period' in waitable"}},
        Mistake{tasks({"{name: a, wcet: 1ms, period: 1s}",
                       "{name: b, wcet: 1ms, activation: data, after: a, callback: {node: /n, timer: any}}"}),
                {"w.yaml:5:84: error: data task 'b' has a timer as its callback (predecessors release it"}},
        // A value that a broken timer could have given is not reported as missing.
        Mistake{with("wcet: 1ms, callback: {node: /n, timer: 2sec}"), {"4:56: error: timer: '2sec' is not a duration"}},
        Mistake{with("wcet: 1ms, callback: {node: /n, timer: any}"), {"4:7: error: timer task 't' has no period"}},
        Mistake{with("wcet: 1ms, period: 1s, concurrency: 0"),
                {"4:53: error: concurrency must be a whole number from 1"}},
        Mistake{with("wcet: 1ms, period: 1s, concurrency: 1025"),
                {"4:53: error: concurrency must be a whole number from 1 to 1024, not '1025'"}},
        Mistake{with("wcet: 1ms, period: 1s, concurrency: 2, group: g"),
                {"4:53: error: task 't' has concurrency 2, but is in group 'g' (jobs of one group never overlap"}}));

INSTANTIATE_TEST_SUITE_P(
    Graphs, ParseWorkloadRefuses,
    testing::Values(
        Mistake{
            tasks({"{name: lidar, wcet: 1ms, period: 1s}", "{name: b, wcet: 1ms, activation: data, after: [lidra]}"}),
            {"w.yaml:5:54: error: there is no task 'lidra' in DAG 'd' (did you mean 'lidar'?)"}},
        Mistake{tasks({"{name: a, wcet: 1ms, activation: data}"}),
                {"w.yaml:4:40: error: data task 'a' has no predecessor"}},
        Mistake{tasks({"{name: a, wcet: 1ms, period: 1s, after: [a]}"}),
                {"w.yaml:4:48: error: task 'a' is its own predecessor"}},
        Mistake{tasks({"{name: a, wcet: 1ms, period: 1s}", "{name: b, wcet: 1ms, activation: data, after: [a, a]}"}),
                {"w.yaml:5:57: error: task 'b' names predecessor 'a' twice"}},
        Mistake{tasks({"{name: a, wcet: 1ms, activation: data, after: b}",
                       "{name: b, wcet: 1ms, activation: data, after: c}",
                       "{name: c, wcet: 1ms, activation: data, after: a}"}),
                {"w.yaml:4:53: error: cycle in DAG 'd': a -> c -> b -> a"}},
        Mistake{
            tasks({"{name: a, wcet: 1ms, period: 1s}", "{name: b, wcet: 1ms, activation: data, after: a, period: 1s}"}),
            {"w.yaml:5:64: error: data task 'b' has a period"}},
        Mistake{tasks({"{name: a, wcet: 1ms, period: 1s}",
                       "{name: b, wcet: 1ms, activation: data, after: a, offset: 1ms, jitter: 1ms}"}),
                {"w.yaml:5:64: error: data task 'b' has 'offset'", "w.yaml:5:77: error: data task 'b' has 'jitter'"}},
        // Consequences of a mistake are not reported: no wcet > deadline, no period of b.
        Mistake{tasks({"{name: a, wcet: 1ms, period: 1sec}", "{name: b, wcet: 1ms, activation: data, after: a}",
                       "{name: c, wcet: 2ms, activation: data, after: [a, b]}"}),
                {"w.yaml:4:36: error: period: '1sec' is not a duration: unknown unit 'sec'"}},
        // All mistakes are reported at once, in the order of the file.
        Mistake{
            "policy: best\n" + tasks({"{name: a, wcet: 1, period: 1s}", "{name: a, wcet: 1ms, period: 1s, bcte: 1ms}",
                                      "{name: c, wcet: 1ms, activation: data, after: [x]}"}),
            {"1:9: error: policy", "5:23: error: wcet", "6:14: error: the name 'a' is used by another task",
             "6:40: error: unknown key 'bcte'", "7:54: error: there is no task 'x'"}}));

TEST(ParseWorkload, Warns) {
  const auto warnings = [](const std::string &text) {
    const Result<LoadedWorkload> loaded = parse_workload(text, "w.yaml");
    EXPECT_TRUE(loaded) << to_string(loaded.error());
    return loaded ? to_string(loaded->warnings) : "";
  };
  EXPECT_EQ(warnings(with("wcet: 6ms, period: 10ms, deadline: 5ms")),
            "w.yaml:4:23: warning: wcet 6ms of task 't' exceeds its deadline 5ms (a job that runs for its wcet misses "
            "its deadline)");
  EXPECT_NE(warnings(with("wcet: 12ms, period: 10ms, deadline: 20ms"))
                .find("4:23: warning: wcet 12ms of task 't' exceeds its period"),
            std::string::npos);
  EXPECT_NE(warnings("platform: {workers: 1}\n" +
                     tasks({"{name: a, wcet: 6ms, period: 10ms}", "{name: b, wcet: 6ms, period: 10ms}"}))
                .find("w.yaml:1:21: warning: utilization 1.2 exceeds the capacity of 1 worker"),
            std::string::npos);
  EXPECT_NE(warnings(with("wcet: 1ms, period: 10ms, priority: 3"))
                .find("4:52: warning: policy 'rate_monotonic' ignores the priority"),
            std::string::npos);
  EXPECT_NE(warnings("policy: fixed\n" + with("wcet: 1ms, period: 10ms"))
                .find("1:9: warning: policy is 'fixed', but no task"),
            std::string::npos);
  EXPECT_NE(warnings(with("wcet: 1ms, period: 10ms, callback: {node: /n, timer: 2ms}"))
                .find("4:36: warning: period 10ms of task 't' differs from the period of its timer, 2ms"),
            std::string::npos);
  EXPECT_NE(
      warnings(tasks({"{name: a, wcet: 1ms, period: 10ms, callback: {node: /n, service: /s}}",
                      "{name: b, wcet: 1ms, period: 10ms, callback: {node: /n, service: /s}}"}))
          .find("5:52: warning: task 'b' names the same callback as task 'a' (only the first of them in the file"),
      std::string::npos);
  EXPECT_NE(
      warnings(with("wcet: 3ms, period: 10ms, budget: 2ms")).find("4:50: warning: budget 2ms of task 't' is below"),
      std::string::npos);
}

// --- files ---

class TemporaryFile {
 public:
  explicit TemporaryFile(const char *name) : path_(std::filesystem::path(testing::TempDir()) / name) {}
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
  const auto directory = load_workload(testing::TempDir());
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

// --- properties ---

Callback arbitrary_callback(Activation activation) {
  using Kind = Callback::Kind;
  Callback callback;
  callback.node = *rc::gen::element<std::string>("/a", "*", "?", "/lidar_*", "*/x_?", "/n/o");
  callback.kind = *rc::gen::element(Kind::Subscription, Kind::Service, Kind::Client, Kind::Action, Kind::Waitable);
  if (activation == Activation::Timer && *rc::gen::arbitrary<bool>()) callback.kind = Kind::Timer;
  if (callback.kind == Kind::Timer) callback.period = *rc::gen::element<Duration>(0, 1, 2 * kMillisecond);
  if (callback.kind == Kind::Timer || callback.kind == Kind::Waitable) {
    if (*rc::gen::arbitrary<bool>()) callback.index = *rc::gen::element(0U, 7U, UINT32_MAX);
  } else {
    callback.name = *rc::gen::element<std::string>("/imu/data", "*", "/a?*");
  }
  return callback;
}

/// A generated workload with every optional part drawn, too.
Workload arbitrary_workload() {
  lab::GenerateOptions options;
  options.dags = *rc::gen::inRange(1U, 5U);
  options.min_tasks = 1;
  options.max_tasks = *rc::gen::inRange(1U, 10U);
  options.utilization = 0.5;
  options.shape = *rc::gen::element(lab::DagShape::Layered, lab::DagShape::ErdosRenyi, lab::DagShape::ForkJoin);
  options.rates = *rc::gen::element(lab::RateScope::PerDag, lab::RateScope::PerTask);
  options.periods = *rc::gen::element(lab::PeriodModel::LogUniform, lab::PeriodModel::Robot);
  options.policy = *rc::gen::element(PolicyKind::RateMonotonic, PolicyKind::Fixed, PolicyKind::Fifo);
  options.data_share = 0.6;
  options.bcet_min = *rc::gen::element(0.0, 0.5, 1.0);
  options.jitter = 0.3;
  options.offsets = *rc::gen::arbitrary<bool>();
  options.deadline_min = 0.5;
  options.max_active_max = 3;
  options.groups = 2;
  options.group_share = 0.3;
  options.queue_share = 0.3;
  options.high_share = 0.3;
  options.low_share = 0.3;
  Workload workload = generate(options, *rc::gen::arbitrary<std::uint64_t>()).value();
  workload.platform.preemption = *rc::gen::element(PreemptionMode::None, PreemptionMode::Cooperative);
  workload.ties = *rc::gen::element(Ties::Share, Ties::Fixed);
  workload.name = *rc::gen::element<std::string>("", "plain", "null", "~", "yes", "- a", "a: b", "#x", "'", "\"", "x y",
                                                 "{", "*a", "5ms", "caf\xC3\xA9", "a,b]", "\xF0\x9F\xA4\x96", "!t");
  for (Dag &dag : workload.dags) {
    dag.max_pending = *rc::gen::inRange(0U, 3U);
    dag.deadline = *rc::gen::element<Duration>(0, 7 * kMillisecond);
    if (dag.criticality != Criticality::High) {
      dag.degrade = *rc::gen::element(Degrade{}, Degrade{Degrade::Kind::Skip, 3, 2},
                                      Degrade{Degrade::Kind::Stretch, 1, 1.0 / 3 + 1});
    }
    for (Task &task : dag.tasks) {
      task.name += *rc::gen::element<std::string>("", ": x", "#", " \"", "'", ",", "]", "\\", "\xC3\xA9");
      task.criticality = dag.criticality;
      task.region = *rc::gen::element<Duration>(0, 1, 50 * kMicrosecond);
      task.budget = *rc::gen::element<Duration>(0, task.wcet);
      if (task.budget > 0) {
        task.on_budget = *rc::gen::element(OnBudget::Abort, OnBudget::Log, OnBudget::Demote, OnBudget::SkipNext);
      }
      if (dag.criticality == Criticality::High) task.wcet_low = *rc::gen::element<Duration>(0, 1, task.wcet);
      if (*rc::gen::arbitrary<bool>()) task.execution = {ExecutionTime::Kind::Normal, task.wcet, 3, {}};
      if (*rc::gen::arbitrary<bool>()) task.execution = {ExecutionTime::Kind::Empirical, 0, 0, {task.wcet, task.wcet}};
      if (*rc::gen::arbitrary<bool>()) task.execution = {ExecutionTime::Kind::Constant, 0, 0, {}};
      if (task.group.empty()) task.concurrency = *rc::gen::element(1U, 2U, kMaxConcurrency);
      if (*rc::gen::arbitrary<bool>()) task.callback = arbitrary_callback(task.activation);
      // The timer's own rate, or another one.
      if (task.callback && task.callback->period != 0 && *rc::gen::arbitrary<bool>()) {
        task.callback->period = task.period;
      }
    }
  }
  return workload;
}

RC_GTEST_PROP(ToYaml, RoundTrips, ()) {
  const Workload workload = arbitrary_workload();
  const std::string text = to_yaml(workload);
  const Result<LoadedWorkload> loaded = parse_workload(text, "round.yaml");
  if (!loaded) RC_FAIL(to_string(loaded.error()) + "\n" + text);
  RC_ASSERT(loaded->workload == workload);
}

RC_GTEST_PROP(ToYaml, RoundTripsWithoutWcets, ()) {
  Workload workload = arbitrary_workload();
  for (Dag &dag : workload.dags) {
    for (Task &task : dag.tasks) {
      if (!task.callback || *rc::gen::arbitrary<bool>()) continue;
      task.wcet = task.bcet = 0;
      task.execution = {};
    }
  }
  const Result<LoadedWorkload> loaded = parse_workload(to_yaml(workload), "round.yaml", {.wcet_optional = true});
  if (!loaded) RC_FAIL(to_string(loaded.error()) + "\n" + to_yaml(workload));
  RC_ASSERT(loaded->workload == workload);
}

RC_GTEST_PROP(ParseWorkload, NeverCrashesOnBrokenFiles, ()) {
  std::string text = to_yaml(arbitrary_workload());
  const auto edits = *rc::gen::inRange(1, 6);
  for (int i = 0; i < edits; ++i) {
    const auto at = *rc::gen::inRange<std::size_t>(0, text.size());
    switch (*rc::gen::inRange(0, 4)) {
      case 0: text.erase(at, *rc::gen::inRange<std::size_t>(1, 30)); break;
      case 1:
        text[at] = *rc::gen::element('{', '}', '[', ']', ':', ',', '-', '\n', ' ', '#', '&', '*', '"', '0', '\xff');
        break;
      case 2: text.insert(at, text.substr(*rc::gen::inRange<std::size_t>(0, text.size()), 40)); break;
      default: text.resize(at); break;
    }
    if (text.empty()) break;
  }
  const Result<LoadedWorkload> loaded = parse_workload(text, "broken.yaml");
  if (loaded) {
    RC_ASSERT(!has_errors(validate(loaded->workload)));
  } else {
    RC_ASSERT(has_errors(loaded.error()));
  }
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

TEST(ParseWorkload, CountsTwentyThousandMistakesAndSaysAThousand) {
  std::string text = "dags:\n- name: d\n  tasks:\n";
  constexpr std::size_t kCount = 10'000;
  for (std::size_t i = 0; i < kCount; ++i)
    text += fmt::format("  - {{name: t{}, wcet: 1, activation: data, after: u{}}}\n", i, i);
  const auto loaded = parse_workload(text, "bad.yaml");
  ASSERT_FALSE(loaded);
  EXPECT_EQ(loaded.error().size(), 1001U);
  EXPECT_EQ(loaded.error().back().message, "19000 more mistakes are not shown");
  EXPECT_EQ(loaded.error().back().line, 504);
  EXPECT_TRUE(has_errors({loaded.error().back()}));
}

// --- what the repository ships ---

std::vector<std::filesystem::path> shipped_workloads() {
  std::vector<std::filesystem::path> paths;
  for (const auto &entry :
       std::filesystem::recursive_directory_iterator(std::filesystem::path(REDAG_SOURCE_DIR) / "workloads")) {
    if (entry.path().extension() == ".yaml") paths.push_back(entry.path());
  }
  std::sort(paths.begin(), paths.end());
  return paths;
}

TEST(ShippedWorkloads, LoadWithoutAWarning) {
  const auto paths = shipped_workloads();
  EXPECT_GE(paths.size(), 7U);
  for (const auto &path : paths) {
    const auto loaded = load_workload(path);
    ASSERT_TRUE(loaded) << to_string(loaded.error());
    EXPECT_EQ(to_string(loaded->warnings), "");
  }
}

TEST(ShippedWorkloads, ThePaperOnesHaveTheirUtilizationAndShape) {
  for (const auto &[file, expected] : {std::pair{"harmonic_u06", 0.6}, std::pair{"harmonic_u08", 0.8},
                                       std::pair{"nonharmonic_u06", 0.6}, std::pair{"nonharmonic_u08", 0.8}}) {
    const auto path = std::filesystem::path(REDAG_SOURCE_DIR) / "workloads/paper" / (std::string(file) + ".yaml");
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

// --- the schema says the same as the reader ---

void expect_same_keys(const nlohmann::json &properties, const std::string &unknown_key_hint) {
  std::size_t known = 1 + static_cast<std::size_t>(std::count(unknown_key_hint.begin(), unknown_key_hint.end(), ','));
  EXPECT_EQ(properties.size(), known) << unknown_key_hint;
  for (const auto &[key, value] : properties.items()) {
    EXPECT_NE((" " + unknown_key_hint + ",").find(" " + key + ","), std::string::npos) << key;
  }
}

TEST(Schema, HasTheKeysOfTheReader) {
  std::ifstream file(std::string(REDAG_SOURCE_DIR) + "/docs/workload.schema.json");
  const nlohmann::json schema = nlohmann::json::parse(file);
  const auto hint_of = [](const std::string &text) {
    const auto loaded = parse_workload(text, "x");
    for (const Diagnostic &mistake : loaded.error()) {
      if (mistake.message.find("'xyzxyzxyz'") != std::string::npos) return mistake.hint;
    }
    return std::string();
  };
  expect_same_keys(schema["properties"], hint_of("xyzxyzxyz: 1"));
  expect_same_keys(schema["properties"]["platform"]["properties"], hint_of("platform: {xyzxyzxyz: 1}"));
  expect_same_keys(schema["definitions"]["dag"]["properties"], hint_of("dags: [{xyzxyzxyz: 1}]"));
  expect_same_keys(schema["definitions"]["task"]["properties"], hint_of("dags: [{tasks: [{xyzxyzxyz: 1}]}]"));
  expect_same_keys(schema["definitions"]["callback"]["properties"],
                   hint_of("dags: [{tasks: [{callback: {xyzxyzxyz: 1}}]}]"));
}

}  // namespace
}  // namespace redag
