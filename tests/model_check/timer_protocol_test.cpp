// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Explores every interleaving of what sleeps by time: the parker, the event, the release timer, and a whole executor.
#include <array>

#include "protocol.hpp"
#include "redag/runtime/executor.hpp"
#include "redag/runtime/release_timer.hpp"
#include "redag/threads/release_thread.hpp"
#include "tests/testing/builders.hpp"

namespace redag::model_check {
namespace {

using runtime::Event;
using runtime::Parker;

using explored::spawn;

constexpr ExploreOptions kTimed{true, 50'000'000, 0, true};

// Each token ends one park(), whenever it comes. Two tokens that come together count as one.
TEST(ParkerProtocol, NoTokenIsLost) {
  for (const std::uint32_t spurious : {0U, 1U}) {
    expect_holds(
        [] {
          Parker parker;
          Atomic<int> sent{0};
          const auto send = [&] {
            sent.fetch_add(1);
            parker.unpark();
          };
          const std::uint32_t a = spawn(send);
          const std::uint32_t b = spawn([&] {
            send();
            send();
          });
          // A thread that has taken a token sees what was sent before it. Otherwise this would wait for ever.
          while (sent.load() < 3) parker.park();
          explored::join(a);
          explored::join(b);
        },
        ExploreOptions{true, 50'000'000, spurious, false});
  }
}

TEST(ParkerProtocol, NoTokenIsLostByLookingBeforeSleeping) {
  expect_holds([] {
    Parker parker;
    Atomic<int> sent{0};
    const std::uint32_t a = spawn([&] {
      for (int i = 0; i < 2; ++i) {
        sent.fetch_add(1);
        parker.unpark();
      }
    });
    while (sent.load() < 2) parker.park(2);
    explored::join(a);
  });
}

TEST(ParkerProtocol, ATokenThatIsNotTakenInTimeIsTakenLater) {
  expect_holds(
      [] {
        Parker parker;
        const std::uint32_t a = spawn([&] { parker.unpark(); });
        int taken = parker.park_until(3) ? 1 : 0;
        taken += parker.park_until(5) ? 1 : 0;
        explored::join(a);
        taken += parker.park_until(7) ? 1 : 0;
        explored::check(taken == 1, "a token was lost, or taken twice");
        parker.unpark();
        parker.park();
      },
      kTimed);
}

TEST(ParkerProtocol, ParkingForATimeOnlySleepsThatLong) {
  expect_holds(
      [] {
        Parker parker;
        bool sent = false;
        const std::uint32_t a = spawn([&] {
          explored::tick(2);
          sent = true;
          parker.unpark();
        });
        const bool taken = parker.park_until(4);
        explored::check(taken || explored::now() >= 4, "timed out early");
        explored::check(!taken || sent, "a token that nobody sent");
        explored::join(a);
      },
      kTimed);
}

TEST(EventProtocol, EveryWaiterSeesIt) {
  expect_holds(
      [] {
        Event event;
        const std::uint32_t a = spawn([&] { event.wait(); });
        const std::uint32_t b = spawn([&] {
          if (!event.wait_until(3)) explored::check(explored::now() >= 3, "timed out early");
        });
        const std::uint32_t c = spawn([&] { event.set(); });
        event.set();
        event.wait();
        explored::check(event.is_set(), "set, and not set");
        explored::join(a);
        explored::join(b);
        explored::join(c);
      },
      kTimed);
}

Dag one_timer_task(Duration period) { return testing::tick_dag("d", {{"t", period}}); }

// Reports every grid point before the stop, once, in order, and never early.
TEST(TimerProtocol, ReleasesAreOnTheGridUntilTheStop) {
  expect_holds(
      [] {
        std::vector<Time> released;
        bool joined = false;
        runtime::ReleaseTimer timer(
            [&](std::span<const runtime::Release> releases) {
              for (const runtime::Release &release : releases) {
                explored::check(release.nominal <= explored::now(), "released early");
                released.push_back(release.nominal);
              }
              explored::check(!joined, "a release after the timer's end");
            },
            0);
        timer.add(one_timer_task(10), std::array{TaskId(0)}, 0);
        explored::check(timer.start(0, 35, {}).has_value(), "the timer does not start");
        explored::tick(12);
        const Time stopped = explored::now();
        timer.stop();
        timer.join();
        joined = true;
        for (std::size_t i = 0; i < released.size(); ++i) {
          explored::check(released[i] == static_cast<Time>(i) * 10, "a release is off the grid");
        }
        explored::check(released.size() > static_cast<std::size_t>(std::min<Time>(stopped, 34) / 10),
                        "a release that was due before the stop is missing");
      },
      kTimed);
}

// The same while another thread releases what is due, too.
TEST(TimerProtocol, AnIdleThreadReleasesOnTheSameGrid) {
  expect_holds(
      [] {
        std::vector<Time> released;
        bool joined = false;
        runtime::ReleaseTimer timer(
            [&](std::span<const runtime::Release> releases) {
              for (const runtime::Release &release : releases) {
                explored::check(release.nominal <= explored::now(), "released early");
                released.push_back(release.nominal);
              }
              explored::check(!joined, "a release after the timer's end");
            },
            0);
        timer.add(one_timer_task(10), std::array{TaskId(0)}, 0);
        explored::check(timer.start(0, 15, {}).has_value(), "the timer does not start");
        const std::uint32_t idle = spawn([&] {
          const Time next = timer.release_due();
          explored::check(next == kNever || next == 10, "the next release is off the grid");
        });
        explored::tick(5);
        timer.stop();
        timer.join();
        joined = true;
        explored::join(idle);
        explored::check(!released.empty() && released.size() <= 2, "a release is missing, or came twice");
        for (std::size_t i = 0; i < released.size(); ++i) {
          explored::check(released[i] == static_cast<Time>(i) * 10, "a release is off the grid");
        }
      },
      kTimed);
}

// A leader waits in the place of the thread until it gets a job, at any moment. Each release is made once, and not
// before its time.
TEST(TimerProtocol, LeaderAndThreadMakeEachReleaseOnce) {
  for (const Duration patience : {Duration{1}, kNever}) {
    expect_holds(
        [&] {
          const std::vector<Time> due = patience == kNever ? std::vector<Time>{1, 4} : std::vector<Time>{1};
          std::size_t made = 0;
          Countdown left(static_cast<int>(due.size()));
          runtime::ReleaseThread releases([&] {
            while (made < due.size() && explored::now() >= due[made]) {
              ++made;
              left.count();
            }
            return made < due.size() ? due[made] : kNever;
          });
          explored::check(releases.start({}).has_value(), "the thread does not start");
          runtime::Parker parker;
          const std::uint32_t leader = spawn([&] {
            for (bool has_job = false; !has_job;) {
              const Time next = releases.lead(patience);
              if (next == kNever) parker.park();
              has_job = next == kNever || parker.park_until(next);
            }
            releases.follow();
          });
          parker.unpark();
          left.wait();
          explored::join(leader);
          explored::check(made == due.size(), "a release is made twice");
        },
        kTimed);
  }
}

// Adding a task wakes the timer from a longer sleep.
TEST(TimerProtocol, AnAdditionIsNotSleptThrough) {
  expect_holds([] {
    Countdown seen(2);
    runtime::ReleaseTimer timer(
        [&](std::span<const runtime::Release> releases) {
          for (std::size_t i = 0; i < releases.size(); ++i) seen.count();
        },
        0);
    explored::check(timer.start(0, 5, {}).has_value(), "the timer does not start");
    const std::uint32_t other = spawn([&] { timer.add(one_timer_task(100), std::array{TaskId(1)}, 0); });
    timer.add(one_timer_task(100), std::array{TaskId(0)}, 0);
    seen.wait();
    explored::join(other);
    timer.remove(std::array{TaskId(0), TaskId(1)});
  });
}

// After remove() has returned, the id may be another task's. No earlier release may be reported then.
TEST(TimerProtocol, WhatWasRemovedIsNotReported) {
  expect_holds([] {
    Quiet removed;
    runtime::ReleaseTimer timer(
        [&](std::span<const runtime::Release>) {
          removed.job_begins();
          removed.job_ends();
        },
        0);
    timer.add(one_timer_task(100), std::array{TaskId(0)}, 0);
    explored::check(timer.start(0, 5, {}).has_value(), "the timer does not start");
    const std::uint32_t other = spawn([&] {
      timer.remove(std::array{TaskId(0)});
      removed.begin();
    });
    explored::join(other);
  });
}

// A whole executor: the timer's releases, a stop from a body or from another thread, and the end of both.
TEST(ExecutorProtocol, NothingRunsAfterStop) {
  for (const bool from_body : {false, true}) {
    expect_holds(
        [&] {
          runtime::ExecutorOptions options;
          options.workers = 1;
          options.preemption = PreemptionMode::None;
          options.stop_timeout = std::chrono::nanoseconds(kNever / 4);
          runtime::Executor executor(options);
          Quiet quiet;
          runtime::DagBuilder dag("dag");
          dag.timer("t", std::chrono::nanoseconds(3600 * kSecond),
                    [&] {  // one release: the timer's sleep is too long for a second one
                      quiet.job_begins();
                      if (from_body) executor.stop();
                      quiet.job_ends();
                    });
          executor.add(std::move(dag));
          explored::calm(true);
          executor.start();
          explored::settle();
          explored::calm(false);
          if (from_body) {
            executor.wait();
          } else {
            const std::uint32_t other = spawn([&] { executor.stop(); });
            executor.wait();
            explored::join(other);
          }
          quiet.begin();
          explored::check(executor.stopping(), "stopped, and not stopping");
        },
        kTimed);
  }
}

}  // namespace
}  // namespace redag::model_check
