// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

#include "redag/sched/lifecycle_rules.hpp"
#include "tests/testing/builders.hpp"

namespace redag::sched {
namespace {

using testing::make_dag;
using testing::make_workload;

// Takes no decisions.
struct Idle {
  static constexpr bool kEnforcesLimits = true;

  explicit Idle(JobTable & /*table*/) {}
  void on_ready(std::uint32_t /*slot*/) {}
  void on_withdrawn(std::uint32_t /*slot*/) {}
  void on_end(std::uint32_t /*slot*/) {}
  void on_lowered(std::uint32_t /*slot*/) {}
  void on_reconfigured() {}
  void on_preemption_point(std::uint32_t /*slot*/) {}
  void decide(std::uint32_t /*most*/) {}
  [[nodiscard]] bool outranked(const Job & /*job*/) const { return false; }
  [[nodiscard]] bool is_idle() const { return true; }
};

// At 1 kHz, job numbers wrap around after 49 days and 17 hours.
TEST(Lifecycle, AfterTheLastNumberComesTheFirst) {
  constexpr std::uint64_t kNumbers = std::uint64_t{1} << 32U;
  constexpr std::uint64_t kBefore = 2;
  Lifecycle<Idle> counter(make_workload({make_dag("d", {{"t", 10, 5}})}, 1, PreemptionMode::None), Config{});
  counter.table().tasks[0].released = kNumbers - kBefore;
  std::vector<std::uint32_t> numbers;
  for (Time now = 1; now <= 4; ++now) {
    counter.miss(TaskId(0), now, now, Reason::Overrun);
    for (const JobEvent &event : counter.dispatch(now, 1).events) {
      if (event.kind == JobEventKind::Skipped) numbers.push_back(event.job);
    }
  }
  EXPECT_EQ(numbers, (std::vector<std::uint32_t>{0xfffffffe, 0xffffffff, 0, 1}));
  EXPECT_EQ(counter.accounting(TaskId(0)).released, kNumbers - kBefore + 4);
  EXPECT_EQ(counter.accounting(TaskId(0)).skipped, 4U);
}

}  // namespace
}  // namespace redag::sched
