// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Tasks whose jobs wait: their text form, its mistakes, and where a job waits for how long.
#include "redag/derived/waits.hpp"

#include <set>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "redag/derived/demand.hpp"
#include "redag/derived/rng.hpp"
#include "redag/loader/workload_yaml.hpp"

namespace redag {
namespace {

constexpr LoadOptions kWithWaits{.waits = true};

// The platform is on line 1, the task on line 4.
std::string file(const std::string &task, const std::string &devices = "gpu: {slots: 1}, dla: ") {
  return fmt::format("platform: {{devices: {{{}}}}}\ndags:\n- name: d\n  tasks: [{{name: t, period: 100ms, {}}}]\n",
                     devices, task);
}

Result<LoadedWorkload> parse(const std::string &text) { return parse_workload(text, "w.yaml", kWithWaits); }

void expect_mistake(const std::string &text, const std::string &expected) {
  const Result<LoadedWorkload> loaded = parse(text);
  ASSERT_FALSE(loaded) << text;
  EXPECT_EQ(loaded.error().size(), 1U) << to_string(loaded.error());
  EXPECT_NE(to_string(loaded.error()).find(expected), std::string::npos)
      << "expected: " << expected << "\nfound:    " << to_string(loaded.error());
}

TEST(Segments, AreReadAsAWcetWithWaits) {
  const auto loaded =
      parse(file("segments: [{cpu: 2ms}, {device: dla, for: 8ms, at_least: 6ms}, {cpu: 1ms}, {wait: 5ms}, {cpu: "
                 "500us}], bcet: 1ms"));
  ASSERT_TRUE(loaded) << to_string(loaded.error());
  const Workload &workload = loaded->workload;
  EXPECT_EQ(workload.platform.devices, (std::vector<Device>{{"gpu", 1, Device::Queue::Priority}, {"dla", 1}}));
  const Task &task = workload.dags[0].tasks[0];
  EXPECT_EQ(task.wcet, 3500 * kMicrosecond);
  EXPECT_EQ(task.bcet, kMillisecond);
  EXPECT_EQ(task.waits, (std::vector<Wait>{{2 * kMillisecond, 8 * kMillisecond, 6 * kMillisecond, DeviceId(1)},
                                           {3 * kMillisecond, 5 * kMillisecond, 0, DeviceId::none()}}));
  EXPECT_TRUE(has_waits(workload));
  EXPECT_EQ(longest_waits(task), 13 * kMillisecond);
}

TEST(Segments, AreRefusedWhereNobodyAsksForThem) {
  const auto loaded = parse_workload(file("segments: [{cpu: 2ms}, {wait: 8ms}, {cpu: 1ms}]"), "w.yaml");
  ASSERT_FALSE(loaded);
  EXPECT_NE(to_string(loaded.error()).find("w.yaml:4:46: error: task 't' has segments, which cannot be handled here"),
            std::string::npos)
      << to_string(loaded.error());
  EXPECT_FALSE(refuse_waits(parse(file("segments: [{cpu: 2ms}, {wait: 8ms}, {cpu: 1ms}]"))->workload, "a cook"));
  EXPECT_TRUE(refuse_waits(parse(file("wcet: 1ms"))->workload, "a cook"));
}

TEST(Segments, MistakesAreNamedAtTheirPlaces) {
  expect_mistake(file("segments: 5ms"), "w.yaml:4:46: error: segments must be a list");
  expect_mistake(file("segments: [{cpu: 2ms}]"), "w.yaml:4:46: error: segments need a cpu segment, a wait, and a cpu");
  expect_mistake(file("segments: [{cpu: 2ms}, {wait: 2ms}, {wait: 2ms}]"), "4:72: error: a wait needs a cpu segment");
  expect_mistake(file("segments: [{wait: 2ms}, {cpu: 2ms}, {wait: 2ms}]"), "4:47: error: a wait needs a cpu segment");
  expect_mistake(file("segments: [{cpu: 2ms}, {cpu: 2ms}, {wait: 2ms}]"), "4:59: error: two cpu segments follow");
  expect_mistake(file("segments: [{cpu: 2ms}, {wait: 2ms}, {cpu: 2ms}, {wait: 1ms}]"), "the last segment is a wait");
  expect_mistake(file("segments: [{cpu: 2ms}, {device: gpuu, for: 2ms}, {cpu: 2ms}]"),
                 "4:68: error: there is no device 'gpuu' (did you mean 'gpu'?)");
  expect_mistake(file("segments: [{cpu: 2ms}, {device: gpu}, {cpu: 2ms}]"), "does not say how long it takes");
  expect_mistake(file("segments: [{cpu: 2ms}, {device: gpu, wait: 2ms}, {cpu: 2ms}]"), "both device and wait");
  expect_mistake(file("segments: [{cpu: 2ms}, {wait: 2ms, for: 2ms}, {cpu: 2ms}]"),
                 "a wait without a device has 'for'");
  expect_mistake(file("segments: [{cpu: 2ms}, {for: 2ms}, {cpu: 2ms}]"), "a segment needs one of cpu, wait, device");
  expect_mistake(file("segments: [{cpu: 2ms, for: 1ms}, {wait: 2ms}, {cpu: 2ms}]"), "a cpu segment has 'for'");
  expect_mistake(file("segments: [{cpu: 2ms}, {wait: 2ms, at_least: 3ms}, {cpu: 2ms}]"),
                 "4:59: error: at_least 3ms of a wait of task 't' is not from 0 to its longest time 2ms");
  expect_mistake(file("wcet: 1ms, segments: [{cpu: 2ms}, {wait: 2ms}, {cpu: 2ms}]"), "both 'wcet' and 'segments'");
  expect_mistake(file("wcet: 1ms", "gpu: {slots: 0}"), "1:35: error: slots must be a whole number from 1 to 4096");
  expect_mistake(file("wcet: 1ms", "gpu: {queue: lifo}"), "queue");
  expect_mistake(file("wcet: 1ms", "gpu: , gpu: "), "1:29: error: the name 'gpu' is used by another device");
  expect_mistake(
      "platform: {clusters: [{name: c}], devices: {gpu: {queue: priority}}}\n"
      "dags: [{name: d, tasks: [{name: t, period: 1s, wcet: 1ms}]}]\n",
      "device 'gpu' needs 'queue: fifo': no order of jobs spans two clusters");
}

TEST(Segments, LongerThanTheDeadlineAreAWarning) {
  const auto loaded = parse(file("deadline: 5ms, segments: [{cpu: 2ms}, {wait: 2ms}, {cpu: 2ms}]"));
  ASSERT_TRUE(loaded);
  EXPECT_NE(to_string(loaded->warnings).find("the segments of task 't' take 6ms, more than its deadline 5ms"),
            std::string::npos);
}

Workload random_waits(Rng &rng) {
  Workload workload = parse(file("wcet: 1ms", "'- a: b': {slots: 3, queue: fifo}, 5ms: "))->workload;
  Task &task = workload.dags[0].tasks[0];
  const auto count = static_cast<std::size_t>(rng.uniform(1, 6));
  Duration after = 0;
  for (std::size_t w = 0; w < count; ++w) {
    after += rng.uniform(1, 10);
    Wait wait{after, rng.uniform(1, kMillisecond), 0, {}};
    if (rng.uniform(0, 1) == 0) wait.shortest = rng.uniform(1, wait.longest);
    if (rng.uniform(0, 1) == 0) wait.device = DeviceId(static_cast<std::size_t>(rng.uniform(0, 1)));
    task.waits.push_back(wait);
  }
  task.wcet = after + rng.uniform(1, 10);
  return workload;
}

TEST(Segments, RoundTrip) {
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    Rng rng(seed);
    const Workload workload = random_waits(rng);
    const std::string text = to_yaml(workload);
    const Result<LoadedWorkload> loaded = parse(text);
    ASSERT_TRUE(loaded) << to_string(loaded.error()) << text;
    EXPECT_EQ(loaded->workload, workload) << text;
  }
}

// Every stretch of every job takes some time, and a job that takes its wcet waits where the file says.
TEST(Waits, KeepTheirOrderInJobsOfAnyLength) {
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    Rng rng(seed);
    const Task task = random_waits(rng).dags[0].tasks[0];
    for (const Duration demand : {shortest_demand(task), shortest_demand(task) + 3, task.wcet, 3 * task.wcet}) {
      Duration last = 0;
      for (std::size_t w = 0; w < task.waits.size(); ++w) {
        const Duration point = wait_point(task, w, demand);
        EXPECT_GT(point, last) << seed;
        if (demand == task.wcet) {
          EXPECT_EQ(point, task.waits[w].after);
        }
        last = point;
      }
      EXPECT_LT(last, demand) << seed;
    }
  }
}

TEST(Waits, AreDrawnBetweenTheirBoundsForEachJob) {
  Task task;
  task.wcet = 10;
  task.waits = {{3, 1000, 200, {}}, {5, 7, 0, {}}};
  std::vector<Duration> seen;
  for (std::uint32_t number = 0; number < 100; ++number) {
    seen.push_back(wait_time(task, TaskId(3), number, 0, 42));
    EXPECT_GE(seen.back(), 200);
    EXPECT_LE(seen.back(), 1000);
    EXPECT_EQ(wait_time(task, TaskId(3), number, 0, 42), seen.back());
    EXPECT_EQ(wait_time(task, TaskId(3), number, 1, 42), 7);
  }
  EXPECT_GT(std::set<Duration>(seen.begin(), seen.end()).size(), 50U);
  EXPECT_TRUE(demand_varies(task));
}

}  // namespace
}  // namespace redag
