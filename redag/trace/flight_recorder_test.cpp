// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/trace/flight_recorder.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>
#include <csignal>

#include <array>
#include <filesystem>
#include <fstream>

#include "redag_testing/builders.hpp"

namespace redag::trace {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kBlockBytes = 4096;
constexpr std::size_t kBlockEvents = 127;

RunInfo flight_example() {
  RunInfo info;
  info.workload = testing::make_workload({testing::make_dag("control", {{"imu", 5, 1}, {"ekf", 0, 1, {0}}})}, 2);
  info.executor = "redag";
  info.preemption = "none";
  info.driver = Driver::Threads;
  info.end = kSecond;
  return info;
}

// Events at one instant each.
std::vector<JobEvent> events(std::size_t from, std::size_t count) {
  std::vector<JobEvent> made(count);
  for (std::size_t i = 0; i < count; ++i) {
    made[i].time = static_cast<Time>(from + i);
    made[i].task = TaskId((from + i) % 2);
    made[i].job = static_cast<std::uint32_t>(from + i);
  }
  return made;
}

class FlightRecord : public ::testing::Test {
 protected:
  void TearDown() override { fs::remove_all(folder_); }

  FlightRecorder create(const FlightOptions &options = {}) {
    Result<FlightRecorder> recorder = FlightRecorder::create(folder_, flight_example(), options);
    EXPECT_TRUE(recorder) << (recorder ? "" : to_string(recorder.error()));
    return std::move(*recorder);
  }
  Recovered recovered() {
    Result<Recovered> found = recover(folder_);
    EXPECT_TRUE(found) << (found ? "" : to_string(found.error()));
    return found ? std::move(*found) : Recovered{};
  }
  // Writes `bytes` over those of the record, from `offset` on.
  void overwrite(std::size_t offset, const std::string &bytes) const {
    std::fstream file(folder_ + "/events.bin", std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(offset));
    file << bytes;
  }
  void expect_error(const std::string &part) const {
    const Result<Recovered> found = recover(folder_);
    ASSERT_FALSE(found);
    EXPECT_NE(to_string(found.error()).find(part), std::string::npos) << to_string(found.error());
  }

  const std::string folder_ =
      (fs::path(::testing::TempDir()) / ("redag_flight." + std::to_string(::getpid()))).string();
};

TEST_F(FlightRecord, GivesBackWhatWasAppended) {
  {
    FlightRecorder recorder = create();
    ASSERT_TRUE(recorder.append(events(0, 1), 0));
    ASSERT_TRUE(recorder.append({}, 0));
    ASSERT_TRUE(recorder.append(events(1, 2 * kBlockEvents), 0));
    ASSERT_TRUE(recorder.append(events(1 + 2 * kBlockEvents, 5), 3));
  }
  const Recovered found = recovered();
  const std::size_t all = 2 * kBlockEvents + 6;
  EXPECT_EQ(found.trace.events, events(0, all - 1)) << "all but the last instant";
  EXPECT_EQ(found.trace.info.end, static_cast<Time>(all - 1));
  EXPECT_EQ(found.trace.info.workload, flight_example().workload);
  EXPECT_EQ(found.trace.info.lost_events, 3U);
  EXPECT_EQ(found.overwritten, 0U);
  EXPECT_EQ(found.damaged, 0U);
  ASSERT_TRUE(remove_flight_record(folder_));
  EXPECT_FALSE(fs::exists(folder_));
  ASSERT_TRUE(remove_flight_record(folder_)) << "there is nothing to remove";
}

TEST_F(FlightRecord, OutlivesItsProcess) {
  std::array<int, 2> pipe_ends{};
  ASSERT_EQ(::pipe(pipe_ends.data()), 0);
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    FlightRecorder recorder = create();
    const bool kept = recorder.append(events(0, 1000), 0).has_value();
    static_cast<void>(::write(pipe_ends[1], kept ? "y" : "n", 1));
    for (;;) ::pause();
  }
  char kept = 0;
  ASSERT_EQ(::read(pipe_ends[0], &kept, 1), 1);
  EXPECT_EQ(kept, 'y');
  expect_error("the run is still in progress");
  ASSERT_EQ(::kill(child, SIGKILL), 0);
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_EQ(recovered().trace.events, events(0, 999));
  for (const int end : pipe_ends) ::close(end);
}

TEST_F(FlightRecord, NewEventsReplaceTheOldest) {
  constexpr std::size_t kBlocks = 4;
  {
    FlightRecorder recorder = create({.most_bytes = kBlocks * kBlockBytes});
    for (std::size_t i = 0; i < 10; ++i) {
      ASSERT_TRUE(recorder.append(events(i * kBlockEvents, kBlockEvents), 0));
    }
    // Exceeds the capacity in one call, across the end of the file.
    ASSERT_TRUE(recorder.append(events(10 * kBlockEvents, 3 * kBlockEvents), 0));
  }
  EXPECT_EQ(fs::file_size(folder_ + "/events.bin"), kBlocks * kBlockBytes);
  const Recovered found = recovered();
  EXPECT_EQ(found.trace.events, events(9 * kBlockEvents, kBlocks * kBlockEvents - 1));
  EXPECT_EQ(found.overwritten, 9 * kBlockEvents);
  EXPECT_EQ(found.trace.info.lost_events, 9 * kBlockEvents) << "the trace has a hole at its beginning";
}

