// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Which clocks the engine reads for short jobs. The threads that run jobs have stepped clocks: every job is short,
// whatever the machine does.
#include <gtest/gtest.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdarg>
#include <fstream>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "redag/engine/engine.hpp"
#include "redag/engine/running_job.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag/threads/clock.hpp"
#include "tests/testing/builders.hpp"
#include "tests/testing/every_mode.hpp"
#include "tests/testing/stepped_clock.hpp"

namespace {
/// What a wake-up takes, in nanoseconds on the stepped clock.
std::atomic<std::int64_t> wake_takes{0};
}  // namespace

// Replaces libc's function: the engine wakes threads by it.
extern "C" long syscall(long number, ...) noexcept {
  va_list list;
  va_start(list, number);
  long arguments[6];
  for (long &argument : arguments) argument = va_arg(list, long);
  va_end(list);
  static auto *const kReal = [] {
    void *const found = dlsym(RTLD_NEXT, "syscall");
    long (*function)(long, ...) = nullptr;
    std::memcpy(&function, &found, sizeof function);
    return function;
  }();
  if (number == SYS_futex && (arguments[1] & FUTEX_CMD_MASK) == FUTEX_WAKE && redag::testing::detail::steps.step != 0) {
    redag::testing::detail::steps.now += wake_takes;
  }
  return kReal(number, arguments[0], arguments[1], arguments[2], arguments[3], arguments[4], arguments[5]);
}

namespace redag::runtime {
namespace {

using redag::testing::clock_ahead;
using redag::testing::clock_readings;
using redag::testing::step_clock;
using redag::testing::TestTask;
using sched::Outcome;

constexpr int kEnoughToBeExpectedShort = TaskEntry::kStreak + 1;
constexpr int kMore = 50;
constexpr Duration kLong = 2 * CpuMeter::kShort;

std::uint64_t asked() { return clock_readings.processor; }

class EngineClock : public ::testing::TestWithParam<PreemptionMode> {
 protected:
  void SetUp() override {
    if (mode() == PreemptionMode::Os && band_.top_job == 0) GTEST_SKIP() << "this process may not use SCHED_FIFO";
  }
  static PreemptionMode mode() { return GetParam(); }

  void start(const std::vector<TestTask> &tasks, std::vector<Body> bodies, std::uint32_t workers = 1,
             Duration budget = 0) {
    Workload workload = redag::testing::make_workload({redag::testing::make_dag("d", tasks)}, workers);
    for (Task &task : workload.dags[0].tasks) task.budget = budget;
    EngineOptions options;
    options.config = make_config(Mode{mode(), {}}, workers, workload.policy, band_, 4);
    options.band = band_;
    engine_ = std::make_unique<Engine>(std::make_unique<sched::PriorityScheduler>(workload, options.config), options);
    engine_->bind(workload, std::move(bodies));
    ASSERT_TRUE(engine_->start());
    engine_->set_origin(monotonic_now());
  }
  /// Releases `task`, and waits until all of `last` has finished once more.
  void run(std::size_t task, const std::vector<std::size_t> &last, int times = 1) {
    for (int i = 0; i < times; ++i) {
      std::vector<std::uint64_t> before;
      before.reserve(last.size());
      for (const std::size_t each : last) before.push_back(finished(each));
      engine_->release(TaskId(task), engine_->now());
      for (std::size_t each = 0; each < last.size(); ++each) {
        while (finished(last[each]) == before[each]) std::this_thread::yield();
      }
    }
  }
  std::uint64_t finished(std::size_t task) const { return engine_->figures(TaskId(task)).jobs.finished; }

