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

void expect_all(const metrics::KernelRecord &record) {
  const std::vector<metrics::KernelSwitch> switches = {
      {1000, 1, 0, true, 77, 48}, {30'000, 1, 77, true, 99, 9}, {40'000, 1, 99, false, 77, 48}};
  const std::vector<metrics::KernelInterrupt> interrupts = {{10'000, 12'000, 1, "virtio0-req.0"},
                                                            {20'000, 21'000, 1, "softirq TIMER"}};
  EXPECT_EQ(record.switches, switches);
  EXPECT_EQ(record.interrupts, interrupts);
  EXPECT_EQ(record.names, (std::map<int, std::string>{{77, "redag-0"}, {99, "a next_pid=1 x"}}));
  EXPECT_EQ(record.lost, 12U);
}

TEST(KernelText, ReadsSwitchesInterruptsAndLosses) {
  KernelText text;
  text.add(kText);
  expect_all(text.take(100 * kSecond));
}

TEST(KernelText, TakesLinesInPieces) {
  KernelText text;
  for (const char c : kText) text.add(std::string_view(&c, 1));
  expect_all(text.take(100 * kSecond));
}

TEST(KernelText, IgnoresWhatItDoesNotKnow) {
  // Each line without one of its characters is read or ignored, and breaks nothing.
  for (std::size_t i = 0; i < kText.size(); ++i) {
    KernelText text;
    std::string damaged(kText);
    damaged.erase(i, 1);
    text.add(damaged);
    const metrics::KernelRecord record = text.take(0);
    EXPECT_LE(record.switches.size(), 3U);
    EXPECT_LE(record.interrupts.size(), 2U);
  }
}

}  // namespace
}  // namespace redag::lab
