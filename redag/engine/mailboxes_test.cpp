// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/engine/mailboxes.hpp"

#include <gtest/gtest.h>

namespace redag::runtime {
namespace {

// Threads that were never started: what they are told stays in their parkers.
class MailboxesTest : public ::testing::Test {
 protected:
  explicit MailboxesTest(std::uint32_t threads = 4) : pool_(threads, 0), mailboxes_(threads, &lookout_, true) {
    for (std::uint32_t t = threads; t-- > 0;) mailboxes_.add_idle(pool_[t]);
    for (int i = 0; i < 8; ++i) tiny_.count(0, TaskEntry::kTiny);
    for (int i = 0; i < 8; ++i) other_.count(0, TaskEntry::kTiny + 1);
  }

  /// Returns the thread that has got the job.
  WorkerThread &post(const TaskEntry &entry, std::uint32_t level = 0, Time now = 0, int here = -1,
                     Sender sender = nullptr) {
    WorkerThread *got = nullptr;
    mailboxes_.post(entry, now, here, sender, wake_ups_, [&](WorkerThread &thread) {
      thread.level = level;
      got = &thread;
    });
    return *got;
  }
  /// Two wake-ups that mail could have done without, one soon after the other: mail is silent from now on.
  void make_busy() {
    mailboxes_.begin(running_, tiny_);
    take(post(tiny_));
    take(post(tiny_));
    ASSERT_TRUE(was_woken(lookout_));
  }
  /// The thread takes its mail, ends its job and is idle again.
  void take(WorkerThread &thread) {
    ASSERT_TRUE(thread.take_mail());
    was_woken(thread.parker);
    mailboxes_.add_idle(thread);
  }
  /// Takes the token.
  static bool was_woken(Parker &parker) {
    const bool woken = parker.spin(1);
    if (woken) parker.park();
    return woken;
  }
  static bool was_woken(WorkerThread &thread) { return was_woken(thread.parker); }
  bool look() {
    WakeUps wake_ups(true);
    return mailboxes_.look(wake_ups);
  }

