// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/run/concurrency.hpp"

#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

namespace redag::lab {
namespace {

Task task(std::uint32_t concurrency, std::string group = "") {
  Task one;
  one.concurrency = concurrency;
  one.group = std::move(group);
  return one;
}

Workload of(std::vector<std::pair<std::uint32_t, std::vector<Task>>> dags) {
  Workload workload;
  for (auto &[max_active, tasks] : dags) {
    Dag &dag = workload.dags.emplace_back();
    dag.max_active = max_active;
    dag.tasks = std::move(tasks);
  }
  return workload;
}

TEST(MostStarted, CountsTheConcurrencyOfEachTask) {
  EXPECT_EQ(most_started(Workload{}), 0U);
  EXPECT_EQ(most_started(of({{0, {task(1)}}, {0, {task(2)}}})), 3U);
}

TEST(MostStarted, IsBoundedByMaxActive) {
  EXPECT_EQ(most_started(of({{2, {task(1), task(1), task(4)}}, {3, {task(1)}}})), 3U);
}

TEST(MostStarted, CountsAGroupOnce) {
  EXPECT_EQ(most_started(of({{0, {task(1, "g"), task(3, "g"), task(1)}}})), 2U);
  EXPECT_EQ(most_started(of({{0, {task(1, "g")}}, {0, {task(1, "g"), task(1, "h")}}})), 2U);
  EXPECT_EQ(most_started(of({{1, {task(1, "g"), task(1)}}, {0, {task(1, "h"), task(2)}}})), 4U);
}

}  // namespace
}  // namespace redag::lab
