// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Waits that end otherwise than by what they wait for: at a limit, because the task is removed, because the engine is
// paused for good, because the coroutine's owner is gone. And coroutines that begin within a body.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "redag/engine/coroutine_body.hpp"
#include "redag/engine/engine.hpp"
#include "redag/runtime/async_event.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag/threads/clock.hpp"
#include "tests/testing/builders.hpp"
#include "tests/testing/every_mode.hpp"

namespace redag::runtime {
namespace {

using namespace std::chrono_literals;
using sched::Outcome;
using std::chrono::steady_clock;

// An engine with one worker and two tasks.
class CoroutineEnds : public ::testing::TestWithParam<PreemptionMode> {
 protected:
  void SetUp() override {
    if (GetParam() == PreemptionMode::Os && band_.top_job == 0) GTEST_SKIP() << "this process may not use SCHED_FIFO";
    const Workload workload = testing::ladder(2);
    EngineOptions options;
    options.config = make_config(Mode{GetParam(), {}}, 1, workload.policy, band_, 2);
    options.band = band_;
    options.on_exception = [this](const Job &, std::exception_ptr exception) {
      try {
        std::rethrow_exception(std::move(exception));
      } catch (const std::exception &error) {
        thrown_ = error.what();
      }
    };
    engine_ = std::make_unique<Engine>(std::make_unique<sched::PriorityScheduler>(workload, options.config), options);
    const auto begin = [this](const Job &job) {
      run_in_job(function_(job.task), owner_.get());
      return Outcome::Finished;
    };
    engine_->bind(workload, {begin, begin});
    ASSERT_TRUE(engine_->let_wait());
    ASSERT_TRUE(engine_->start());
    engine_->set_origin(monotonic_now());
  }
  void TearDown() override {
    if (engine_) engine_->join();
  }
  void release(std::uint32_t task) { engine_->release(TaskId(task), engine_->now()); }
  void wait_for(const std::function<bool()> &condition) {
    while (!condition()) std::this_thread::yield();
  }