// A machine that loses power leaves some blocks with their old content, or half written.
TEST_F(FlightRecord, EndsBeforeTheFirstBlockThatIsNotWhole) {
  {
    FlightRecorder recorder = create();
    ASSERT_TRUE(recorder.append(events(0, 5 * kBlockEvents), 0));
  }
  overwrite(3 * kBlockBytes + 2000, "x");
  EXPECT_EQ(recovered().trace.events, events(0, 3 * kBlockEvents - 1));
  EXPECT_GE(recovered().damaged, 1U);
  overwrite(0, std::string(kBlockBytes, '\0'));
  EXPECT_EQ(recovered().trace.events, events(kBlockEvents, 2 * kBlockEvents - 1));
  fs::resize_file(folder_ + "/events.bin", kBlockBytes + 100);
  EXPECT_TRUE(recovered().trace.events.empty());
  EXPECT_EQ(recovered().damaged, 2U);
}

TEST_F(FlightRecord, WithoutEventsIsARunWithout) {
  static_cast<void>(create());
  EXPECT_TRUE(recovered().trace.events.empty());
  EXPECT_EQ(recovered().trace.info.end, 0);
}

TEST_F(FlightRecord, AnotherDescriptionReplacesTheFirst) {
  FlightRecorder recorder = create();
  RunInfo larger = flight_example();
  larger.workload.dags.push_back(testing::make_dag("map", {{"lidar", 100, 20}}));
  ASSERT_TRUE(recorder.describe(larger));
  std::vector<JobEvent> of_both = events(0, 3);
  of_both[1].task = TaskId(2);
  ASSERT_TRUE(recorder.append(of_both, 0));
  { const FlightRecorder ended = std::move(recorder); }
  EXPECT_EQ(recovered().trace.info.workload.dags.size(), 2U);
  EXPECT_EQ(recovered().trace.events.size(), 2U);
}

// A driver whose tasks come and go uses other ids than the workload that describes the run at its end.
TEST_F(FlightRecord, IdsOfTheDriverBecomePositions) {
  FlightRecorder recorder = create();
  ASSERT_TRUE(recorder.describe(flight_example(), std::vector<std::uint32_t>{1, 0, 1}));
  std::vector<JobEvent> by_id = events(0, 4);
  by_id[2].task = TaskId(2);
  ASSERT_TRUE(recorder.append(by_id, 0));
  { const FlightRecorder ended = std::move(recorder); }
  const std::vector<JobEvent> found = recovered().trace.events;
  ASSERT_EQ(found.size(), 3U);
  EXPECT_EQ(found[0].task, TaskId(1));
  EXPECT_EQ(found[1].task, TaskId(0));
  EXPECT_EQ(found[2].task, TaskId(1));
  std::ofstream(folder_ + "/run.json", std::ios::app) << "[5]";
  expect_error("positions");
}

TEST_F(FlightRecord, IsNotWrittenOverAnother) {
  static_cast<void>(create());
  const Result<FlightRecorder> second = FlightRecorder::create(folder_, flight_example());
  ASSERT_FALSE(second);
  EXPECT_NE(to_string(second.error()).find("redag recover"), std::string::npos);
}

TEST_F(FlightRecord, WhatIsNotOneIsAnError) {
  expect_error("run.json");
  static_cast<void>(create());
  std::ofstream(folder_ + "/run.json") << "{}";
  expect_error("not a flight record");
  std::ofstream(folder_ + "/run.json") << std::string(100'000, '[');
  expect_error("nested too deep");
}

TEST_F(FlightRecord, EventsOfAnotherRunAreAnError) {
  {
    FlightRecorder recorder = create();
    std::vector<JobEvent> foreign = events(0, 3);
    foreign[1].task = TaskId(99);
    ASSERT_TRUE(recorder.append(foreign, 0));
  }
  expect_error("do not belong to the run");
}

TEST_F(FlightRecord, AFullDiskIsToldOnce) {
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "there is no /dev/full";
  FlightRecorder recorder = create();
  // Replaces the recorder's file by one that fails every write.
  for (const fs::directory_entry &entry : fs::directory_iterator("/proc/self/fd")) {
    std::error_code ignored;
    if (fs::read_symlink(entry.path(), ignored) != fs::path(folder_) / "events.bin") continue;
    const int full = ::open("/dev/full", O_WRONLY | O_CLOEXEC);
    ASSERT_GE(::dup2(full, std::stoi(entry.path().filename().string())), 0);
    ::close(full);
    break;
  }
  const Result<void> first = recorder.append(events(0, 1), 0);
  ASSERT_FALSE(first);
  EXPECT_NE(to_string(first.error()).find("events.bin"), std::string::npos);
  EXPECT_TRUE(recorder.append(events(1, 1), 0));
}

}  // namespace
}  // namespace redag::trace
