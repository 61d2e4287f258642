// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <thread>

#include "redag/derived/rng.hpp"
#include "redag/loader/text_file.hpp"
#include "redag/trace/event_codec.hpp"
#include "redag/trace/events_file.hpp"
#include "redag/trace/run_info_json.hpp"
#include "tests/testing/builders.hpp"

namespace redag::trace {
namespace {

using ::testing::HasSubstr;

namespace fs = std::filesystem;

class EventsBlocks : public ::testing::Test {
 protected:
  void TearDown() override { fs::remove(path_); }

  static Trace trace_of(std::size_t events) {
    Trace trace;
    trace.info.workload = testing::make_workload({testing::make_dag("control", {{"imu", 5, 1}, {"ekf", 0, 1, {0}}}, 2)},
                                                 2, PreemptionMode::None);
    trace.info.executor = "redag";
    trace.info.preemption = "none";
    trace.info.config.workers = 2;
    trace.info.start = 1000;
    trace.info.end = 1000 + kSecond;
    trace.info.lost_events = 3;
    trace.info.remarks = {{.begun = 5, .ended = 9, .text = "deadlock"}};
    Rng rng(5);
    Time time = trace.info.start;
    for (std::size_t i = 0; i < events; ++i) {
      time += rng.uniform(0, 1000);
      trace.events.push_back({.time = time,
                              .value = time + rng.uniform(-50, 50),
                              .task = TaskId(i % 2),
                              .job = static_cast<std::uint32_t>(i / 4),
                              .worker = i % 3 == 0 ? WorkerId::kNoneValue : static_cast<std::uint32_t>(i % 2),
                              .kind = static_cast<JobEventKind>(rng.uniform(0, 9))});
    }
    return trace;
  }

  std::string written(const Trace &trace) const {
    const Result<void> result = write_trace(path_, trace);
    EXPECT_TRUE(result) << (result ? "" : to_string(result.error()));
    return read_file(path_).value();
  }

  std::string path_ =
      (fs::path(::testing::TempDir()) / ("redag_blocks." + std::to_string(::getpid()) + ".redag")).string();
};

// A small file must not become a large tree.
TEST_F(EventsBlocks, ADescriptionThatExpandsTooMuchIsRefused) {
  Trace trace = trace_of(1);
  trace.info.preemption_why = std::string(2'000'000, 'x');
  EXPECT_LT(written(trace).size(), 20'000U);
  const Result<Trace> read = read_trace(path_);
  ASSERT_FALSE(read);
  EXPECT_THAT(to_string(read.error()), HasSubstr("byte 16: the block is longer than a block can be"));
}

TEST_F(EventsBlocks, AllEventsAreReadBackBlockByBlock) {
  for (const std::size_t count : {std::size_t{0}, std::size_t{1}, kMostBlockEvents, 2 * kMostBlockEvents + 77}) {
    const Trace before = trace_of(count);
    written(before);
    const Result<Trace> after = read_trace(path_);
    ASSERT_TRUE(after) << to_string(after.error());
    EXPECT_TRUE(after->events == before.events) << count;
    EXPECT_EQ(run_info_to_json(after->info), run_info_to_json(before.info));
    auto reader = EventsReader::open(path_);
    ASSERT_TRUE(reader);
    EXPECT_EQ(reader->info().end, before.info.end) << "before the first event is read";
    EXPECT_EQ(reader->info().lost_events, 3U);
    EXPECT_EQ(reader->events(), count);
    std::vector<JobEvent> some;
    for (std::size_t read = 0;; read += some.size()) {
      const Result<bool> more = reader->next(some);
      ASSERT_TRUE(more);
      if (!*more) break;
      EXPECT_LE(some.size(), kMostBlockEvents);
    }
    EXPECT_FALSE(reader->next(some).value()) << "the end remains the end";
  }
}

// No change of any byte, and no cut, is taken for a whole trace; the message says where.
TEST_F(EventsBlocks, DamageIsFoundAtItsByte) {
  const std::string good = written(trace_of(50));
  const auto is_known_to_end = [](const std::string &bytes) {
    const Result<Trace> read = parse_trace(bytes, "f");
    return read && read->info.remarks.size() == 1;  // that of trace_of()
  };
  EXPECT_TRUE(is_known_to_end(good));
  for (std::size_t length = 0; length < good.size(); ++length) {
    EXPECT_FALSE(is_known_to_end(good.substr(0, length))) << length;
  }
  for (std::size_t at = 0; at < good.size(); ++at) {
    std::string damaged = good;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
    EXPECT_FALSE(is_known_to_end(damaged)) << at;
    if (at + 56 >= good.size()) continue;
    EXPECT_EQ(parse_trace(damaged, "f").error().front().file, "f") << at;
  }
  EXPECT_FALSE(is_known_to_end(good + "x"));

  std::string run = good;
  run[16 + 40] ^= 1;
  EXPECT_THAT(to_string(parse_trace(run, "f").error()), HasSubstr("byte 16: the file is damaged here: the checksum"));
  EXPECT_THAT(parse_trace(good.substr(0, good.size() - 9), "f")->info.remarks.back().text,
              HasSubstr("47 bytes are no whole block"));
  std::string text = good;
  text.erase(14, 1);
  EXPECT_THAT(to_string(parse_trace(text, "f").error()), HasSubstr("byte 14: the file was copied as text"));
}

// Blocks that are whole, but not where they belong.
TEST_F(EventsBlocks, AMissingOrRepeatedBlockIsFound) {
  const Trace trace = trace_of(kMostBlockEvents + 10);
  const std::string both = written(trace);
  const auto length_of_block = [&](std::size_t at) {
    std::uint32_t bytes = 0;
    std::memcpy(&bytes, both.data() + at + 8, sizeof bytes);
    return 32 + std::size_t{bytes};
  };
  const std::size_t first = 16 + length_of_block(16);
  const std::size_t second = first + length_of_block(first);
  const std::size_t end = second + length_of_block(second);
  ASSERT_EQ(end + 56, both.size());
  EXPECT_THAT(to_string(parse_trace(both.substr(0, first) + both.substr(second), "f").error()),
              HasSubstr("a block is missing before this one"));
  EXPECT_THAT(to_string(parse_trace(both.substr(0, second) + both.substr(end), "f").error()),
              HasSubstr("has 65536 events, but 65546 were written"));
  EXPECT_THAT(to_string(parse_trace(both.substr(0, second) + both.substr(first), "f").error()),
              HasSubstr("a block is missing"));
  EXPECT_THAT(to_string(parse_trace(both.substr(0, end) + both.substr(16), "f").error()),
              HasSubstr("a block is missing before this one"));
}

TEST_F(EventsBlocks, APipeIsReadToo) {
  const Trace trace = trace_of(1000);
  written(trace);
  const std::string pipe = path_ + ".pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  std::thread writer([&] {
    std::ofstream out(pipe, std::ios::binary);
    out << std::ifstream(path_, std::ios::binary).rdbuf();
  });
  const Result<Trace> read = read_trace(pipe);
  writer.join();
  fs::remove(pipe);
  ASSERT_TRUE(read) << to_string(read.error());
  EXPECT_TRUE(read->events == trace.events);
}

}  // namespace
}  // namespace redag::trace
