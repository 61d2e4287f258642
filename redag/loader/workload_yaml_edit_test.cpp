// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Files changed in place: what stays, and what changes.
#include "redag/loader/workload_yaml_edit.hpp"

#include <functional>
#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>

#include <gtest/gtest.h>

namespace redag {
namespace {

constexpr std::string_view kFile = R"(# yaml-language-server: $schema=docs/workload.schema.json
name: bot   # as on its label

platform: {workers: 2, preemption: none}  # of 4
# The loops.
dags:
  # Fast.
  - name: joints      # 400 Hz
    rate: 400Hz
    max_active: 2  # measured
    tasks:
      - {name: imu, wcet: 200us}
      - {name: pid, after: imu, wcet: 0.25ms, priority: 3}   # slow on cold days
  - {name: camera, period: 33.333333ms, max_active: 1, tasks: [{name: grab, wcet: 1.50ms}]}
  - name: logs
    period: 1s
    tasks:
      # Seldom.
      - name: write
        # On the card.
        wcet: 9ms
)";

std::string edited(std::string_view text, const std::function<void(Workload &)> &change) {
  Result<LoadedWorkload> loaded = parse_workload(text, "bot.yaml");
  EXPECT_TRUE(loaded) << to_string(loaded.error());
  if (!loaded) return {};
  change(loaded->workload);
  const std::string out = edit_yaml(text, loaded->workload);
  const Result<LoadedWorkload> again = parse_workload(out, "again.yaml");
  if (!again) {
    ADD_FAILURE() << to_string(again.error()) << out;
  } else {
    EXPECT_EQ(again->workload, loaded->workload) << out;
  }
  return out;
}

/// `text` with each pair replaced, which must be there once.
std::string with(std::string text, std::initializer_list<std::pair<std::string_view, std::string_view>> replacements) {
  for (const auto &[before, after] : replacements) {
    const std::size_t at = text.find(before);
    EXPECT_NE(at, std::string::npos) << before;
    if (at != std::string::npos) text.replace(at, before.size(), after);
  }
  return text;
}

TEST(EditYaml, AnUnchangedWorkloadIsTheSameFile) {
  EXPECT_EQ(edited(kFile, [](Workload &) {}), kFile);
  const std::string with_mark = "\xEF\xBB\xBF" + std::string(kFile);
  EXPECT_EQ(edited(with_mark, [](Workload &) {}), with_mark);
}

TEST(EditYaml, ChangesValuesInPlace) {
  const std::string out = edited(kFile, [](Workload &workload) {
    workload.platform.workers = 12;
    workload.platform.preemption = PreemptionMode::Cooperative;
    workload.dags[0].max_active = 5;
    workload.dags[0].tasks[1].priority = -7;
  });
  EXPECT_EQ(out, with(std::string(kFile), {{"workers: 2, preemption: none", "workers: 12, preemption: cooperative"},
                                           {"max_active: 2", "max_active: 5"},
                                           {"priority: 3", "priority: -7"}}));
}

// A default that files state is written, too: a platform without keys would be no platform.
TEST(EditYaml, WritesASingleWorker) {
  for (const std::string platform :
       {"platform: {workers: 4}", "platform:\n  workers: 4", "platform: {workers: 4, cpus: 0-3}"}) {
    const std::string file =
        "# kept\n" + platform + "\ndags: [{name: d, tasks: [{name: t, wcet: 1ms, period: 9ms}]}]\n";
    const std::string out = edited(file, [](Workload &workload) { workload.platform.workers = 1; });
    EXPECT_EQ(out, with(file, {{"workers: 4", "workers: 1"}}));
  }
}

TEST(EditYaml, AddsKeysAfterTheName) {
  const std::string out = edited(kFile, [](Workload &workload) {
    workload.policy = PolicyKind::Fixed;
    workload.ties = Ties::Fixed;
    workload.dags[2].max_active = 1;
    workload.dags[0].tasks[0].priority = 9;
    workload.dags[2].tasks[0].priority = 1;
  });
  EXPECT_EQ(out, with(std::string(kFile), {{"label\n", "label\npolicy: fixed\nties: fixed\n"},
                                           {"{name: imu, wcet", "{name: imu, priority: 9, wcet"},
                                           {"- name: logs\n", "- name: logs\n    max_active: 1\n"},
                                           {"- name: write\n", "- name: write\n        priority: 1\n"}}));
}

TEST(EditYaml, RemovesKeysWithTheirLines) {
  const std::string out = edited(kFile, [](Workload &workload) {
    workload.dags[0].max_active = 0;
    workload.dags[1].max_active = 0;
    workload.dags[0].tasks[1].priority.reset();
  });
  EXPECT_EQ(out, with(std::string(kFile),
                      {{"    max_active: 2  # measured\n", ""}, {"max_active: 1, ", ""}, {", priority: 3}", "}"}}));
}

TEST(EditYaml, AddsAPlatformAndKeepsWindowsLineEnds) {
  constexpr std::string_view kText = "dags:\r\n- {name: \"d\", tasks: [{\"name\": t, wcet: 1ms, period: 1s}]}\r\n";
  EXPECT_EQ(edited(kText, [](Workload &workload) { workload.platform.workers = 3; }),
            "platform: {workers: 3}\r\n" + std::string(kText));
}

TEST(EditYaml, ChangesQuotedValuesAndClusters) {
  constexpr std::string_view kText =
      "policy: 'edf'\n"
      "platform: {clusters: [{name: left}, {name: right: side}]}\n"
      "dags:\n"
      "- {name: \xC3\xA9, cluster: left, tasks: [{name: t, wcet: 1ms, period: 1s}]}\n"
      "- name: e\n"
      "  cluster: left\n"
      "  tasks: [{name: t, wcet: 1ms, period: 1s}]\n";
  const std::string text = with(std::string(kText), {{"right: side", "\"right: side\""}});
  const std::string out = edited(text, [](Workload &workload) {
    workload.policy = PolicyKind::Fifo;
    workload.dags[0].cluster = "right: side";
    workload.dags[1].cluster = "right: side";
  });
  EXPECT_EQ(out, with(text, {{"'edf'", "fifo"},
                             {"\xC3\xA9, cluster: left", "\xC3\xA9, cluster: \"right: side\""},
                             {"  cluster: left", "  cluster: \"right: side\""}}));
}

TEST(EditYaml, WritesAWorkloadWithOtherChangesAnew) {
  Workload wanted = parse_workload(kFile, "bot.yaml")->workload;
  wanted.dags[0].tasks[0].wcet = kMillisecond;
  EXPECT_EQ(edit_yaml(kFile, wanted), to_yaml(wanted));
  EXPECT_EQ(edit_yaml("no workload", wanted), to_yaml(wanted));
  wanted.dags.pop_back();
  EXPECT_EQ(edit_yaml(kFile, wanted), to_yaml(wanted));
}

}  // namespace
}  // namespace redag
