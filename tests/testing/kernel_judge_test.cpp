// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Tests the judge with hand-written records: one or two processors, each with a beat at every millisecond.
#include "tests/testing/kernel_judge.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace redag::testing {
namespace {

using Kind = SwitchEvent::Kind;

constexpr JobKey kUrgent{0, 0};
constexpr JobKey kSlow{1, 0};
constexpr pid_t kUrgentThread = 10;
constexpr pid_t kSlowThread = 11;
constexpr pid_t kTimer = 12;

class Record {
 public:
  explicit Record(int cpus) {
    for (int cpu = 0; cpu < cpus; ++cpu) run_.cpus.push_back(cpu);
  }
  Record &at(Time ms) {
    now_ = ms * kMillisecond;
    return *this;
  }
  Record &kernel(Kind kind, int cpu, pid_t thread) {
    run_.events.push_back({now_, kind, cpu, thread});
    return *this;
  }
  /// The timer's thread decides and then sleeps, which shows that its decision was carried out.
  Record &decided(std::vector<Decision::Change> changes) {
    run_.decisions.push_back({now_, kTimer, std::move(changes)});
    return kernel(Kind::Slept, 0, kTimer);
  }
  Record &body(const JobKey &job, pid_t thread, Time begin_ms, Time end_ms) {
    run_.bodies.push_back({job, thread, begin_ms * kMillisecond, end_ms * kMillisecond});
    return *this;
  }
  /// Adds beats of a processor at each millisecond of [from, to), while `thread` runs there.
  Record &beats(int cpu, pid_t thread, Time from, Time to) {
    for (Time ms = from; ms < to; ++ms) run_.events.push_back({ms * kMillisecond, Kind::Beat, cpu, thread});
    return *this;
  }
  [[nodiscard]] KernelVerdict judged() {
    std::stable_sort(run_.events.begin(), run_.events.end(),
                     [](const SwitchEvent &a, const SwitchEvent &b) { return a.time < b.time; });
    return judge(run_);
  }
  KernelRun &run() { return run_; }

 private:
  KernelRun run_;
  Time now_ = 0;
};

// The slow job runs from 1 to 41 ms. The urgent one begins at 5, is preempted at 6 and waits until 40.
Record inverted(Time beats_until) {
  Record record(1);
  record.at(0).decided({{kSlow, true, 5}}).at(1).kernel(Kind::In, 0, kSlowThread);
  record.at(4).decided({{kUrgent, true, 2}}).at(5).kernel(Kind::Preempted, 0, kSlowThread);
  record.kernel(Kind::In, 0, kUrgentThread);
  record.at(6).kernel(Kind::Preempted, 0, kUrgentThread).kernel(Kind::In, 0, kSlowThread);
  record.beats(0, kSlowThread, 7, beats_until);
  record.body(kSlow, kSlowThread, 1, 41).body(kUrgent, kUrgentThread, 5, 45);
  return record;
}

TEST(KernelJudge, AnUrgentJobThatWaitsForALessUrgentOneIsSeen) {
  const KernelVerdict verdict = inverted(7 + kBeats).judged();
  EXPECT_EQ(verdict.violation_count, 1U);
  ASSERT_EQ(verdict.violations.size(), 1U);
  EXPECT_NE(verdict.violations[0].find("job 0 of task 0 of level 2 waits"), std::string::npos) << verdict.violations[0];
  EXPECT_NE(verdict.violations[0].find("job 0 of task 1 of level 5 runs"), std::string::npos) << verdict.violations[0];
}

// The hypervisor took the processor: time passes without any execution.
TEST(KernelJudge, TimeAloneIsNoViolation) {
  const KernelVerdict verdict = inverted(7 + kBeats - 1).judged();
  EXPECT_EQ(verdict.violation_count, 0U);
  EXPECT_GT(verdict.contended, 0U);
  EXPECT_GE(verdict.instants, verdict.contended);
}

TEST(KernelJudge, EachProcessorHasToServeItsTimer) {
  Record record = inverted(100);
  record.run().cpus.push_back(1);  // a processor without beats
  EXPECT_EQ(record.judged().violation_count, 0U);
  record.beats(1, 77, 7, 100);
  EXPECT_EQ(record.judged().violation_count, 1U);
}

TEST(KernelJudge, LevelsMayBeEqual) {
  Record record = inverted(100);
  record.run().decisions[1].changes[0].level = 5;
  EXPECT_EQ(record.judged().violation_count, 0U);
}

TEST(KernelJudge, AChangeOfLevelCountsFromThen) {
  Record record = inverted(100);
  record.run().decisions[1].changes[0].level = 5;
  record.at(10).decided({{kSlow, false, 6}});
  EXPECT_EQ(record.judged().violation_count, 1U);
}

TEST(KernelJudge, ALevelOfAJobWhoseBodyHasEndedMeansNothing) {
  Record record = inverted(7);
  record.at(50).decided({{kUrgent, false, 1}, {{3, 0}, true, 4}}).at(51).kernel(Kind::In, 0, 13);
  record.body({3, 0}, 13, 52, 95).beats(0, 13, 53, 90);
  EXPECT_EQ(record.judged().violation_count, 0U);
}

// The thread that decided has not yet carried out its decision.
TEST(KernelJudge, WhatIsNotCarriedOutYetIsNotJudged) {
  Record record = inverted(100);
  record.run().decisions.push_back({10 * kMillisecond, 99, {{kSlow, false, 6}}});
  EXPECT_EQ(record.judged().violation_count, 0U);
  record.run().bodies.push_back({{7, 7}, 99, 60 * kMillisecond, 61 * kMillisecond});  // it continues, too late
  record.run().decisions.push_back({59 * kMillisecond, 99, {{{7, 7}, true, 0}}});
  EXPECT_EQ(record.judged().violation_count, 0U);
}

TEST(KernelJudge, AJobThatSleepsDoesNotWait) {
  Record record = inverted(100);
  for (SwitchEvent &event : record.run().events) {
    if (event.thread == kUrgentThread && event.kind == Kind::Preempted) event.kind = Kind::Slept;
  }
  EXPECT_EQ(record.judged().violation_count, 0U);
}

TEST(KernelJudge, OneThatNoThreadBeginsIsSeen) {
  Record record(1);
  record.at(0).decided({{kSlow, true, 5}}).at(1).kernel(Kind::In, 0, kSlowThread);
  record.at(4).decided({{kUrgent, true, 2}}).beats(0, kSlowThread, 5, 40);
  record.body(kSlow, kSlowThread, 1, 41);
  EXPECT_EQ(record.judged().violation_count, 1U);
}

TEST(KernelJudge, AProcessorThatIdlesIsSeen) {
  Record record(2);
  record.at(0).decided({{kUrgent, true, 2}}).at(1).kernel(Kind::In, 0, kUrgentThread);
  record.at(2).kernel(Kind::Preempted, 0, kUrgentThread).kernel(Kind::In, 0, 77).beats(0, 77, 3, 40);
  record.body(kUrgent, kUrgentThread, 1, 45);
  record.beats(1, 78, 3, 40);
  EXPECT_EQ(record.judged().violation_count, 0U) << "somebody else's threads are none of ours";
  for (SwitchEvent &event : record.run().events) {
    if (event.cpu == 1) event.thread = 0;
  }
  EXPECT_EQ(record.judged().violation_count, 1U);
}

TEST(KernelJudge, ABodyThatWasNotToStartIsSeen) {
  Record record(1);
  record.body(kUrgent, kUrgentThread, 1, 45);
  EXPECT_EQ(record.judged().violation_count, 1U);
}

}  // namespace
}  // namespace redag::testing
