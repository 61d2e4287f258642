// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What parse_workload() says about mistakes, and at which place.
#include "redag/loader/workload_yaml.hpp"

#include <initializer_list>
#include <ostream>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "redag/loader/validate.hpp"

namespace redag {
namespace {

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

class ParseWorkloadRefuses : public ::testing::TestWithParam<Mistake> {};

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
    ::testing::Values(
        Mistake{"", {"w.yaml: error: the file has no workload"}},
        Mistake{"# only a comment\n", {"the file has no workload"}},
        Mistake{"- a\n", {"w.yaml:1:1: error: a workload must be a map"}},
        Mistake{"just text",
                {"w.yaml:1:1: error: a workload must be a map of name, platform, policy, ties, dags, not"}},
        Mistake{"dags: [\n",
                {"w.yaml:2:1: error: invalid YAML: did not find expected node content while "
                 "parsing a flow node"}},
        Mistake{"name: 'x\ndags: 3\n", {"w.yaml:1:7: error: invalid YAML: a quote is not closed"}},
        Mistake{"name: \"x\\\"\ndags: 3\n", {"w.yaml:1:7: error: invalid YAML: a quote is not closed"}},
        Mistake{"name: a: b\n", {"w.yaml:1:8: error: invalid YAML: mapping values are not allowed in this context"}},
        Mistake{"dags:\n\t- name: d\n",
                {"w.yaml:2:1: error: a tab is in the indentation, where YAML takes only spaces (write '  - name: d')"}},
        Mistake{
            "dags:\n  - name: d\n  \ttasks: [x]\n",
            {"w.yaml:3:3: error: a tab is in the indentation, where YAML takes only spaces (write '    tasks: [x]')"}},
        Mistake{"na\xC3\xAFve:\xC2\xA0x\ndags: []\n",
                {"w.yaml:1:7: error: U+00A0 is here, which looks like a space or like nothing, and is part of the text "
                 "(write 'na\xC3\xAFve: x')"}},
        Mistake{"name: x\n\xC2\xA0 policy: edf\n", {"w.yaml:2:1: error: U+00A0 is here"}},
        Mistake{"name: x\nticks\xE2\x80\x8B: 5\n", {"w.yaml:2:6: error: U+200B is here"}},
        Mistake{"name: x\n--- \nname: y\n", {"w.yaml:3:1: error: the file has a second document"}},
        Mistake{"name: &a x\ndags: *a\n", {"w.yaml:1:7: error: aliases and anchors"}},
        Mistake{"dags: *a\n", {"w.yaml:1:7: error: aliases and anchors"}},
        Mistake{"dags: &a [1]\n", {"w.yaml:1:7: error: aliases and anchors"}},
        Mistake{"dags: {a: 1,\nb: 2]\n",
                {"w.yaml:2:5: error: invalid YAML: did not find expected ',' or '}' while parsing a flow mapping that "
                 "begins in line 1"}},
        Mistake{"name: x\ndags:\n\n\n  -\n", {"w.yaml:5:4: error: a DAG must be a map"}},
        Mistake{"name: ! x\n", {"w.yaml:1:7: error: tags (here '!')"}},
        Mistake{"dags: !x [1]\n", {"w.yaml:1:7: error: tags (here '!x')"}},
        Mistake{"dags: !x {a: 1}\n", {"w.yaml:1:7: error: tags (here '!x')"}},
        Mistake{"# x\n%TAG ! tag:x,1:\n---\nname: x\n", {"w.yaml:2:1: error: tags (here the directive %TAG)"}},
        Mistake{"name: x %TAG\n...\r%TAG ! tag:x,1:\n", {"w.yaml:2:5: error: tags (here the directive %TAG)"}},
        Mistake{"%TAG ! tag:x,1:\n---\n", {"w.yaml:1:1: error: tags (here the directive %TAG)"}},
        Mistake{"a: 1\nname: \xc3\xa9\xc2\x80\n",
                {"w.yaml:2:8: error: invalid YAML: control characters are not allowed"}},
        Mistake{"name: {\xc3\xa9: *a}\n", {"w.yaml:1:11: error: aliases and anchors"}},
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
    ::testing::Values(
        Mistake{"nam: x\ndags: []\n",
                {"w.yaml:1:1: error: unknown key 'nam' in a workload (did you mean 'name'?)",
                 "w.yaml:2:7: error: the workload has no DAGs"}},
        Mistake{"name: x\n", {"w.yaml:1:1: error: the workload has no DAGs"}},
        Mistake{"dags: 5\n", {"w.yaml:1:7: error: dags must be a list, not '5'"}},
        Mistake{"dags: [3]\n", {"w.yaml:1:8: error: a DAG must be a map of name, cluster, period"}},
        Mistake{"dags: [{name: d}]\n", {"w.yaml:1:8: error: DAG 'd' has no tasks"}},
        Mistake{"dags: [{name: d, tasks: []}]\n", {"w.yaml:1:25: error: DAG 'd' has no tasks"}},
        Mistake{"dags: [{tasks: [{name: t, wcet: 1ms, period: 1s}]}]\n", {"w.yaml:1:8: error: a DAG has no name"}},
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
        Mistake{
            "platform: 4\n" + tasks({"{name: t, wcet: 1ms, period: 1s}"}),
            {"w.yaml:1:11: error: platform must be a map of workers, cpus, preemption, clusters, devices, not '4'"}},
        Mistake{"dags:\n- {name: d, tasks: [{name: t, wcet: 1ms, period: 1s}]}\n"
                "- {name: d, tasks: [{name: t, wcet: 1ms, period: 1s}]}\n",
                {"w.yaml:3:10: error: the name 'd' is used by another DAG"}},
        Mistake{tasks({"{name: t, wcet: 1ms, period: 1s}", "{name: t, wcet: 1ms, period: 1s}"}),
                {"w.yaml:5:14: error: the name 't' is used by another task of DAG 'd'"}}));

std::string with(const char *keys) { return tasks({fmt::format("{{name: t, {}}}", keys).c_str()}); }

INSTANTIATE_TEST_SUITE_P(
    Values, ParseWorkloadRefuses,
    ::testing::Values(
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
        Mistake{with("wcet: 1ms, period: 1s, activation: tmier"),
                {"4:52: error: activation must be one of timer, data, event, not 'tmier' (did you mean 'timer'?)"}},
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
        Mistake{
            with("wcet: 1ms, period: 1s, priority: \"3\""),
            {"4:50: error: priority must be a whole number from -2147483648 to 2147483647, not '3' in quotes, which "
             "make it a text (write 'priority: 3')"}},
        Mistake{with("wcet: 1ms, period: 100Hz"),
                {"4:36: error: period: '100Hz' is not a duration: it is a rate (write 'rate: 100Hz', or 'period: "
                 "10ms')"}},
        Mistake{with("wcet: 1ms, rate: 10ms"),
                {"4:34: error: rate: '10ms' is not a rate: it is a duration (write 'period: 10ms')"}},
        Mistake{with("wcet: 1ms, rate: 30"),
                {"4:34: error: rate: '30' is not a rate: it has no unit (Hz, kHz) (write a number and a unit, as in "
                 "30Hz)"}},
        Mistake{with("wcet: 1ms, rate: [1Hz]"), {"4:34: error: rate must be a rate such as 30Hz, not a list"}},
        Mistake{with("wcet: 1ms, period: 1s, rate: 1Hz"),
                {"4:46: error: task 't' has both 'period' and 'rate' (remove one of them)"}},
        Mistake{"dags: [{name: d, period: 1s, rate: 1Hz, tasks: [{name: t, wcet: 1ms}]}]\n",
                {"1:36: error: DAG 'd' has both 'period' and 'rate'"}},
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
        Mistake{
            "platform: {workers: \"2\"}\n" + with("wcet: 1ms, period: 1s"),
            {"w.yaml:1:21: error: workers must be a whole number from 1 to 4096, not '2' in quotes, which make it a "
             "text (write 'workers: 2')"}},
        Mistake{"platform: {workers: \"two\"}\n" + with("wcet: 1ms, period: 1s"),
                {"w.yaml:1:21: error: workers must be a whole number from 1 to 4096, not 'two'"}},
        Mistake{"platform: {cpus: 3-1}\n" + with("wcet: 1ms, period: 1s"),
                {"w.yaml:1:18: error: cpus must be a list of processors such as 0-3 or [0, 2-5], not '3-1'"}},
        Mistake{"platform: {cpus: 0, clusters: [{name: c}]}\n" + with("wcet: 1ms, period: 1s"),
                {"w.yaml:1:18: error: platform has both 'cpus' and 'clusters' (each cluster has cpus of its own"}},
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
    ::testing::Values(
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
    ::testing::Values(
        Mistake{
            tasks({"{name: lidar, wcet: 1ms, period: 1s}", "{name: b, wcet: 1ms, activation: data, after: [lidra]}"}),
            {"w.yaml:5:54: error: there is no task 'lidra' in DAG 'd' (did you mean 'lidar'?)"}},
        Mistake{tasks({"{name: lidar, wcet: 1ms, period: 1s}", "{name: b, wcet: 1ms, after: d.lidar}"}),
                {"w.yaml:5:35: error: there is no task 'd.lidar' in DAG 'd' (write 'lidar', without the name of the "
                 "DAG)"}},
        Mistake{"dags:\n- {name: a, tasks: [{name: b.c, wcet: 1ms, period: 1s}]}\n"
                "- {name: a.b, tasks: [{name: c, wcet: 1ms, period: 1s}]}\n",
                {"w.yaml:3:30: error: task 'c' of DAG 'a.b' and task 'b.c' of DAG 'a' are both 'a.b.c' (rename one of "
                 "them"}},
        Mistake{tasks({"{name: a, wcet: 1ms, period: 1s}", "{name: b, wcet: 1ms, after: a, offset: 1ms}"}),
                {"w.yaml:5:46: error: data task 'b' has 'offset' (add 'activation: timer', or remove 'offset:'"}},
        Mistake{
            tasks({"{name: a, wcet: 1ms, period: 1s}", "{name: b, wcet: 1ms, activation: data, after: a, rate: 1Hz}"}),
            {"w.yaml:5:62: error: data task 'b' has a rate (a data task inherits its period: remove 'rate:'"}},
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
        Mistake{tasks({"{name: a, wcet: 1ms, period: 1s, activation: event, offset: 1ms}"}),
                {"w.yaml:4:52: error: task 'a' is released by events, and has an offset (remove it, or"}},
        Mistake{tasks({"{name: a, wcet: 1ms, period: 1s, offset: any}", "{name: b, wcet: 1ms, period: 1s, after: a}"}),
                {"w.yaml:5:47: error: timer task 'b' waits for jobs of 'a' that are released at the same instants"}},
        Mistake{tasks({"{name: a, wcet: 1ms, period: 1s}", "{name: b, wcet: 1ms, period: 1s, offset: any, after: a}"}),
                {"w.yaml:5:48: error: task 'b' is released at any offset, and has predecessors"}},
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

}  // namespace
}  // namespace redag
