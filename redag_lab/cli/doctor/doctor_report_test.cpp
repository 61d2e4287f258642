// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/doctor/doctor_report.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

namespace redag::cli {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

doctor::Diagnosis two_lines() {
  doctor::Diagnosis diagnosis;
  diagnosis.lines = {
      {"swap", {doctor::Verdict::Green, "none"}, "Memory that was swapped out is slow.", "sudo swapoff --all"},
      {"throttling",
       {doctor::Verdict::Yellow, "real-time threads get 950ms of each 1s"},
       "Above this share, real-time threads pause for the rest of the period: no bound allows for that.",
       "sudo sysctl kernel.sched_rt_runtime_us=-1"}};
  return diagnosis;
}

TEST(DoctorReport, SaysWhatIsSoAndHowToMendIt) {
  EXPECT_EQ(describe(two_lines(), 60, false),
            "green    swap: none\n"
            "yellow   throttling: real-time threads get 950ms of each 1s\n"
            "         Above this share, real-time threads pause for the\n"
            "         rest of the period: no bound allows for that.\n"
            "         Mend: sudo sysctl kernel.sched_rt_runtime_us=-1\n"
            "\n"
            "1 green and 1 yellow: nothing is red\n");
  EXPECT_THAT(describe(two_lines(), 0, true), HasSubstr("\x1b[32mgreen\x1b[0m    swap: none\n"));
}

TEST(DoctorReport, TheAnswerIsThatOfTheWorstLine) {
  doctor::Diagnosis diagnosis = two_lines();
  diagnosis.lines.push_back({"SMT", {doctor::Verdict::Unknown, "/sys: No such file or directory"}, "why", "mend"});
  EXPECT_THAT(describe(diagnosis, 80, false), HasSubstr("unknown  SMT: /sys: No such file or directory\n\n"));
  EXPECT_THAT(describe(diagnosis, 80, false), HasSubstr("1 unknown: nothing that could be read is red\n"));
  diagnosis.lines.push_back({"clock source", {doctor::Verdict::Red, "'hpet'"}, "why", "mend"});
  EXPECT_THAT(describe(diagnosis, 80, false), HasSubstr("mend the red lines\n"));
  const Json json = to_json(diagnosis, nullptr);
  EXPECT_EQ(json.at("red"), 1);
  EXPECT_EQ(json.at("lines").at(3).at("verdict"), "red");
  EXPECT_FALSE(json.contains("threads"));
}

TEST(DoctorReport, ThreadsOfOneSchedulingShareARow) {
  doctor::Diagnosis diagnosis = two_lines();
  diagnosis.processes = {{"100"}};
  diagnosis.threads = {{.id = 100, .name = "main", .policy = 0, .priority = 0, .cpus = {0, 1}},
                       {.id = 101, .name = "redag-timer", .policy = 1, .priority = 90, .cpus = {0, 1}},
                       {.id = 102, .name = "redag-wait", .policy = 1, .priority = 90, .cpus = {0, 1}},
                       {.id = 103, .name = "redag-wait", .policy = 1, .priority = 90, .cpus = {0, 1}}};
  EXPECT_THAT(describe(diagnosis, 80, false), HasSubstr("priority  policy  processors  threads\n"
                                                        "      90  fifo    0-1         redag-timer and redag-wait (2)\n"
                                                        "       0  other   0-1         main\n"));
  EXPECT_EQ(to_json(diagnosis, nullptr).at("threads").at(1).at("policy"), "fifo");
}

TEST(DoctorReport, AHistogramHasARowForEachOctave) {
  Histogram latencies;
  for (int i = 0; i < 99; ++i) latencies.add(3 * kMicrosecond);
  latencies.add(10 * kMicrosecond);
  doctor::Measurement measurement{.calibration = {}, .wake_ups = latencies.counts()};
  const std::string text = describe(measurement, 80, false);
  EXPECT_THAT(text, HasSubstr("late by less than  wake-ups\n"
                              "          4.096us        99  ########################################\n"
                              "          8.192us         0\n"
                              "          16.38us         1  #\n"));
  EXPECT_THAT(text, Not(HasSubstr("overheads charged")));
  const Json json = to_json(two_lines(), &measurement);
  EXPECT_EQ(json.at("wake_ups").at("longest_ns"), 10 * kMicrosecond);
  EXPECT_EQ(json.at("wake_ups").at("histogram").size(), 3U);
  EXPECT_TRUE(json.at("overheads").at("normal").is_null());
}

}  // namespace
}  // namespace redag::cli
