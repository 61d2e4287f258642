// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Tests the executor's parts that need no nodes: timer queue, release timer, token queue, hooks.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <deque>
#include <map>
#include <random>

#include "entities/hook.hpp"
#include "entities/token_queue.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag/threads/clock.hpp"
#include "release_timer.hpp"
#include "timer_queue.hpp"

namespace redag_rclcpp {
namespace {

using redag::kNever;
using redag::runtime::Release;
using ::testing::ElementsAre;

struct FakeTimer final : TimerQueue::Timer {
  Time expire(Time now, std::vector<Release> &releases, std::vector<Release> &) override {
    releases.push_back(Release{TaskId(id), now});
    return again;
  }
  std::uint32_t id = 0;
  Time again = kNever;
};

std::vector<std::uint32_t> expire(TimerQueue &queue, Time now) {
  std::vector<Release> releases;
  std::vector<Release> missed;
  queue.expire_due(now, releases, missed);
  std::vector<std::uint32_t> ids;
  for (const Release &release : releases) ids.push_back(release.task.value);
  return ids;
}

TEST(TimerQueue, ExpiresInOrderOfTime) {
  TimerQueue queue;
  FakeTimer timers[3];
  for (std::uint32_t i = 0; i < 3; ++i) timers[i].id = i;
  EXPECT_EQ(queue.next(), kNever);
  EXPECT_TRUE(queue.schedule(timers[0], 30'000));
  EXPECT_TRUE(queue.schedule(timers[1], 10'000));
  EXPECT_FALSE(queue.schedule(timers[2], 20'000));
  EXPECT_EQ(queue.next(), 10'000);
  EXPECT_THAT(expire(queue, 20'000), ElementsAre(1, 2));
  EXPECT_THAT(expire(queue, 29'999), ElementsAre());
  EXPECT_THAT(expire(queue, 40'000), ElementsAre(0));
  EXPECT_EQ(queue.next(), kNever);
}

TEST(TimerQueue, AnExpiryIsAlwaysLaterThanNow) {
  TimerQueue queue;
  FakeTimer timer;
  timer.again = 5;  // in the past
  queue.schedule(timer, 10);
  EXPECT_THAT(expire(queue, 10), ElementsAre(0));
  EXPECT_EQ(queue.next(), 11);
}

TEST(TimerQueue, AgreesWithASortedMap) {
  std::mt19937 random(7);
  TimerQueue queue;
  std::deque<FakeTimer> timers(60);
  std::map<std::uint32_t, Time> due;
  for (std::uint32_t i = 0; i < timers.size(); ++i) timers[i].id = i;
  Time now = 0;
  for (int step = 0; step < 20'000; ++step) {
    const std::uint32_t i = static_cast<std::uint32_t>(random() % timers.size());
    if (random() % 5 == 0) {
      queue.schedule(timers[i], kNever);
      due.erase(i);
    } else {
      const Time at = now + 1 + static_cast<Time>(random() % 1'000'000);
      queue.schedule(timers[i], at);
      // A due time that hardly differs counts as the same.
      const auto old = due.find(i);
      if (old == due.end() || std::abs(old->second - at) >= TimerQueue::kSame) due[i] = at;
    }
    if (random() % 4 != 0) continue;
    now += static_cast<Time>(random() % 200'000);
    std::vector<std::pair<Time, std::uint32_t>> expected;
    for (const auto &[id, at] : due) {
      if (at <= now) expected.emplace_back(at, id);
    }
    std::sort(expected.begin(), expected.end());
    std::vector<std::uint32_t> ids;
    for (const auto &[at, id] : expected) {
      ids.push_back(id);
      due.erase(id);
    }
    auto expired = expire(queue, now);
    std::sort(expired.begin(), expired.end());
    std::sort(ids.begin(), ids.end());
    ASSERT_EQ(expired, ids) << "step " << step;
    Time next = kNever;
    for (const auto &[id, at] : due) next = std::min(next, at);
    ASSERT_EQ(queue.next(), next) << "step " << step;
  }
}

// An idle thread of the engine releases in the place of the timer's thread, which is not started here.
TEST(ReleaseTimer, AnIdleThreadReleasesOnlyWhileItRuns) {
  constexpr Time kOrigin = 1000;
  redag::Workload workload;
  redag::Task &task = workload.dags.emplace_back().tasks.emplace_back();
  task.period = task.deadline = redag::kSecond;
  redag::runtime::EngineOptions options;
  options.config.workers = 1;
  redag::runtime::Engine engine(std::make_unique<redag::sched::PriorityScheduler>(workload, options.config), options);
  std::vector<redag::runtime::Body> bodies(1,
                                           [](const redag::runtime::Job &) { return redag::sched::Outcome::Finished; });
  engine.pause();
  engine.bind(workload, std::move(bodies));
  engine.set_origin(redag::runtime::monotonic_now() - redag::kSecond);
  ReleaseTimer timer(engine, kOrigin);
  FakeTimer fake;
  fake.again = 3600 * redag::kSecond;
  timer.queue().schedule(fake, 1);
  EXPECT_EQ(timer.thread().release_due(), kNever);
  EXPECT_EQ(engine.figures(TaskId(0)).jobs.released, 0u);
  timer.resume();
  EXPECT_EQ(timer.thread().release_due(), kOrigin + fake.again);
  EXPECT_EQ(engine.figures(TaskId(0)).jobs.released, 1u);
  EXPECT_EQ(timer.thread().release_due(), kOrigin + fake.again);
  EXPECT_EQ(engine.figures(TaskId(0)).jobs.released, 1u);
  fake.again = kNever;
  timer.queue().schedule(fake, kNever);
  EXPECT_EQ(timer.thread().release_due(), kNever);
}

TEST(TokenQueue, IsAFifoThatGrowsAndDropsFromTheMiddle) {
  std::mt19937 random(3);
  TokenQueue<int> queue;
  std::deque<int> expected;
  for (int step = 0; step < 20'000; ++step) {
    const auto kind = random() % 5;
    if (kind < 2) {
      queue.push(step);
      expected.push_back(step);
    } else if (!expected.empty() && kind < 4) {
      ASSERT_EQ(queue.front(), expected.front());
      ASSERT_EQ(queue.pop(), expected.front());
      expected.pop_front();
    } else if (!expected.empty()) {
      const std::size_t at = random() % expected.size();
      queue.erase(at);
      expected.erase(expected.begin() + static_cast<std::ptrdiff_t>(at));
    }
    ASSERT_EQ(queue.size(), expected.size());
    for (std::size_t i = 0; i < expected.size(); ++i) ASSERT_EQ(queue.at(i), expected[i]);
  }
}

// ---- hooks ----

/// A fake entity of the middleware. It can call its last hook after the hook was cleared, as a real one may during its
/// destruction.
struct FakeEntity {
  rcl_event_callback_t callback = nullptr;
  const void *ticket = nullptr;
  rcl_event_callback_t last_callback = nullptr;
  const void *last_ticket = nullptr;
  rcl_ret_t answer = RCL_RET_OK;

  static rcl_ret_t set_hook(FakeEntity &self, rcl_event_callback_t callback, const void *ticket) {
    self.callback = callback;
    self.ticket = ticket;
    if (callback != nullptr) {
      self.last_callback = callback;
      self.last_ticket = ticket;
    }
    return self.answer;
  }
  void call_late() const { last_callback(last_ticket, 1); }
};

struct FakeHooked final : Hooked {
  void arrived_in_middleware(std::size_t count) noexcept override { arrived += count; }
  std::size_t arrived = 0;
};

struct Hooks : ::testing::Test {
  std::shared_ptr<FakeEntity> entity = std::make_shared<FakeEntity>();
  std::shared_ptr<FakeHooked> hooked = std::make_shared<FakeHooked>();
  Hook hook;
};

TEST_F(Hooks, TellUntilTheyAreCleared) {
  hook.set(entity, FakeEntity::set_hook, hooked);
  entity->callback(entity->ticket, 3);
  EXPECT_EQ(hooked->arrived, 3u);
  hook.clear();
  EXPECT_EQ(entity->callback, nullptr);
  entity->call_late();
  EXPECT_EQ(hooked->arrived, 3u);
}

TEST_F(Hooks, ALateCallFindsNobodyAlsoWhereAnotherTookThePlace) {
  hook.set(entity, FakeEntity::set_hook, hooked);
  hook.clear();
  const auto next_entity = std::make_shared<FakeEntity>();
  const auto next = std::make_shared<FakeHooked>();
  Hook next_hook;
  next_hook.set(next_entity, FakeEntity::set_hook, next);
  const auto place = [](const FakeEntity &e) {
    return static_cast<std::uint32_t>(reinterpret_cast<std::uintptr_t>(e.last_ticket));
  };
  ASSERT_EQ(place(*entity), place(*next_entity));
  entity->call_late();
  EXPECT_EQ(next->arrived, 0u);
  next_entity->callback(next_entity->ticket, 1);
  EXPECT_EQ(next->arrived, 1u);
}

TEST_F(Hooks, OutliveTheirEntityAndWhoIsTold) {
  hook.set(entity, FakeEntity::set_hook, hooked);
  const auto late = *entity;
  hooked = nullptr;
  late.call_late();
  entity = nullptr;
  EXPECT_NO_THROW(hook.clear());
  late.call_late();
}

TEST_F(Hooks, OneThatTheMiddlewareRefusesThrowsAndTellsNobody) {
  entity->answer = RCL_RET_UNSUPPORTED;
  EXPECT_ANY_THROW(hook.set(entity, FakeEntity::set_hook, hooked));
  hook.clear();
  entity->call_late();
  EXPECT_EQ(hooked->arrived, 0u);
}

}  // namespace
}  // namespace redag_rclcpp
