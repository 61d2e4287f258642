// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/hosts/time_service.hpp"

#include <gtest/gtest.h>

#include <string>

namespace redag::hosts {
namespace {

constexpr const char *kTracking =
    "Reference ID    : CB00710F (ntp1.example.net)\n"
    "Stratum         : 3\n"
    "Ref time (UTC)  : Fri Jan 27 09:27:29 2017\n"
    "System time     : 0.000006523 seconds slow of NTP time\n"
    "Last offset     : -0.000006747 seconds\n"
    "RMS offset      : 0.000035822 seconds\n"
    "Frequency       : 3.225 ppm slow\n"
    "Residual freq   : -0.000 ppm\n"
    "Skew            : 0.129 ppm\n"
    "Root delay      : 0.013639022 seconds\n"
    "Root dispersion : 0.001100737 seconds\n"
    "Update interval : 64.2 seconds\n"
    "Leap status     : Normal\n";

constexpr const char *kStatus =
    "sending: GET TIME_STATUS_NP\n"
    "\t90e2ba.fffe.20c7f8-0 seq 0 RESPONSE MANAGEMENT TIME_STATUS_NP \n"
    "\t\tmaster_offset              -310\n"
    "\t\tingress_time               1443107321405285128\n"
    "\t\tcumulativeScaledRateOffset +0.000000000\n"
    "\t\tscaledLastGmPhaseChange    0\n"
    "\t\tgmTimeBaseIndicator        0\n"
    "\t\tlastGmPhaseChange          0x0000'0000000000000000.0000\n"
    "\t\tgmPresent                  true\n"
    "\t\tgmIdentity                 90e2ba.fffe.20c7f9\n";

constexpr const char *kCurrent =
    "sending: GET CURRENT_DATA_SET\n"
    "\t90e2ba.fffe.20c7f8-0 seq 0 RESPONSE MANAGEMENT CURRENT_DATA_SET \n"
    "\t\tstepsRemoved     1\n"
    "\t\toffsetFromMaster -310.0\n"
    "\t\tmeanPathDelay    2310.7\n";

std::string changed(std::string text, const std::string &from, const std::string &to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

std::string refusal_of_text(const std::string &text) {
  const Result<TimeServiceReading> reading = parse_time_service(text, "clock.txt");
  return reading ? "accepted" : to_string(reading.error());
}

TEST(TimeService, TakesChronysBoundOnTheError) {
  const Result<TimeServiceReading> slow = parse_time_service(kTracking, "clock.txt");
  ASSERT_TRUE(slow);
  EXPECT_EQ(slow->service, "chrony");
  constexpr Duration kError = 1'100'737 + 13'639'022 / 2;  // root dispersion + root delay / 2
  // The clock is 6.5 us slow, and chrony is about to correct that.
  EXPECT_EQ(slow->offset, (Interval{-6'523 - kError, kError}));
  const Result<TimeServiceReading> fast = parse_time_service(changed(kTracking, "slow of", "fast of"), "clock.txt");
  ASSERT_TRUE(fast);
  EXPECT_EQ(fast->offset, (Interval{-kError, 6'523 + kError}));
}

TEST(TimeService, TakesTheDelayOfLinuxptpAsTheBound) {
  const Result<TimeServiceReading> both = parse_time_service(std::string(kStatus) + kCurrent, "clock.txt");
  ASSERT_TRUE(both);
  EXPECT_EQ(both->service, "linuxptp");
  EXPECT_TRUE(both->states_uncertainty);
  EXPECT_EQ(both->offset, (Interval{-310 - 2'311, 2'311}));
  const Result<TimeServiceReading> alone = parse_time_service(kStatus, "clock.txt");
  ASSERT_TRUE(alone);
  EXPECT_FALSE(alone->states_uncertainty);
  EXPECT_EQ(alone->offset, (Interval{-310, 0}));
  // Of boundary clocks in between, the delay of the last way says nothing.
  const auto far =
      parse_time_service(kStatus + changed(kCurrent, "stepsRemoved     1", "stepsRemoved     3"), "clock.txt");
  ASSERT_TRUE(far);
  EXPECT_FALSE(far->states_uncertainty);
  std::string master = changed(kStatus, "gmPresent                  true", "gmPresent                  false");
  EXPECT_EQ(refusal_of_text(master),
            "clock.txt:9:1: error: linuxptp had lost the grandmaster of this clock (record again once "
            "gmPresent is true)");
  master = changed(master, "master_offset              -310", "master_offset              0");
  const Result<TimeServiceReading> grandmaster = parse_time_service(master, "clock.txt");
  ASSERT_TRUE(grandmaster);
  EXPECT_EQ(grandmaster->offset, Interval{});
}

TEST(TimeService, SeveralReadingsHullTheOffset) {
  ClockStatement clock;
  add_reading({"chrony", {-5, 10}}, "before.txt", clock);
  add_reading({"chrony", {-20, 2}}, "after.txt", clock);
  EXPECT_EQ(clock.kept_within, (Interval{-20, 10}));
  EXPECT_EQ(clock.by, "chrony (before.txt), chrony (after.txt)");
}

TEST(TimeService, RefusesOtherTextsWithTheLine) {
  EXPECT_EQ(
      refusal_of_text("506 Cannot talk to daemon\n").rfind("clock.txt:1:1: error: neither chrony nor linuxptp", 0), 0U);
  EXPECT_EQ(refusal_of_text("").rfind("clock.txt: error: neither", 0), 0U);
  EXPECT_EQ(refusal_of_text(changed(kTracking, "0.000006523 seconds slow", "unknown slow"))
                .rfind("clock.txt:4:1: error: 'unknown slow", 0),
            0U);
  EXPECT_EQ(refusal_of_text(changed(kTracking, "slow of", "near")).rfind("clock.txt:4:1: error:", 0), 0U);
  EXPECT_EQ(refusal_of_text(changed(kTracking, "Root delay      : 0.013639022 seconds\n", ""))
                .rfind("clock.txt: error: the line 'Root delay' is missing", 0),
            0U);
  EXPECT_EQ(refusal_of_text(changed(kTracking, "0.001100737 seconds", "1e99")).rfind("clock.txt:11:1: error:", 0), 0U);
  EXPECT_EQ(refusal_of_text(changed(kTracking, "Normal", "Not synchronised"))
                .rfind("clock.txt:13:1: error: chrony had not", 0),
            0U);
  EXPECT_EQ(refusal_of_text(changed(kStatus, "-310", "0x31")).rfind("clock.txt:3:1: error:", 0), 0U);
  EXPECT_EQ(refusal_of_text(kStatus + changed(kCurrent, "2310.7", "-4")).rfind("clock.txt:15:1: error:", 0), 0U);
  EXPECT_EQ(
      refusal_of_text(changed(kStatus, "gmPresent", "gmpresent")).rfind("clock.txt:3:1: error: it does not say", 0),
      0U);
}

}  // namespace
}  // namespace redag::hosts
