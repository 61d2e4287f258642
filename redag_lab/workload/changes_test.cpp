// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/workload/changes.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "redag/loader/workload_yaml.hpp"

namespace redag::lab {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

Workload workload(const std::string &dags, const std::string &head = "") {
  const Result<LoadedWorkload> loaded = parse_workload("name: w\n" + head + "dags:\n" + dags, "test.yaml");
  EXPECT_TRUE(loaded) << to_string(loaded.error());
  return loaded->workload;
}

std::vector<std::string> texts(const Workload &a, const Workload &b) {
  std::vector<std::string> list;
  for (const Change &change : changes_between(a, b)) {
    list.push_back((change.kind == Change::Kind::Demand ? "demand " : "setting ") + change.text());
  }
  return list;
}

constexpr const char *kA = "  - {name: a, tasks: [{name: s, period: 10ms, wcet: 1ms}]}\n";
constexpr const char *kB = "  - {name: b, tasks: [{name: s, period: 20ms, wcet: 2ms}]}\n";

TEST(Changes, NoneWhateverTheOrderAndTheName) {
  Workload a = workload(std::string(kA) + kB);
  Workload b = workload(std::string(kB) + kA);
  b.name = "other";
  EXPECT_THAT(texts(a, b), IsEmpty());
}

TEST(Changes, SettingsAndDemandAreToldApart) {
  Workload a = workload(std::string(kA) + kB, "platform: {workers: 2}\n");
  Workload b = a;
  b.platform.workers = 3;
  b.platform.cpus = {2, 3};
  b.ties = Ties::Fixed;
  b.dags[0].max_active = 1;
  b.dags[0].tasks[0].wcet = 2 * kMillisecond;
  b.dags[1].tasks[0].priority = 4;
  EXPECT_THAT(texts(a, b), ElementsAre("setting workers: 2 -> 3", "setting cpus: any -> 2-3",
                                       "setting ties: share -> fixed", "setting max_active of a: none -> 1",
                                       "demand wcet of a.s: 1ms -> 2ms", "setting priority of b.s: none -> 4"));
}

TEST(Changes, WhatOnlyOneHas) {
  Workload a = workload(std::string(kA) + kB);
  Workload b = workload("  - {name: a, tasks: [{name: t, period: 10ms, wcet: 1ms}]}\n");
  EXPECT_THAT(texts(a, b), ElementsAre("demand task a.s: there -> missing", "demand task a.t: missing -> there",
                                       "demand DAG b: there -> missing"));
}

}  // namespace
}  // namespace redag::lab