  const PriorityBand band_ = probe_priority_band();
  std::function<Coroutine(TaskId)> function_;
  std::shared_ptr<CoroutineOwner> owner_;
  std::string thrown_;
  std::unique_ptr<Engine> engine_;
};

INSTANTIATE_TEST_SUITE_P(Modes, CoroutineEnds, testing::every_mode(), testing::mode_name);

struct Local {
  explicit Local(std::atomic<int> &its_count) : count(its_count) {}
  ~Local() { ++count; }
  Local(const Local &) = delete;
  Local &operator=(const Local &) = delete;
  std::atomic<int> &count;
};

TEST_P(CoroutineEnds, AnEventIsAwaitedUntilATime) {
  AsyncEvent never;
  AsyncEvent event;
  std::vector<bool> set;
  std::atomic<bool> done{false};
  function_ = [&](TaskId) -> Coroutine {
    const auto until = steady_clock::now() + 3ms;
    set.push_back(co_await never.wait_until(until));
    EXPECT_GE(steady_clock::now(), until);
    set.push_back(co_await never.wait_until(steady_clock::now() - 1ms));
    event.set();
    set.push_back(co_await event.wait_until(steady_clock::now() - 1ms));  // set, although the time has passed
    std::thread setter([&] { event.set(); });
    set.push_back(co_await event.wait_until(steady_clock::now() + 1h));
    setter.join();
    set.push_back(co_await never.wait_until(steady_clock::now() + 1ms));
    done = true;
  };
  release(0);
  wait_for([&] { return done.load(); });
  EXPECT_EQ(set, (std::vector<bool>{false, false, true, true, false}));
}

// The limit of a wait that has ended must not end a later one.
TEST_P(CoroutineEnds, ALimitIsForgottenWithItsWait) {
  AsyncEvent event;
  AsyncEvent other;
  std::atomic<int> rounds{0};
  std::atomic<bool> done{false};
  function_ = [&](TaskId task) -> Coroutine {
    if (task == TaskId(1)) {
      for (; rounds < 200; ++rounds) {
        event.set();
        co_await redag::sleep_for(10us);
      }
      other.set();
      co_return;
    }
    while (rounds < 200) static_cast<void>(co_await event.wait_until(steady_clock::now() + 100us));
    co_await other;
    done = true;
  };
  release(0);
  release(1);
  wait_for([&] { return done.load(); });
}

TEST_P(CoroutineEnds, ARemovedTaskWaitsForNothing) {
  AsyncEvent event;
  std::atomic<int> waiting{0};
  std::atomic<int> ended{0};
  std::atomic<int> went_on{0};
  std::atomic<bool> waits_again{false};
  function_ = [&](TaskId task) -> Coroutine {
    const Local local(ended);
    ++waiting;
    if (task == TaskId(1)) {
      try {
        co_await redag::sleep_for(1h);
      } catch (const WaitCancelled &) {
        waits_again = true;
      }
    }
    co_await event;
    ++went_on;
  };
  release(0);
  release(1);
  wait_for([&] { return waiting == 2; });
  engine_->remove_task(TaskId(1));
  wait_for([&] { return ended == 1; });
  EXPECT_TRUE(waits_again) << "and its second wait was cancelled at once";
  event.set();
  wait_for([&] { return ended == 2; });
  EXPECT_EQ(went_on, 1) << "the other task's job";
}

TEST_P(CoroutineEnds, EndStartedCancelsWaitsAndJobsCanWaitAgain) {
  AsyncEvent event;
  std::atomic<int> waiting{0};
  std::atomic<int> ended{0};
  std::atomic<int> went_on{0};
  function_ = [&](TaskId) -> Coroutine {
    const Local local(ended);
    ++waiting;
    co_await event;
    ++went_on;
  };
  for (int round = 1; round <= 3; ++round) {
    release(0);
    release(1);
    wait_for([&] { return waiting == 2 * round; });
    engine_->pause();
    engine_->end_started();
    EXPECT_EQ(ended, 2 * round);
    engine_->resume();
  }
  EXPECT_EQ(went_on, 0);
  EXPECT_EQ(engine_->figures(TaskId(0)).jobs.aborted, 0U) << "cancelled jobs are in flight";
  release(0);
  wait_for([&] { return waiting == 7; });
  event.set();
  wait_for([&] { return went_on == 1; });
}

class Node : public CoroutineOwner {
 public:
  explicit Node(std::weak_ptr<int> part) : part_(std::move(part)) {}
  [[nodiscard]] std::shared_ptr<void> hold() override { return part_.lock(); }

 private:
  std::weak_ptr<int> part_;
};

TEST_P(CoroutineEnds, ACoroutineHoldsItsOwnersPartOnlyWhileItRuns) {
  auto part = std::make_shared<int>(1);
  const std::weak_ptr<int> weak = part;
  owner_ = std::make_shared<Node>(weak);
  AsyncEvent event;
  std::atomic<int> waiting{0};
  std::atomic<int> ended{0};
  std::atomic<int> went_on{0};
  function_ = [&](TaskId) -> Coroutine {
    const Local local(ended);
    co_await redag::sleep_for(1us);  // an event could be set already, and the job would not wait
    EXPECT_EQ(weak.use_count(), 2) << "the test's and the job's";
    ++went_on;
    ++waiting;
    co_await event;
    ++went_on;
  };
  release(0);
  wait_for([&] { return waiting == 1; });
  wait_for([&] { return weak.use_count() == 1; });
  part.reset();
  event.set();
  wait_for([&] { return ended == 1; });
  EXPECT_EQ(went_on, 1);
}

Coroutine sleep_once() { co_await redag::sleep_for(1us); }

TEST_P(CoroutineEnds, AJobHasOneCoroutineAtATime) {
  function_ = [&](TaskId task) -> Coroutine {
    if (task == TaskId(1)) co_await redag::sleep_for(1us);
    run_in_job(sleep_once());
  };
  for (const std::uint32_t task : {0U, 1U}) {
    release(task);
    wait_for([&] { return engine_->figures(TaskId(task)).jobs.aborted == 1; });
  }
  engine_->join();
  EXPECT_NE(thrown_.find("second coroutine"), std::string::npos) << thrown_;
}

}  // namespace
}  // namespace redag::runtime