  const PriorityBand band_ = probe_priority_band();
  std::unique_ptr<Engine> engine_;
};
INSTANTIATE_TEST_SUITE_P(Modes, EngineClock, testing::every_mode(), testing::mode_name);

TEST_P(EngineClock, ShortJobsAskForNoProcessorTime) {
  start({{.name = "t", .period = 1000}}, {[](const Job &) {
          step_clock();
          return Outcome::Finished;
        }});
  run(0, {0}, kEnoughToBeExpectedShort);
  const std::uint64_t before = asked();
  run(0, {0}, kMore);
  EXPECT_EQ(asked(), before);
}

// A job that is charged on trust is charged more than it used. The next one must not be charged less for it.
TEST_P(EngineClock, TrustDoesNotShortenTheNextJob) {
  static constexpr Duration kDemand = 2 * CpuMeter::kShort;
  start({{.name = "first", .period = 1000}, {.name = "next", .period = 2000}},
        {[](const Job &) {
           step_clock();
           clock_ahead += CpuMeter::kShort - kMicrosecond;
           return Outcome::Finished;
         },
         [](const Job &) {
           for (const Duration begun = thread_cpu_now(); thread_cpu_now() - begun < kDemand;) {
           }
           clock_ahead += kLong;
           return Outcome::Finished;
         }});
  const Release both[] = {{TaskId(0), engine_->now()}, {TaskId(1), engine_->now()}};
  engine_->release(both);
  while (finished(1) == 0) std::this_thread::yield();
  EXPECT_GE(engine_->figures(TaskId(1)).usage.longest, kDemand);
}

TEST_P(EngineClock, JobsWithABudgetAreMeasured) {
  start({{.name = "t", .period = 1000}}, {[](const Job &) {
          step_clock();
          return Outcome::Finished;
        }},
        1, kSecond);
  run(0, {0}, kEnoughToBeExpectedShort);
  const std::uint64_t before = asked();
  run(0, {0}, kMore);
  EXPECT_GE(asked(), before + 2 * std::uint64_t{kMore});  // at the begin and at the end
}

// After a long job, the thread asks until short jobs are expected again. If the time that this takes were the next
// job's, that would never be.
TEST_P(EngineClock, AskingMakesNoJobLong) {
  static std::atomic<bool> is_long{false};
  is_long = false;
  const auto body = [](const Job &) {
    step_clock();
    if (is_long.exchange(false)) clock_ahead += kLong;
    return Outcome::Finished;
  };
  start({{.name = "first", .period = 1000}, {.name = "next", .after = {0}}}, {body, body});
  run(0, {1}, kEnoughToBeExpectedShort);
  redag::testing::asking_takes = kLong;
  // The reading at the end of the first job is not the second one's, and the one before it begins is not its own.
  is_long = true;
  std::uint64_t before = asked();
  run(0, {1});
  EXPECT_EQ(asked(), before + 1);
  run(0, {1}, kEnoughToBeExpectedShort);
  before = asked();
  run(0, {1}, kMore);
  redag::testing::asking_takes = 0;
  EXPECT_EQ(asked(), before);
}

// Two jobs follow a third, on two threads. One of them is begun by the thread that wakes the other's.
TEST_P(EngineClock, AWakeUpIsNotChargedToTheNextJob) {
  static std::atomic<int> met{0};
  static std::atomic<int> charged{0};  // jobs that began, by the thread's stepped clock, before a wake-up
  met = 0;
  const auto body = [](const Job &job) {
    step_clock();
    if (job.task == TaskId(0)) return Outcome::Finished;
    // In the first round the two jobs wait for each other: both threads have stepped clocks from then on.
    for (++met; met < 2;) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    const RunningJob &running = *RunningJob::current();
    if (running.engine->now() - running.begun >= kSecond) ++charged;
    return Outcome::Finished;
  };
  start({{.name = "first", .period = 1000}, {.name = "a", .after = {0}}, {.name = "b", .after = {0}}},
        {body, body, body}, 2);
  run(0, {1, 2});
  charged = 0;
  wake_takes = kSecond;
  for (int round = 0; round < kMore; ++round) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));  // so that both threads sleep
    run(0, {1, 2});
  }
  wake_takes = 0;
  EXPECT_EQ(charged, 0);
}

// ---- a thread that waits for the engine's lock ----

std::atomic<int> holder_turn{0};  // 0: the first job runs; 1: it may end
std::atomic<pid_t> worker{0};

bool sleeps(pid_t thread) {
  std::ifstream file("/proc/self/task/" + std::to_string(thread) + "/stat");
  const std::string stat((std::istreambuf_iterator<char>(file)), {});
  return stat[stat.rfind(')') + 2] == 'S';
}

// watch() reads the worker's processor time under the engine's lock. Then the worker's job ends, and the worker waits.
void hold_the_lock() {
  if (holder_turn.exchange(1) != 0) return;
  while (!sleeps(worker)) std::this_thread::yield();
  clock_ahead += kLong;
}

class EngineClockWithoutPriorities : public EngineClock {};
INSTANTIATE_TEST_SUITE_P(Modes, EngineClockWithoutPriorities, ::testing::Values(PreemptionMode::None),
                         [](const auto &instance) { return std::string(to_string(instance.param)); });

TEST_P(EngineClockWithoutPriorities, AWaitForTheLockIsNotChargedToTheNextJob) {
  static std::atomic<bool> waits{false};
  static std::atomic<std::uint64_t> asked_before{0};
  start({{.name = "first", .period = 1000}, {.name = "next", .period = 2000}},
        {[](const Job &) {
           step_clock();
           worker = static_cast<pid_t>(::syscall(SYS_gettid));
           while (waits && holder_turn == 0) {
           }
           return Outcome::Finished;
         },
         [](const Job &) {
           step_clock();
           asked_before = asked();
           return Outcome::Finished;
         }});
  run(0, {0}, kEnoughToBeExpectedShort);
  run(1, {1}, kEnoughToBeExpectedShort);
  holder_turn = 0;
  waits = true;
  const std::uint64_t before = finished(1);
  const Release both[] = {{TaskId(0), engine_->now()}, {TaskId(1), engine_->now()}};
  engine_->release(both);
  redag::testing::on_foreign_clock = hold_the_lock;
  std::vector<OverdueJob> overdue;
  while (holder_turn == 0) engine_->watch({.longest = 1, .deadlines = 0}, engine_->now() + kSecond, overdue);
  redag::testing::on_foreign_clock = nullptr;
  while (finished(1) == before) std::this_thread::yield();
  waits = false;
  EXPECT_EQ(asked(), asked_before);
}

}  // namespace
}  // namespace redag::runtime
