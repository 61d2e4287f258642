// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/robot/reservation.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <functional>
#include <vector>

#include "redag/derived/rng.hpp"
#include "tests/testing/random_workloads.hpp"

namespace redag::robot {
namespace {

using testing::between;
using testing::chance;

// A thread with a reservation as Linux runs it (kernel/sched/deadline.c), in steps of one unit of time. It has a
// processor whenever it may run. Its budget is checked at ticks and when it blocks.
class Server {
 public:
  /// `tick` 1: the budget is checked at each step.
  Server(Reservation reservation, Duration tick, Duration phase) : r_(reservation), tick_(tick), phase_(phase) {}

  /// Lets one unit pass. Returns true if the thread has executed.
  bool step() {
    if (throttled_ && now_ >= deadline_) replenish();
    const bool runs = ready_ && !throttled_;
    if (runs) --left_;
    ++now_;
    if (runs && left_ <= 0 && (now_ + phase_) % tick_ == 0) exhaust();
    return runs;
  }
  void block() {
    ready_ = false;
    if (!throttled_ && left_ <= 0) exhaust();
  }
  void wake() {
    ready_ = true;
    if (throttled_) return;
    const bool overflows = left_ * r_.period > (deadline_ - now_) * r_.budget;
    if (deadline_ <= now_ || overflows) begin_anew();
  }
  [[nodiscard]] bool is_ready() const { return ready_; }
  [[nodiscard]] bool is_throttled() const { return throttled_; }
  [[nodiscard]] Duration left() const { return left_; }
  [[nodiscard]] Duration now() const { return now_; }
  [[nodiscard]] Duration deadline() const { return deadline_; }

 private:
  void begin_anew() {
    deadline_ = now_ + r_.period;
    left_ = r_.budget;
  }
  void exhaust() {
    throttled_ = true;
    if (now_ >= deadline_) replenish();
  }
  void replenish() {
    throttled_ = false;
    while (left_ <= 0) {
      deadline_ += r_.period;
      left_ += r_.budget;
    }
    if (deadline_ < now_) begin_anew();
  }

  Reservation r_;
  Duration tick_;
  Duration phase_;
  Duration now_ = 0;
  Duration deadline_ = 0;
  Duration left_ = 0;
  bool ready_ = false;
  bool throttled_ = false;
};

// The most by which execution in an interval exceeds `share` of it, times the period: a maximum over all intervals.
Duration largest_excess(const std::vector<bool> &executed, const Reservation &r) {
  Duration most = 0;
  Duration here = 0;
  for (const bool each : executed) {
    here = std::max<Duration>(0, here + (each ? r.period : 0) - r.budget);
    most = std::max(most, here);
  }
  return most;
}

// What the task executes at most in an interval of this length.
Duration interference(const ReservedLoad &load, Duration length) {
  const Duration reach = length + load.jitter;
  return reach / load.period * load.wcet + std::min(load.wcet, reach % load.period);
}

std::vector<bool> random_run(Rng &rng, Server &server, std::size_t steps) {
  std::vector<bool> executed;
  const double blocks = 0.5 * rng.uniform01() * rng.uniform01();
  const double wakes = rng.uniform01();
  const bool waits_for_reset = chance(rng, 0.5);  // a thread that knows when the kernel gives it a whole budget
  while (executed.size() < steps) {
    if (!server.is_ready()) {
      if (chance(rng, wakes)) server.wake();
    } else if (waits_for_reset && server.left() > 0 && server.deadline() - server.now() <= server.left()) {
      server.block();
      server.wake();
    } else if (!server.is_throttled() && chance(rng, blocks)) {
      server.block();
    }
    executed.push_back(server.step());
  }
  return executed;
}

RC_GTEST_PROP(Reservation, NoThreadExecutesMoreThanTheTaskThatStandsForIt, ()) {
  Rng rng(*rc::gen::arbitrary<std::uint64_t>());
  for (int i = 0; i < 20; ++i) {
    Reservation r;
    r.period = between(rng, 2, 60);
    r.budget = between(rng, 1, static_cast<std::uint32_t>(r.period));
    const Duration tick = chance(rng, 0.3) ? 1 : between(rng, 1, 40);
    r.tick = tick == 1 ? 0 : tick;
    Server server(r, tick, between(rng, 0, static_cast<std::uint32_t>(tick)));
    const std::vector<bool> executed = random_run(rng, server, 2000);
    const Duration burst = (r.period - r.budget) * r.budget + (2 * r.period - r.budget) * r.tick;
    RC_ASSERT(largest_excess(executed, r) <= burst);

    const ReservedLoad load = load_of(r);
    RC_ASSERT(load.wcet > 0 && load.jitter + load.wcet <= load.period);
    RC_ASSERT(load.wcet * r.period == load.period * r.budget);
    for (Duration length = 0; length < 3 * load.period; length += 1 + load.period / 50) {
      const Duration most = std::min(length, (length * r.budget + burst) / r.period);
      RC_ASSERT(interference(load, length) >= most);
    }
  }
}

// Why the tick counts: the kernel does not see that the budget is used up until then.
TEST(Reservation, AThreadRunsOnUntilTheTick) {
  const Reservation r{.budget = 2, .period = 10, .tick = 4};
  Server server(r, r.tick, 0);
  for (int i = 0; i < 4; ++i) EXPECT_FALSE(server.step());
  server.wake();
  int busy = 0;
  while (server.step()) ++busy;
  EXPECT_EQ(busy, 4);
  while (server.now() < 14) EXPECT_FALSE(server.step()) << "until the deadline";
  while (server.step()) ++busy;
  EXPECT_EQ(busy, 6) << "it has executed 4 in one period, and 2 from the next one";
}

TEST(Reservation, CountsTheKernelsTick) {
  const ReservedLoad exact = load_of({.budget = 2 * kMillisecond, .period = 10 * kMillisecond, .tick = 0});
  EXPECT_EQ(exact.wcet, 2 * kMillisecond);
  EXPECT_EQ(exact.period, 10 * kMillisecond);
  EXPECT_EQ(exact.jitter, 8 * kMillisecond);
  const ReservedLoad coarse =
      load_of({.budget = 2 * kMillisecond, .period = 10 * kMillisecond, .tick = 4 * kMillisecond});
  EXPECT_EQ(coarse.wcet, 12 * kMillisecond);
  EXPECT_EQ(coarse.period, 60 * kMillisecond);
  EXPECT_EQ(coarse.jitter, 44 * kMillisecond);
  const ReservedLoad whole =
      load_of({.budget = 10 * kMillisecond, .period = 10 * kMillisecond, .tick = 4 * kMillisecond});
  EXPECT_EQ(whole.wcet, whole.period);
  EXPECT_EQ(whole.jitter, 0);
}

TEST(Reservation, TheLongestTimesDoNotOverflow) {
  for (const Duration budget : {Duration{1024}, 2 * kSecond, 4 * kSecond - 1}) {
    const ReservedLoad load = load_of({.budget = budget, .period = 4 * kSecond, .tick = 10 * kMillisecond});
    EXPECT_GE(load.jitter, 0);
    EXPECT_LE(load.jitter + load.wcet, load.period);
  }
}

}  // namespace
}  // namespace redag::robot