  Parker lookout_;
  WorkerPool pool_;
  Mailboxes mailboxes_;
  WakeUps wake_ups_{true};
  WorkerThread running_{4, 0};
  TaskEntry tiny_;
  TaskEntry other_;
};

TEST_F(MailboxesTest, PrefersAThreadOnTheProcessorOfTheCaller) {
  constexpr std::uint32_t kHere = 5;
  constexpr std::uint32_t kElsewhere = 6;
  for (std::uint32_t t = 0; t < 4; ++t) pool_[t].processor = t % 2 == 1 ? &kHere : &kElsewhere;
  EXPECT_EQ(&post(other_, 0, 0, 5), &pool_[1]);
  EXPECT_FALSE(was_woken(pool_[1])) << "it would preempt the caller, which has the lock";
  wake_ups_.wake_late();
  EXPECT_TRUE(was_woken(pool_[1]));
  EXPECT_EQ(&post(other_, 0, 0, -1), &pool_[0]) << "the one that became idle last";
  EXPECT_EQ(&post(other_, 0, 0, 7), &pool_[2]) << "none is there";
  EXPECT_EQ(&post(other_, 0, 0, 5), &pool_[3]);
}

TEST_F(MailboxesTest, MailWakesItsThread) {
  EXPECT_TRUE(was_woken(post(other_)));
  EXPECT_TRUE(was_woken(post(tiny_)));
  EXPECT_FALSE(was_woken(lookout_));
}

// The engine asks any(): the thread's next job is not charged for what it took to wake another thread.
TEST_F(MailboxesTest, ThatTheLookoutWasWokenIsTold) {
  mailboxes_.begin(running_, tiny_);
  take(post(tiny_));
  wake_ups_ = WakeUps(true);
  EXPECT_FALSE(was_woken(post(tiny_)));
  EXPECT_TRUE(was_woken(lookout_));
  EXPECT_TRUE(wake_ups_.any());
  wake_ups_ = WakeUps(true);
  EXPECT_FALSE(was_woken(post(tiny_)));
  EXPECT_FALSE(wake_ups_.any());
}

TEST_F(MailboxesTest, TinyJobsArePostedSilentlyWhileOneRunsAndWakeUpsAreFrequent) {
  mailboxes_.begin(running_, tiny_);
  EXPECT_TRUE(was_woken(post(tiny_, 0, 0)));
  EXPECT_TRUE(was_woken(post(tiny_, 0, kMillisecond))) << "a wake-up now and then costs little";
  EXPECT_FALSE(was_woken(lookout_));
  EXPECT_FALSE(was_woken(post(tiny_, 0, kMillisecond + kMicrosecond)));
  EXPECT_TRUE(was_woken(lookout_));
  EXPECT_TRUE(was_woken(post(other_, 0, kMillisecond + kMicrosecond))) << "it is no tiny job";
}

TEST_F(MailboxesTest, WhatAJobReleasesShortlyBeforeItsEndIsLeftToItsThread) {
  take(post(other_, 0, 0, -1, &running_));
  WorkerThread &silent = post(other_, 7, kMicrosecond, -1, &running_);
  EXPECT_FALSE(was_woken(silent));
  EXPECT_TRUE(was_woken(lookout_)) << "the job can take longer than expected";
  EXPECT_TRUE(mailboxes_.any_silent());
  mailboxes_.settle(wake_ups_);
  EXPECT_FALSE(was_woken(silent)) << "the sender looks for it";
  WorkerThread &other = post(other_, 8, kMicrosecond, -1, &running_);
  mailboxes_.end(running_);
  EXPECT_EQ(mailboxes_.steal(sched::kNoLimit), &silent);
  mailboxes_.settle(wake_ups_);
  EXPECT_TRUE(was_woken(other)) << "the sender has a job again";
}

TEST_F(MailboxesTest, AJobThatWaitsForADecisionIsLookedAfter) {
  EXPECT_FALSE(mailboxes_.defer(0, wake_ups_)) << "a wake-up now and then costs little";
  EXPECT_TRUE(mailboxes_.defer(kMicrosecond, wake_ups_));
  EXPECT_TRUE(was_woken(lookout_));
  EXPECT_FALSE(mailboxes_.take_deferred()) << "it has not waited for a whole interval";
  EXPECT_TRUE(look());
  EXPECT_TRUE(mailboxes_.take_deferred());
  EXPECT_FALSE(mailboxes_.take_deferred());
  EXPECT_FALSE(look());
}

TEST_F(MailboxesTest, NothingIsSilentWhileNoTinyJobRuns) {
  make_busy();
  mailboxes_.end(running_);
  EXPECT_TRUE(was_woken(post(tiny_)));
  mailboxes_.begin(running_, other_);
  EXPECT_TRUE(was_woken(post(tiny_)));
}

TEST_F(MailboxesTest, SilentMailIsStolenByLevelAndAge) {
  make_busy();
  post(tiny_, 3);
  WorkerThread &first = post(tiny_, 2);
  WorkerThread &second = post(tiny_, 2);
  EXPECT_EQ(mailboxes_.steal(1), nullptr);
  EXPECT_EQ(mailboxes_.steal(2), &first) << "an equal job that was posted earlier goes first";
  EXPECT_EQ(mailboxes_.steal(3), &second);
  EXPECT_FALSE(second.take_mail());
}

TEST_F(MailboxesTest, MailThatHasWokenItsThreadIsStolenOnlyByLevel) {
  post(other_, 2);
  EXPECT_EQ(mailboxes_.steal(2), nullptr);
  EXPECT_NE(mailboxes_.steal(3), nullptr);
  EXPECT_EQ(mailboxes_.steal(3), nullptr);
}

TEST_F(MailboxesTest, ALookWakesWhatHasWaitedForAWholeInterval) {
  make_busy();
  WorkerThread &earlier = post(tiny_, 5);
  EXPECT_TRUE(look());
  EXPECT_FALSE(was_woken(earlier)) << "it may just have been posted";
  WorkerThread &later = post(tiny_, 1);
  EXPECT_TRUE(look());
  EXPECT_TRUE(was_woken(earlier));
  EXPECT_FALSE(was_woken(later));
  EXPECT_TRUE(look());
  EXPECT_TRUE(was_woken(later));
  EXPECT_FALSE(look()) << "no mail is silent any more";
}

TEST_F(MailboxesTest, TheLookoutIsWokenAgain) {
  make_busy();
  look();
  ASSERT_FALSE(look());
  EXPECT_FALSE(was_woken(post(tiny_)));
  EXPECT_TRUE(was_woken(lookout_));
}

TEST_F(MailboxesTest, ALookWakesTheMostUrgentForEachOtherProcessor) {
  mailboxes_.set_processors(3);
  make_busy();
  WorkerThread &third = post(tiny_, 7);
  WorkerThread &first = post(tiny_, 2);
  WorkerThread &second = post(tiny_, 4);
  look();
  EXPECT_TRUE(look());
  EXPECT_TRUE(was_woken(first));
  EXPECT_TRUE(was_woken(second));
  EXPECT_FALSE(was_woken(third));
  EXPECT_TRUE(look());
  EXPECT_TRUE(was_woken(third));
}

TEST_F(MailboxesTest, WithoutATinyJobAllSilentMailWakesItsThread) {
  make_busy();
  WorkerThread &first = post(tiny_);
  WorkerThread &second = post(tiny_);
  mailboxes_.settle(wake_ups_);
  EXPECT_FALSE(was_woken(first));
  mailboxes_.end(running_);
  mailboxes_.settle(wake_ups_);
  EXPECT_TRUE(was_woken(first));
  EXPECT_TRUE(was_woken(second));
}

TEST(TaskEntry, ReleasesAtItsEndIfItsTailsAreMostlyShort) {
  TaskEntry entry;
  for (int i = 0; i < 4; ++i) entry.count_tail(CpuMeter::kShort);
  EXPECT_FALSE(entry.releases_at_end());
  for (int i = 0; i < 4; ++i) entry.count_tail(CpuMeter::kShort);
  EXPECT_TRUE(entry.releases_at_end());
  entry.count_tail(CpuMeter::kShort + 1);
  EXPECT_FALSE(entry.releases_at_end());
  entry.count_tail(CpuMeter::kShort);
  EXPECT_TRUE(entry.releases_at_end()) << "it was an exception";
  for (int i = 0; i < 2; ++i) entry.count_tail(CpuMeter::kShort + 1);
  for (int i = 0; i < 3; ++i) entry.count_tail(CpuMeter::kShort);
  EXPECT_FALSE(entry.releases_at_end());
}

TEST(TaskEntry, AQuarterOfItsJobsMakesTheNextOneExpectedToBeTiny) {
  TaskEntry entry;
  entry.count(0, TaskEntry::kTiny);
  EXPECT_FALSE(entry.expected_tiny()) << "a single one";
  for (int i = 0; i < 100; ++i) entry.count(0, i % 3 == 0 ? TaskEntry::kTiny : kMillisecond);
  EXPECT_TRUE(entry.expected_tiny());
  for (int i = 0; i < 100; ++i) entry.count(0, i % 5 == 0 ? TaskEntry::kTiny : kMillisecond);
  EXPECT_FALSE(entry.expected_tiny());
}

TEST_F(MailboxesTest, AThreadLeavesTinyJobsToAnotherThatRunsThem) {
  EXPECT_FALSE(mailboxes_.should_leave(tiny_, true)) << "no other thread is in a tiny job";
  mailboxes_.begin(running_, tiny_);
  EXPECT_TRUE(mailboxes_.should_leave(tiny_, true));
  EXPECT_FALSE(mailboxes_.should_leave(tiny_, false)) << "it does not compete for the lock";
  EXPECT_FALSE(mailboxes_.should_leave(other_, true));
  mailboxes_.end(running_);
  make_busy();
  EXPECT_TRUE(mailboxes_.should_leave(tiny_, false));
}

TEST(MailboxesAlone, WithoutALookoutAllMailWakesItsThread) {
  WorkerPool pool(1, 0);
  Mailboxes mailboxes(1, nullptr, true);
  TaskEntry tiny;
  for (int i = 0; i < 8; ++i) tiny.count(0, 0);
  WorkerThread running(1, 0);
  mailboxes.begin(running, tiny);
  WakeUps wake_ups(true);
  for (int i = 0; i < 3; ++i) {
    mailboxes.add_idle(pool[0]);
    mailboxes.post(tiny, 0, -1, &running, wake_ups, [](WorkerThread &) {});
    ASSERT_TRUE(pool[0].parker.spin(1));
    pool[0].parker.park();
    ASSERT_TRUE(pool[0].take_mail());
  }
}

}  // namespace
}  // namespace redag::runtime
