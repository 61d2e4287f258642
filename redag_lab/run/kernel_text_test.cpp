// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/run/kernel_text.hpp"

#include <gtest/gtest.h>

namespace redag::lab {
namespace {

// As Linux 6 writes it, with a thread that has a difficult name.
constexpr std::string_view kText =
    "# tracer: nop\n"
    "          <idle>-0       [001] d..2.   100.000001: sched_switch: prev_comm=swapper/1 prev_pid=0 prev_prio=120 "
    "prev_state=R ==> next_comm=redag-0 next_pid=77 next_prio=48\n"
    "         redag-0-77      [001] d.h1.   100.000010: irq_handler_entry: irq=25 name=virtio0-req.0\n"
    "         redag-0-77      [001] d.h1.   100.000012: irq_handler_exit: irq=25 ret=handled\n"
    "         redag-0-77      [001] ..s1.   100.000020: softirq_entry: vec=1 [action=TIMER]\n"
    "         redag-0-77      [001] ..s1.   100.000021: softirq_exit: vec=1 [action=TIMER]\n"
    "         redag-0-77      [001] d..2.   100.000030: sched_switch: prev_comm=redag-0 prev_pid=77 prev_prio=48 "
    "prev_state=R+ ==> next_comm=a next_pid=1 x next_pid=99 next_prio=9\n"
    "CPU:1 [LOST 12 EVENTS]\n"
    " a next_pid=1 x-99      [001] d..2.   100.000040: sched_switch: prev_comm=a next_pid=1 x prev_pid=99 prev_prio=9 "
    "prev_state=S ==> next_comm=redag-0 next_pid=77 next_prio=48\n";

constexpr Time kZero = 100 * kSecond;

const std::vector<metrics::KernelRow> kRows = {
    metrics::KernelThread{77, "redag-0", 0},
    metrics::KernelThread{99, "a next_pid=1 x", 0},
    metrics::KernelLoss{12},
    metrics::KernelSwitch{kZero + 1000, 1, 0, true, 77, 48},
    metrics::KernelInterrupt{kZero + 10'000, kZero + 12'000, 1, "virtio0-req.0"},
    metrics::KernelInterrupt{kZero + 20'000, kZero + 21'000, 1, "softirq TIMER"},
    metrics::KernelSwitch{kZero + 30'000, 1, 77, true, 99, 9},
    metrics::KernelSwitch{kZero + 40'000, 1, 99, false, 77, 48}};

TEST(KernelText, ReadsSwitchesInterruptsAndLosses) {
  KernelText text;
  text.add(kText);
  EXPECT_EQ(text.take(kNever), kRows);
  EXPECT_TRUE(text.take(kNever).empty());
}

TEST(KernelText, TakesLinesInPieces) {
  KernelText text;
  for (const char c : kText) text.add(std::string_view(&c, 1));
  EXPECT_EQ(text.take(kNever), kRows);
}

TEST(KernelText, HoldsLaterEventsBack) {
  KernelText text;
  text.add(kText);
  EXPECT_EQ(text.take(kZero + 12'000).size(), 4U);
  const std::vector<metrics::KernelRow> rest = text.take(kNever);
  EXPECT_EQ(rest, std::vector<metrics::KernelRow>(kRows.begin() + 4, kRows.end()));
}

TEST(KernelText, AnEventThatComesTooLateIsLost) {
  KernelText text;
  static_cast<void>(text.take(kZero + 20'000));
  text.add(kText);
  const std::vector<metrics::KernelRow> rows = text.take(kNever);
  ASSERT_EQ(rows.size(), 6U);
  EXPECT_EQ(rows[2], metrics::KernelRow(metrics::KernelLoss{14}));
}

TEST(KernelText, IgnoresWhatItDoesNotKnow) {
  // Each line without one of its characters is read or ignored, and breaks nothing.
  for (std::size_t i = 0; i < kText.size(); ++i) {
    KernelText text;
    std::string damaged(kText);
    damaged.erase(i, 1);
    text.add(damaged);
    EXPECT_LE(text.take(kNever).size(), 9U);
  }
}

}  // namespace
}  // namespace redag::lab
