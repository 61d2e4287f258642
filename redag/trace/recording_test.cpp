// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/trace/recording.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <vector>

#include "tests/testing/builders.hpp"

namespace redag::trace {
namespace {

// More events than a block has.
Trace long_run() {
  Trace trace;
  trace.info.workload = testing::make_workload({testing::make_dag("d", {{"a", 5, 1}})}, 1);
  trace.info.executor = "redag";
  trace.info.preemption = "none";
  for (std::uint32_t i = 0; i < 150'000; ++i) {
    JobEvent event;
    event.time = event.value = i;
    event.task = TaskId(0);
    event.job = i;
    trace.events.push_back(event);
  }
  trace.info.end = 150'000;
  return trace;
}

std::vector<JobEvent> visited(const Recording &run) {
  std::vector<JobEvent> events;
  EXPECT_TRUE(run.visit([&](std::span<const JobEvent> some) {
    EXPECT_LE(some.size(), 65'536U);
    events.insert(events.end(), some.begin(), some.end());
  }));
  return events;
}

TEST(Recording, EachVisitBeginsWithTheFirstEvent) {
  const Trace trace = long_run();
  const std::string path =
      (std::filesystem::temp_directory_path() / ("redag_recording_" + std::to_string(::getpid()))).string();
  ASSERT_TRUE(write_trace(path, trace));
  const Result<Recording> run = Recording::open(path);
  ASSERT_TRUE(run);
  EXPECT_EQ(run->info().end, trace.info.end);
  EXPECT_EQ(visited(*run), trace.events);
  EXPECT_EQ(visited(*run), trace.events);
  std::filesystem::remove(path);
  const Recording in_memory(trace);
  EXPECT_EQ(visited(in_memory), trace.events);
  EXPECT_EQ(visited(in_memory), trace.events);
}

TEST(Recording, DamageIsFoundInEachVisit) {
  const Trace trace = long_run();
  const std::string path =
      (std::filesystem::temp_directory_path() / ("redag_damaged_" + std::to_string(::getpid()) + ".redag")).string();
  ASSERT_TRUE(write_trace(path, trace));
  const Result<Recording> run = Recording::open(path);
  ASSERT_TRUE(run);
  std::filesystem::resize_file(path, std::filesystem::file_size(path) / 2);
  for (int i = 0; i < 2; ++i) EXPECT_FALSE(run->visit([](std::span<const JobEvent>) {}));
  std::filesystem::remove(path);
}

}  // namespace
}  // namespace redag::trace
