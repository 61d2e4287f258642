// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// EventsWriter::record(): files of events without their end.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <filesystem>
#include <fstream>

#include "redag/loader/text_file.hpp"
#include "redag/trace/events_file.hpp"
#include "tests/testing/builders.hpp"

namespace redag::trace {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

RunInfo record_example() {
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
    made[i].value = static_cast<Time>((from + i) * 7919 % 104'729);
    made[i].task = TaskId((from + i) % 2);
    made[i].job = static_cast<std::uint32_t>(from + i);
  }
  return made;
}

class EventsRecord : public ::testing::Test {
 protected:
  void SetUp() override { fs::create_directory(folder_); }
  void TearDown() override { fs::remove_all(folder_); }

  EventsWriter record(std::uint64_t most_bytes = kMostRecordBytes) const {
    Result<EventsWriter> writer = EventsWriter::record(path_, record_example(), most_bytes);
    EXPECT_TRUE(writer) << (writer ? "" : to_string(writer.error()));
    return std::move(*writer);
  }
  Trace read() const {
    Result<Trace> trace = read_trace(path_);
    EXPECT_TRUE(trace) << (trace ? "" : to_string(trace.error()));
    return trace ? std::move(*trace) : Trace{};
  }

  const std::string folder_ =
      (fs::path(::testing::TempDir()) / ("redag_record." + std::to_string(::getpid()))).string();
  const std::string path_ = folder_ + "/events.redag";
};

TEST_F(EventsRecord, IsReadUpToItsLastFlush) {
  EventsWriter writer = record();
  EXPECT_TRUE(read().events.empty());
  EXPECT_EQ(read().info.end, 0);
  writer.add(events(0, 1));
  ASSERT_TRUE(writer.flush(0));
  writer.add(events(1, 70'000));
  ASSERT_TRUE(writer.flush(3));
  writer.add(events(70'001, 5));
  const Trace trace = read();
  EXPECT_TRUE(trace.events == events(0, 70'000)) << "all but the last instant";
  EXPECT_EQ(trace.info.end, 69'999);
  EXPECT_EQ(trace.info.workload, record_example().workload);
  EXPECT_EQ(trace.info.lost_events, 3U);
  ASSERT_EQ(trace.info.remarks.size(), 1U);
  EXPECT_EQ(trace.info.remarks[0].text, "the record ends here: the run was killed, or still goes on");
  ASSERT_TRUE(writer.commit(kSecond, 4));
  const Trace whole = read();
  EXPECT_TRUE(whole.events == events(0, 70'006));
  EXPECT_EQ(whole.info.end, kSecond);
  EXPECT_EQ(whole.info.lost_events, 4U);
  EXPECT_TRUE(whole.info.remarks.empty());
}

TEST_F(EventsRecord, OutlivesItsProcess) {
  std::array<int, 2> pipe_ends{};
  ASSERT_EQ(::pipe(pipe_ends.data()), 0);
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    EventsWriter writer = record();
    writer.add(events(0, 1000));
    const bool kept = writer.flush(0).has_value();
    static_cast<void>(::write(pipe_ends[1], kept ? "y" : "n", 1));
    for (;;) ::pause();
  }
  char kept = 0;
  ASSERT_EQ(::read(pipe_ends[0], &kept, 1), 1);
  EXPECT_EQ(kept, 'y');
  EXPECT_THAT(to_string(move_unfinished_aside(path_).error()), HasSubstr("another run is being recorded"));
  ASSERT_EQ(::kill(child, SIGKILL), 0);
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_TRUE(read().events == events(0, 999));
  const std::string aside = move_unfinished_aside(path_).value();
  EXPECT_EQ(aside, folder_ + "/events.1.redag");
  EXPECT_TRUE(read_trace(aside));
  EXPECT_EQ(move_unfinished_aside(path_).value(), "") << "there is nothing to move";
  for (const int end : pipe_ends) ::close(end);
}

TEST_F(EventsRecord, NewEventsReplaceTheOldest) {
  constexpr std::uint64_t kMost = 32U << 10U;
  EventsWriter writer = record(kMost);
  std::size_t count = 0;
  for (; count < 100'000; count += 100) {
    writer.add(events(count, 100));
    ASSERT_TRUE(writer.flush(0));
  }
  const auto expect_newest = [&](const Trace &trace, std::size_t last) {
    ASSERT_FALSE(trace.events.empty());
    const std::size_t first = trace.events.front().job;
    EXPECT_GT(first, 0U);
    EXPECT_TRUE(trace.events == events(first, last - first));
    EXPECT_EQ(trace.info.lost_events, first) << "the trace has a hole at its beginning";
  };
  expect_newest(read(), count - 1);
  struct stat status {};
  ASSERT_EQ(::stat(path_.c_str(), &status), 0);
  EXPECT_GT(status.st_size, static_cast<off_t>(2 * kMost));
  EXPECT_LE(status.st_blocks * 512, static_cast<off_t>(kMost + (16U << 10U))) << "what was replaced takes no space";
  ASSERT_TRUE(writer.commit(kSecond, 0));
  expect_newest(read(), count);
}

// A machine that loses power can leave a part of a block, or zeros.
TEST_F(EventsRecord, EndsBeforeTheFirstBlockThatIsNotWhole) {
  {
    EventsWriter writer = record();
    for (std::size_t i = 0; i < 5; ++i) {
      writer.add(events(100 * i, 100));
      ASSERT_TRUE(writer.flush(0));
    }
  }
  const std::string whole = read_file(path_).value();
  EXPECT_FALSE(parse_trace(whole.substr(0, 100), "f")) << "no description";
  std::size_t last = 0;
  for (std::size_t size = whole.size() / 2; size < whole.size(); ++size) {
    for (const std::string &cut : {whole.substr(0, size), whole.substr(0, size) + std::string(9000, '\0')}) {
      const Result<Trace> trace = parse_trace(cut, "f");
      ASSERT_TRUE(trace) << to_string(trace.error());
      const std::size_t found = trace->events.size();
      EXPECT_EQ(found % 100, found == 0 ? 0U : 99U);
      EXPECT_TRUE(trace->events == events(0, found));
      EXPECT_GE(found, last);
      last = found;
    }
  }
  const Trace cut = parse_trace(whole.substr(0, whole.size() - 1), "f").value();
  EXPECT_THAT(cut.info.remarks.back().text, HasSubstr(" bytes are no whole block"));
}

TEST_F(EventsRecord, AnotherDescriptionReplacesTheFirst) {
  EventsWriter writer = record();
  RunInfo larger = record_example();
  larger.workload.dags.push_back(testing::make_dag("map", {{"lidar", 100, 20}}));
  ASSERT_TRUE(writer.describe(larger));
  std::vector<JobEvent> of_both = events(0, 3);
  of_both[1].task = TaskId(2);
  writer.add(of_both);
  ASSERT_TRUE(writer.flush(0));
  EXPECT_EQ(read().info.workload.dags.size(), 2U);
  EXPECT_EQ(read().events.size(), 2U);
  ASSERT_TRUE(writer.commit(kSecond, 0));
  EXPECT_EQ(read().info.workload.dags.size(), 2U);
  EXPECT_TRUE(read().events == of_both);
  larger.workload.dags[0].tasks[0].wcet = -1;
  EXPECT_FALSE(writer.describe(larger));
}

// A driver whose tasks come and go uses other ids than the workload that describes the run at its end.
TEST_F(EventsRecord, IdsOfTheDriverBecomePositions) {
  EventsWriter writer = record();
  ASSERT_TRUE(writer.describe(record_example(), std::vector<std::uint32_t>{1, 0, 1}));
  std::vector<JobEvent> by_id = events(0, 4);
  by_id[2].task = TaskId(2);
  writer.add(by_id);
  ASSERT_TRUE(writer.flush(0));
  const std::vector<JobEvent> found = read().events;
  ASSERT_EQ(found.size(), 3U);
  EXPECT_EQ(found[0].task, TaskId(1));
  EXPECT_EQ(found[1].task, TaskId(0));
  EXPECT_EQ(found[2].task, TaskId(1));
  ASSERT_TRUE(writer.describe(record_example(), std::vector<std::uint32_t>{1, 0, 5}));
  ASSERT_TRUE(writer.flush(0));
  EXPECT_THAT(to_string(read_trace(path_).error()), HasSubstr("positions of tasks"));
}

TEST_F(EventsRecord, ACompleteFileIsReplacedAndAnyOtherIsMovedAside) {
  ASSERT_TRUE(record().commit(kSecond, 0));
  EXPECT_EQ(move_unfinished_aside(path_).value(), "");
  static_cast<void>(record());
  EXPECT_EQ(move_unfinished_aside(path_).value(), folder_ + "/events.1.redag");
  std::ofstream(path_) << "something else";
  EXPECT_EQ(move_unfinished_aside(path_).value(), folder_ + "/events.2.redag");
}

TEST_F(EventsRecord, EventsOfAnotherRunAreAnError) {
  EventsWriter writer = record();
  std::vector<JobEvent> foreign = events(0, 3);
  foreign[1].task = TaskId(99);
  writer.add(foreign);
  EXPECT_FALSE(writer.flush(0));
  EXPECT_FALSE(writer.flush(0));
}

TEST_F(EventsRecord, AFullDiskIsAnError) {
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "there is no /dev/full";
  EventsWriter writer = record();
  // Replaces the file by one that fails every write.
  for (const fs::directory_entry &entry : fs::directory_iterator("/proc/self/fd")) {
    std::error_code ignored;
    if (fs::read_symlink(entry.path(), ignored) != fs::path(path_)) continue;
    const int full = ::open("/dev/full", O_WRONLY | O_CLOEXEC);
    ASSERT_GE(::dup2(full, std::stoi(entry.path().filename().string())), 0);
    ::close(full);
    break;
  }
  writer.add(events(0, 1));
  const Result<void> flushed = writer.flush(0);
  ASSERT_FALSE(flushed);
  EXPECT_THAT(to_string(flushed.error()), HasSubstr("events.redag"));
  EXPECT_FALSE(EventsWriter::record(folder_ + "/none/events.redag", record_example()));
}

}  // namespace
}  // namespace redag::trace
