// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/why/kernel_record.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace redag::metrics {
namespace {

constexpr Time kZero = 100 * kSecond;

struct Read {
  std::vector<KernelRow> rows;
  std::uint64_t lost = 0;
};

Read read(std::string text) {
  Read all;
  KernelReader reader = KernelRecord::of(std::move(text), kZero).read().value();
  while (std::optional<KernelRow> row = reader.next().value()) all.rows.push_back(*std::move(row));
  all.lost = reader.lost();
  return all;
}

// As Linux 6 writes it, with a thread that has a difficult name.
constexpr std::string_view kTracefs =
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

TEST(KernelRecord, ReadsTracefs) {
  const std::vector<KernelRow> rows = {
      KernelSwitch{1000, 1, 0, true, 77, 48, "redag-0"}, KernelInterrupt{10'000, 12'000, 1, "virtio0-req.0"},
      KernelInterrupt{20'000, 21'000, 1, "softirq TIMER"}, KernelSwitch{30'000, 1, 77, true, 99, 9, "a next_pid=1 x"},
      KernelSwitch{40'000, 1, 99, false, 77, 48, "redag-0"}};
  const Read all = read(std::string(kTracefs));
  EXPECT_EQ(all.rows, rows);
  EXPECT_EQ(all.lost, 12U);
}

TEST(KernelRecord, ReadsTraceCmd) {
  const Read all = read(
      "cpus=2\n"
      "          <idle>-0     [001]   100.000001: sched_switch:         swapper/1:0 [120] R ==> redag-0:77 [48]\n"
      "CPU:1 [3 EVENTS DROPPED]\n"
      "         redag-0-77    [001]   100.000010123: irq_handler_entry:    irq=25 name=eth0\n"
      "         redag-0-77    [001]   100.000012123: irq_handler_exit:     irq=25 ret=handled\n"
      "         redag-0-77    [001]   100.000030: sched_switch:         redag-0:77 [48] S ==> a: [1] b:99 [120]\n");
  const std::vector<KernelRow> rows = {KernelSwitch{1000, 1, 0, true, 77, 48, "redag-0"},
                                       KernelInterrupt{10'123, 12'123, 1, "eth0"},
                                       KernelSwitch{30'000, 1, 77, false, 99, 120, "a: [1] b"}};
  EXPECT_EQ(all.rows, rows);
  EXPECT_EQ(all.lost, 3U);
}

TEST(KernelRecord, ReadsPerfAndLeavesOutWhatIsNotInOrder) {
  const Read all = read(
      "swapper     0 [000]   100.000001: sched:sched_switch: prev_comm=swapper/0 prev_pid=0 prev_prio=120 prev_state=R "
      "==> next_comm=redag-0 next_pid=77 next_prio=48\n"
      "redag-0    77 [000]   100.000010: irq:softirq_entry: vec=9 [action=RCU]\n"
      "redag-0    77 [000]   100.000012: irq:softirq_exit: vec=9 [action=RCU]\n"
      "redag-0    77 [000]    99.000000: sched:sched_switch: prev_comm=redag-0 prev_pid=77 prev_prio=48 prev_state=S "
      "==> next_comm=swapper/0 next_pid=0 next_prio=120\n");
  const std::vector<KernelRow> rows = {KernelSwitch{1000, 0, 0, true, 77, 48, "redag-0"},
                                       KernelInterrupt{10'000, 12'000, 0, "softirq RCU"}};
  EXPECT_EQ(all.rows, rows);
  EXPECT_EQ(all.lost, 1U);
}

TEST(KernelRecord, IgnoresWhatItDoesNotKnow) {
  // Each line without one of its characters is read or ignored, and breaks nothing.
  for (std::size_t i = 0; i < kTracefs.size(); ++i) {
    std::string damaged(kTracefs);
    damaged.erase(i, 1);
    EXPECT_LE(read(damaged).rows.size(), 5U);
  }
  EXPECT_TRUE(read(std::string(200'000, 'x')).rows.empty());
}

TEST(KernelRecord, WhatTheSystemRefusesIsAnError) { EXPECT_FALSE(KernelRecord::open("/nonexistent/kernel.txt", 0)); }

}  // namespace
}  // namespace redag::metrics
