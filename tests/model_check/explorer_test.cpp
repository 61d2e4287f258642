// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "tests/testing/explorer.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <rapidcheck/gtest.h>

#include <array>
#include <set>
#include <string>
#include <vector>

namespace redag::testing {
namespace {

// Runs each function on a thread of its own; thread 0 joins them.
void run_all(const std::vector<std::function<void()>> &bodies) {
  std::vector<std::uint32_t> threads;
  threads.reserve(bodies.size());
  for (const auto &body : bodies) threads.push_back(explored::spawn(body));
  for (const std::uint32_t thread : threads) explored::join(thread);
}

std::uint64_t executions_of_writers(std::size_t threads, bool same_object) {
  const Exploration all = explore([&] {
    std::vector<ObjectId> objects;
    for (std::size_t t = 0; t < threads; ++t) objects.push_back(explored::new_object());
    std::vector<std::function<void()>> bodies;
    for (std::size_t t = 0; t < threads; ++t) {
      bodies.emplace_back([&, t] { explored::write(objects[same_object ? 0 : t], "write"); });
    }
    run_all(bodies);
  });
  EXPECT_TRUE(all.complete);
  EXPECT_EQ(all.failure, "");
  return all.executions;
}

TEST(Explorer, RunsEachOrderOfDependentOperationsOnce) {
  EXPECT_EQ(executions_of_writers(2, true), 2U);
  EXPECT_EQ(executions_of_writers(3, true), 6U);
  EXPECT_EQ(executions_of_writers(4, true), 24U);
  EXPECT_EQ(executions_of_writers(4, false), 1U);
}

TEST(Explorer, FindsAnUpdateThatIsLost) {
  const Exploration found = explore([] {
    const ObjectId object = explored::new_object();
    int value = 0;
    const auto increment = [&] {
      explored::read(object, "load");
      const int seen = value;
      explored::write(object, "store");
      value = seen + 1;
    };
    run_all({increment, increment});
    explored::check(value == 2, "an update was lost");
  });
  EXPECT_EQ(found.failure.substr(0, found.failure.find('\n')), "an update was lost");
}

TEST(Explorer, FindsADeadlockOfTwoLocks) {
  const Exploration found = explore([] {
    const std::array<ObjectId, 2> mutexes{explored::new_object(), explored::new_object()};
    const auto both = [&](std::size_t first) {
      explored::lock(mutexes[first]);
      explored::lock(mutexes[1 - first]);
      explored::unlock(mutexes[1 - first]);
      explored::unlock(mutexes[first]);
    };
    run_all({[&] { both(0); }, [&] { both(1); }});
  });
  EXPECT_NE(found.failure.find("nobody can go on"), std::string::npos) << found.failure;
}

// A sleeper must check the value again under the futex's own check. Otherwise it misses a wake-up between its check and
// its sleep.
TEST(Explorer, FindsAWakeUpThatIsLost) {
  for (const bool looks_again : {true, false}) {
    const Exploration found = explore([&] {
      const ObjectId word = explored::new_object();
      bool set = false;
      run_all({[&] {
                 explored::read(word, "load");
                 if (set) return;
                 static_cast<void>(explored::wait(
                     word, [&] { return !looks_again || !set; }, explored::kForever));
               },
               [&] {
                 explored::write(word, "store");
                 set = true;
                 explored::wake(word, 1);
               }});
    });
    EXPECT_EQ(found.failure.empty(), looks_again) << found.failure;
  }
}

TEST(Explorer, ATimedWaitEndsEitherWay) {
  std::set<std::pair<bool, std::int64_t>> ends;
  const Exploration all = explore(
      [&] {
        const ObjectId word = explored::new_object();
        bool set = false;
        run_all({[&] {
                   const bool woken = explored::wait(
                       word, [&] { return !set; }, 7);
                   ends.emplace(woken, explored::now());
                 },
                 [&] {
                   explored::write(word, "store");
                   set = true;
                   explored::wake(word, 1);
                 }});
      },
      ExploreOptions{true, 1000, 0, true});
  EXPECT_TRUE(all.complete);
  EXPECT_EQ(ends, (std::set<std::pair<bool, std::int64_t>>{{false, 7}, {true, 0}}));
}

TEST(Explorer, WakeUpsForNoReasonComeAsOftenAsAllowed) {
  for (std::uint32_t allowed = 0; allowed < 3; ++allowed) {
    std::set<int> looks;
    const Exploration all = explore(
        [&] {
          const ObjectId word = explored::new_object();
          bool set = false;
          int times = 0;
          run_all({[&] {
                     for (;; ++times) {
                       explored::read(word, "load");
                       if (set) break;
                       static_cast<void>(explored::wait(
                           word, [&] { return !set; }, explored::kForever));
                     }
                   },
                   [&] {
                     explored::write(word, "store");
                     set = true;
                     explored::wake(word, 1);
                   }});
          looks.insert(times);
        },
        ExploreOptions{true, 100000, allowed, false});
    EXPECT_TRUE(all.complete);
    EXPECT_EQ(all.failure, "");
    EXPECT_EQ(*looks.rbegin(), static_cast<int>(allowed) + 1);
  }
}

// ---- the reduction leaves out nothing ----

struct Step {
  int kind = 0;  // 0: load, 1: store, 2: store under a lock, 3: wait while 0, 4: store and wake, 5: timed 3
  std::size_t object = 0;
};
using Program = std::vector<std::vector<Step>>;

// The values that each thread saw and each object had at the end, for every execution; deadlocks count as ends.
std::set<std::string> outcomes(const Program &program, bool reduce, Exploration &all) {
  std::set<std::string> seen;
  all = explore(
      [&] {
        const std::array<ObjectId, 2> ids{explored::new_object(), explored::new_object()};
        const ObjectId mutex = explored::new_object();
        std::array<int, 2> values{};
        std::vector<std::string> views(program.size());
        std::vector<std::function<void()>> bodies;
        for (std::size_t t = 0; t < program.size(); ++t) {
          bodies.emplace_back([&, t] {
            int count = 0;
            for (const Step &step : program[t]) {
              const int mark = static_cast<int>(t) * 10 + ++count;
              const ObjectId id = ids[step.object];
              int &value = values[step.object];
              const auto store = [&] {
                explored::write(id, "store");
                value = mark;
              };
              switch (step.kind) {
                case 0:
                  explored::read(id, "load");
                  views[t] += std::to_string(value) + ",";
                  break;
                case 2: explored::lock(mutex); [[fallthrough]];
                case 1:
                  store();
                  if (step.kind == 2) explored::unlock(mutex);
                  break;
                case 3:
                case 5: {
                  // An endless wait would end the exploration with a deadlock. The last thread therefore stores to
                  // every object and wakes all waiters.
                  const bool woken = explored::wait(
                      id, [&] { return value == 0; }, step.kind == 5 ? 5 : explored::kForever);
                  views[t] += woken ? "w" : "t";
                  break;
                }
                default: store(); explored::wake(id, 1);
              }
            }
          });
        }
        bodies.emplace_back([&] {
          for (std::size_t i = 0; i < ids.size(); ++i) {
            explored::write(ids[i], "store");
            values[i] = 99;
            explored::wake(ids[i], 100);
          }
        });
        run_all(bodies);
        std::string outcome;
        for (const int value : values) outcome += std::to_string(value) + " ";
        for (const std::string &view : views) outcome += view + " ";
        seen.insert(outcome);
      },
      ExploreOptions{reduce, 5'000'000, 0, false});
  return seen;
}

// Thread 1's store goes last although its load came first, and thread 0 sees the stores of the last thread. With sleep
// sets, it is not enough to reverse each race by the thread that lost it.
TEST(Explorer, AnOrderIsNotLeftOutBecauseItsBeginningSleeps) {
  const Program program{{{0, 1}, {0, 0}}, {{0, 1}, {1, 0}}};
  Exploration all;
  const std::set<std::string> with = outcomes(program, true, all);
  EXPECT_TRUE(all.complete);
  EXPECT_EQ(with, outcomes(program, false, all));
  EXPECT_TRUE(with.contains("12 99 99,99, 0, "));
}

RC_GTEST_PROP(Explorer, ReducedOrNotTheOutcomesAreTheSame, ()) {
  const auto threads = *rc::gen::inRange<std::size_t>(1, 3);
  Program program(threads);
  for (auto &thread : program) {
    const auto steps = *rc::gen::inRange<std::size_t>(1, 3);
    for (std::size_t i = 0; i < steps; ++i) {
      thread.push_back(Step{*rc::gen::inRange(0, 6), *rc::gen::inRange<std::size_t>(0, 2)});
    }
  }
  Exploration reduced;
  Exploration full;
  const std::set<std::string> with = outcomes(program, true, reduced);
  RC_ASSERT(reduced.failure.empty());
  RC_ASSERT(reduced.complete);
  const std::set<std::string> without = outcomes(program, false, full);
  RC_ASSERT(full.failure.empty());
  RC_ASSERT(full.complete);
  RC_ASSERT(with == without);
  RC_ASSERT(reduced.executions <= full.executions);
}

}  // namespace
}  // namespace redag::testing
