// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/loader/calibration.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace redag {
namespace {

using ::testing::HasSubstr;

Overheads some() {
  return {.timer = 4'100,
          .dispatch = 62 * kMicrosecond,
          .preempt = 9 * kMicrosecond,
          .lateness = 110 * kMicrosecond,
          .stall = {.longest = 350 * kMicrosecond, .per_second = 4 * kMillisecond},
          .noise = {.longest = 40 * kMicrosecond, .per_second = 3 * kMillisecond},
          .clock = 900};
}

Calibration calibration() {
  Calibration all;
  all.realtime = some();
  all.normal = plausible_overheads();
  all.date = "2026-11-23T08:30:00Z";
  all.host = "robot: \"the second\"";
  all.kernel = "Linux 6.1";
  all.processor = "an old one";
  all.rights = "SCHED_FIFO up to 98";
  all.version = "0.1.0";
  all.duration = 30 * kSecond;
  all.processors = 4;
  return all;
}

std::string mistakes(const std::string &text) {
  const Result<Calibration> parsed = parse_calibration(text, "o.yaml");
  return parsed ? std::string() : to_string(parsed.error());
}

constexpr const char *kNone =
    "timer: 0, dispatch: 0, preempt: 0, lateness: 0, stall: 0, stall_per_second: 0, noise: 0, noise_per_second: 0, ";

TEST(Overheads, TextIsReadBack) {
  EXPECT_EQ(parse_overheads(to_string(some())), some());
  EXPECT_EQ(parse_overheads(to_string(Overheads())), Overheads());
  for (const char *text : {"", "timer", "timer 1us", "release 1us, dispatch 2us, preempt 0", "dispatch 1us"}) {
    EXPECT_FALSE(parse_overheads(text)) << text;
  }
  EXPECT_FALSE(parse_overheads(to_string(some()) + ", more 1us"));
  EXPECT_FALSE(parse_overheads("timer -1us" + to_string(some()).substr(std::string("timer 4.1us").size())));
}

TEST(Overheads, LossGrowsWithTheWindow) {
  const Loss loss{.longest = 100, .per_second = 10 * kMillisecond};
  EXPECT_EQ(loss.in(0), 100);
  EXPECT_EQ(loss.in(kSecond), 100 + 10 * kMillisecond);
  EXPECT_EQ(loss.in(1), 101) << "rounded up";
  EXPECT_EQ(loss.in(kMaxDuration), 100 + (kMaxDuration + 99) / 100);
  EXPECT_EQ(Loss({.longest = kMaxDuration, .per_second = 1}).in(kMaxDuration), kMaxDuration);
}

TEST(Calibration, FileIsReadBack) {
  Calibration all = calibration();
  EXPECT_EQ(parse_calibration(to_yaml(all), "o.yaml").value(), all);
  all.complete = false;
  all.realtime.reset();
  EXPECT_EQ(parse_calibration(to_yaml(all), "o.yaml").value(), all);
}

TEST(Calibration, SaysWhereItComesFrom) {
  Calibration all = calibration();
  EXPECT_EQ(all.provenance(), "calibrated 2026-11-23T08:30:00Z on robot: \"the second\", 30s");
  all.complete = false;
  EXPECT_THAT(all.provenance(), HasSubstr("partial"));
}

TEST(Calibration, OfOneClassOfThreads) {
  Calibration all = calibration();
  EXPECT_EQ(all.of(true).value(), some());
  EXPECT_EQ(all.of(false).value(), plausible_overheads());
  all.realtime.reset();
  EXPECT_THAT(to_string(all.of(true).error()), HasSubstr("SCHED_FIFO"));
}

TEST(Calibration, BadFiles) {
  EXPECT_THAT(mistakes(""), HasSubstr("a map"));
  EXPECT_THAT(mistakes("provenance: {}"), HasSubstr("the key 'overheads' is missing"));
  EXPECT_THAT(mistakes("overheads: {}"), HasSubstr("must have 'realtime', 'normal', or both"));
  EXPECT_THAT(mistakes("overheads: {norml: {}}"), HasSubstr("did you mean 'normal'?"));
  EXPECT_THAT(mistakes("overheads: {normal: {timer: 1us}}"), HasSubstr("normal has no 'dispatch'"));
  const std::string begin = std::string("overheads: {normal: {") + kNone;
  EXPECT_EQ(mistakes(begin + "clock: 0}}"), "");
  EXPECT_THAT(mistakes(begin + "clock: 5}}"), HasSubstr("o.yaml:1:"));
  EXPECT_THAT(mistakes(begin + "clock: -5us}}"), HasSubstr("clock"));
  EXPECT_THAT(mistakes(begin + "clock: 0}}\nprovenance: {complete: perhaps}"), HasSubstr("true or false"));
  EXPECT_THAT(mistakes("overheads: {normal: {timer: 0, dispatch: 0, preempt: 0, lateness: 0, stall: 0, "
                       "stall_per_second: 1s, noise: 0, noise_per_second: 0, clock: 0}}"),
              HasSubstr("must be below one second per second"));
  EXPECT_THAT(to_string(load_calibration("/").error()), HasSubstr("is a directory, not a file"));
  EXPECT_THAT(to_string(load_calibration("/no/such/file").error()), HasSubstr("cannot open"));
}

}  // namespace
}  // namespace redag
