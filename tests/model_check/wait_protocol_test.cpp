// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Explores every interleaving of jobs that wait: an event that is set while the job leaves its thread, and a halt that
// ends the wait meanwhile.
#include <array>
#include <vector>

#include "protocol.hpp"
#include "redag/engine/coroutine_body.hpp"
#include "redag/runtime/async_event.hpp"

namespace redag::model_check {
namespace {

using explored::spawn;

/// An engine with one worker, whose jobs run the coroutine that `make` returns.
class WaitingMachine {
 public:
  WaitingMachine(Preemption preemption, std::function<Coroutine()> make, std::size_t tasks = 1)
      : make_(std::move(make)) {
    const Workload workload = ladder(tasks);
    runtime::EngineOptions options;
    options.config.workers = 1;
    options.config.preemption = preemption;
    options.config.policy = workload.policy;
    if (preemption == Preemption::Full) {
      options.config.max_started = 2;
      options.config.levels = 8;
      options.band = runtime::PriorityBand{8, 9};
    }
    engine = std::make_unique<Engine>(std::make_unique<sched::PriorityScheduler>(workload, options.config), options);
    engine->bind(workload, std::vector(tasks, runtime::coroutine_body([this](const Job &) { return make_(); })));
  }
  void start_calmly() {
    explored::calm(true);
    explored::check(engine->let_wait().has_value() && engine->start().has_value(), "the engine does not start");
    explored::settle();
    explored::calm(false);
  }

  std::unique_ptr<Engine> engine;

 private:
  std::function<Coroutine()> make_;
};

class WaitProtocol : public ::testing::TestWithParam<Preemption> {};
INSTANTIATE_TEST_SUITE_P(Modes, WaitProtocol, ::testing::Values(Preemption::None, Preemption::Full),
                         [](const auto &test) { return test.param == Preemption::None ? "none" : "os"; });

// If the wake-up was lost, the countdown would not end.
TEST_P(WaitProtocol, AnEventThatIsSetMeanwhileEndsTheWait) {
  expect_holds([] {
    AsyncEvent event;
    Countdown ended(1);
    WaitingMachine machine(GetParam(), [&]() -> Coroutine {
      co_await event;
      ended.count();
    });
    machine.start_calmly();
    const std::uint32_t setter = spawn([&] { event.set(); });
    machine.engine->release(TaskId(0), 0);
    ended.wait();
    explored::join(setter);
    explored::settle();
    explored::calm(true);
    machine.engine->halt();
    machine.engine->join();
    explored::check(machine.engine->figures(TaskId(0)).jobs.finished == 1, "the job did not end");
  });
}

// The engine ends while set() may still be on its way through it.
TEST_P(WaitProtocol, AHaltEndsTheWaitThatAnEventMayEnd) {
  expect_holds([] {
    AsyncEvent event;
    std::uint32_t setter = 0;
    {
      WaitingMachine machine(GetParam(), [&]() -> Coroutine { co_await event; });
      machine.start_calmly();
      explored::calm(true);
      machine.engine->release(TaskId(0), 0);
      explored::settle();
      explored::calm(false);
      setter = spawn([&] { event.set(); });
      machine.engine->halt();
      machine.engine->join();
      explored::check(machine.engine->started().empty(), "a job still waits");
    }
    explored::join(setter);
  });
}

// The halt comes between the wake-ups of one set_all(), or before, or after.
TEST(HaltProtocol, AHaltEndsTheWaitsThatOneCallEnds) {
  expect_holds([] {
    std::array<AsyncEvent, 2> events;
    std::size_t next = 0;
    WaitingMachine machine(
        Preemption::None, [&]() -> Coroutine { co_await events[next++]; }, 2);
    machine.start_calmly();
    explored::calm(true);
    machine.engine->release(TaskId(0), 0);
    machine.engine->release(TaskId(1), 0);
    explored::settle();
    explored::calm(false);
    const std::uint32_t setter = spawn([&] {
      AsyncEvent::set_all(std::array<AsyncEvent *, 2>{&events[0], &events[1]});
    });
    machine.engine->halt();
    machine.engine->join();
    explored::check(machine.engine->started().empty(), "a job still waits");
    explored::join(setter);
  });
}

// The halt comes while the alarm wakes a sleeper.
TEST_P(WaitProtocol, AHaltEndsTheWaitThatAnAlarmEnds) {
  ExploreOptions options;
  options.time_passes = true;
  const auto scenario = [] {
    WaitingMachine machine(GetParam(), [&]() -> Coroutine { co_await sleep_for(std::chrono::nanoseconds(1000)); });
    machine.start_calmly();
    explored::calm(true);
    machine.engine->release(TaskId(0), 0);
    explored::settle();
    explored::calm(false);
    explored::tick(1000);
    machine.engine->halt();
    machine.engine->join();
    explored::check(machine.engine->started().empty(), "a job still waits");
  };
  expect_holds(scenario, options);
}

}  // namespace
}  // namespace redag::model_check
