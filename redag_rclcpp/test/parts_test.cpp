// The executor's parts that need no ROS: timer queue, token queue.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <deque>
#include <map>
#include <random>

#include "timer_queue.hpp"
#include "token_queue.hpp"

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
      // A time that hardly differs is the same one.
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

}  // namespace
}  // namespace redag_rclcpp
