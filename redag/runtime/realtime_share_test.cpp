// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/realtime_share.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <deque>
#include <utility>
#include <vector>

#include "redag/base/rng.hpp"

namespace redag::runtime {
namespace {

constexpr Throttling kDefault{950'000, 1'000'000};

// Models a processor with one thread that always wants to run at real-time priority, and does while the share is not
// used up. Other threads run now and then, whatever credit is left. The guard looks up to `lateness` late.
struct Processor {
  Processor(const Throttling &throttling, std::uint64_t seed)
      : share(throttling), period(throttling.period_us * kMicrosecond), rng(seed) {}

  // `urgent`: the part of the time that the other threads use, in pieces of up to `piece`.
  void run(Duration length, double urgent, Duration piece, Duration lateness) {
    Time next_look = 0;
    Time next_urgent = 0;
    Time urgent_until = 0;
    bool gives_way = false;
    while (now < length) {
      if (now >= next_urgent) {
        const Duration size = rng.uniform(1, piece);
        urgent_until = now + size;
        next_urgent = now + std::max(size + 1, static_cast<Duration>(static_cast<double>(size) / urgent));
      }
      if (now >= next_look) {
        changes += share.used_up(now) == gives_way ? 0 : 1;
        gives_way = share.used_up(now);
        next_look = now + share.until_change() + rng.uniform(0, lateness);
      }
      const bool busy = !gives_way || now < urgent_until;
      share.set_busy(busy, now);
      Time next = std::min(next_look, next_urgent);
      if (now < urgent_until) next = std::min(next, urgent_until);
      spend(next, busy);
    }
  }

  void spend(Time next, bool busy) {
    if (busy) {
      used += next - now;
      pieces.emplace_back(now, next);
      in_window += next - now;
    }
    now = next;
    // Use before the last period no longer counts.
    while (!pieces.empty() && pieces.front().first < now - period) {
      auto &[from, to] = pieces.front();
      const Time cut = std::min(to, now - period);
      in_window -= cut - from;
      from = cut;
      if (from == to)
        pieces.pop_front();
      else
        break;
    }
    most = std::max(most, in_window);
  }

  RealtimeShare share;
  Duration period;
  Rng rng;
  Time now = 0;
  Duration used = 0;
  int changes = 0;
  Duration most = 0;  // in any period
  Duration in_window = 0;
  std::deque<std::pair<Time, Time>> pieces;
};

TEST(RealtimeShare, OneThatAlwaysWantsToRunGetsNearlyWhatTheKernelLeaves) {
  Processor processor(kDefault, 1);
  processor.run(60 * kSecond, 1e-9, 1, 0);
  EXPECT_LE(processor.most, 950 * kMillisecond);
  EXPECT_GT(processor.used, 60 * kSecond * 91 / 100);
  EXPECT_LT(processor.changes, 1000);
}

TEST(RealtimeShare, IsNotUsedUpByWhatIsIdleNowAndThen) {
  RealtimeShare share(kDefault);
  for (Time now = 0; now < 20 * kSecond; now += 10 * kMillisecond) {
    share.set_busy(true, now);
    EXPECT_FALSE(share.used_up(now + 9 * kMillisecond));
    share.set_busy(false, now + 9 * kMillisecond);
  }
}

TEST(RealtimeShare, IsUsedUpUntilHalfOfItIsThereAgain) {
  RealtimeShare share(kDefault);  // 20 ms of credit; 920 of 1000 ms are refilled
  share.set_busy(true, 0);
  EXPECT_FALSE(share.used_up(249 * kMillisecond));
  EXPECT_TRUE(share.used_up(251 * kMillisecond));
  share.set_busy(false, 251 * kMillisecond);
  EXPECT_TRUE(share.used_up(260 * kMillisecond));
  EXPECT_NEAR(static_cast<double>(share.until_change()), 2e6, 1e6);
  EXPECT_FALSE(share.used_up(263 * kMillisecond));
}

// One of the processors is busy all the time, but none for long: the kernel throttles none of them.
TEST(RealtimeShare, EachProcessorCountsByItself) {
  RealtimeShare share(kDefault, 2);
  for (Time now = 0; now < 20 * kSecond; now += 20 * kMillisecond) {
    share.set_busy(std::vector<bool>{true, false}, now);
    EXPECT_FALSE(share.used_up(now + 10 * kMillisecond));
    share.set_busy(std::vector<bool>{false, true}, now + 10 * kMillisecond);
    EXPECT_FALSE(share.used_up(now + 20 * kMillisecond));
  }
}

TEST(RealtimeShare, OneProcessorIsEnoughToUseItUp) {
  RealtimeShare share(kDefault, 3);  // 20 ms of credit; 920 of 1000 ms are refilled
  share.set_busy(std::vector<bool>{false, true, false}, 0);
  EXPECT_EQ(share.until_change(), 250 * kMillisecond);
  EXPECT_FALSE(share.used_up(249 * kMillisecond));
  EXPECT_TRUE(share.used_up(251 * kMillisecond));
  share.set_busy(std::vector<bool>{false, false, false}, 251 * kMillisecond);
  EXPECT_TRUE(share.used_up(255 * kMillisecond));
  EXPECT_FALSE(share.used_up(263 * kMillisecond));
}

// A thread was seen on another processor in between. That processor is charged, too.
TEST(RealtimeShare, WhereAThreadMovedToIsCharged) {
  RealtimeShare share(kDefault, 2);
  share.set_busy(std::vector<bool>{true, false}, 0);
  share.ran_on(1);
  share.set_busy(std::vector<bool>{false, true}, 200 * kMillisecond);
  EXPECT_FALSE(share.used_up(240 * kMillisecond));
  EXPECT_TRUE(share.used_up(260 * kMillisecond));
  RealtimeShare unknown(kDefault, 2);
  unknown.ran_everywhere();
  EXPECT_TRUE(unknown.used_up(260 * kMillisecond));
}

TEST(RealtimeShare, NothingIsOwedForLongerThanAPeriod) {
  RealtimeShare share(kDefault);
  share.set_busy(true, 0);
  EXPECT_TRUE(share.used_up(3600 * kSecond));
  share.set_busy(false, 3600 * kSecond);
  EXPECT_FALSE(share.used_up(3602 * kSecond));
}

TEST(RealtimeShare, WhereTheKernelLeavesNothingItIsAlwaysUsedUp) {
  RealtimeShare share(Throttling{0, 1'000'000});
  for (Time now = 0; now < 10 * kSecond; now += 100 * kMillisecond) {
    share.set_busy(now % kSecond == 0, now);
    EXPECT_TRUE(share.used_up(now));
    EXPECT_GT(share.until_change(), 0);
  }
}

TEST(RealtimeShare, TimeThatGoesBackIsNone) {
  RealtimeShare share(kDefault);
  share.set_busy(true, kSecond / 10);
  share.set_busy(true, 0);
  EXPECT_FALSE(share.used_up(kSecond / 5));
  share.set_busy(true, 0);
  EXPECT_TRUE(share.used_up(kSecond / 2));
}

RC_GTEST_PROP(RealtimeShare, TheKernelHasNothingToTake, ()) {
  const auto period_us = *rc::gen::inRange<std::int64_t>(10'000, 2'000'000);
  const Throttling throttling{*rc::gen::inRange<std::int64_t>(period_us / 2, period_us - period_us / 200), period_us};
  const Duration runtime = throttling.runtime_us * kMicrosecond;
  const Duration period = period_us * kMicrosecond;
  const Duration kept = period - runtime;
  Processor processor(throttling, *rc::gen::arbitrary<std::uint64_t>());
  // The thread that runs whatever credit is left must leave room itself. A piece of it can begin with no credit left.
  const Duration room = std::min(10 * kMillisecond, kept / 5);
  const double left = static_cast<double>(runtime - 3 * room) / static_cast<double>(period);
  processor.run(20 * period, *rc::gen::inRange(1, 90) / 100.0 * left, room / 2, room / 2);
  RC_ASSERT(processor.most <= runtime);
}

}  // namespace
}  // namespace redag::runtime
