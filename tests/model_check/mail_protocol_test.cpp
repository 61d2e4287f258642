// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Explores mail that does not wake its thread: it is stolen, or looked after, whatever the other threads do.
#include "protocol.hpp"

namespace redag::model_check {
namespace {

using explored::spawn;

// Two workers and two tasks whose jobs are expected to be tiny.
class MailProtocol : public ::testing::TestWithParam<Preemption> {
 protected:
  struct Scenario {
    Scenario() : machine(ladder(2), Platform{GetParam(), 2}, {nullptr, nullptr}) {
      machine.start_calmly();
      machine.run_tiny_jobs(2);
    }
    /// Sets the first task's body: its first job from now on releases the second one, which does `last`. The thread
    /// itself takes that second job, and therefore looks for mail afterwards.
    void run_twice(std::function<void()> last) {
      machine.work(0) = [this, last = std::move(last), is_first = true](const Job &) mutable {
        if (std::exchange(is_first, false)) {
          machine.release(0);
        } else {
          last();
        }
        return Outcome::Finished;
      };
    }
    /// A tiny job releases one of the second task. This wakes a thread; the next time its mail is silent.
    void release_from_body_calmly() {
      run_twice([this] { machine.release(1); });
      explored::calm(true);
      machine.release(0);
      explored::settle();
      explored::calm(false);
    }
    Machine machine;
  };
};
INSTANTIATE_TEST_SUITE_P(Modes, MailProtocol, ::testing::Values(Preemption::None, Preemption::Cooperative),
                         [](const auto &instance) {
                           return std::string(instance.param == Preemption::None ? "none" : "cooperative");
                         });

// The job that was expected to be tiny goes on until the other one has run.
TEST_P(MailProtocol, SilentMailIsLookedAfter) {
  expect_holds([] {
    Scenario scenario;
    scenario.release_from_body_calmly();
    Machine &machine = scenario.machine;
    Countdown other(1);
    scenario.run_twice([&] {
      machine.release(1);
      other.wait();
    });
    machine.work(1) = [&](const Job &) {
      other.count();
      return Outcome::Finished;
    };
    machine.release(0);
    other.wait();
    machine.finish_calmly();
  });
}

// The job was expected to end once it has released the other one, which is less urgent. Only mode none lets that one
// wait for the decision.
TEST_P(MailProtocol, AJobThatWaitsForTheEndOfItsSenderIsLookedAfter) {
  expect_holds([] {
    Scenario scenario;
    Machine &machine = scenario.machine;
    machine.work(1) = [&](const Job &) {
      machine.release(0);
      return Outcome::Finished;
    };
    explored::calm(true);
    for (std::uint32_t i = 0; i < runtime::TaskEntry::kStreak; ++i) {
      machine.release(1);
      explored::settle();
    }
    explored::calm(false);
    Countdown other(1);
    machine.work(1) = [&](const Job &) {
      machine.release(0);
      other.wait();
      return Outcome::Finished;
    };
    machine.work(0) = [&](const Job &) {
      other.count();
      return Outcome::Finished;
    };
    machine.release(1);
    other.wait();
    machine.finish_calmly();
  });
}

// A halt while mail is silent, stolen, or looked after: the job has started and runs, or it never does.
TEST_P(MailProtocol, AHaltFindsSilentMail) {
  expect_holds([] {
    Scenario scenario;
    scenario.release_from_body_calmly();
    Countdown halted(1);
    scenario.run_twice([&] {
      scenario.machine.release(1);
      scenario.machine.engine->halt();
      halted.count();
    });
    scenario.machine.release(0);
    halted.wait();
    scenario.machine.finish_calmly();
  });
}

// Two threads compete for the lock, and one leaves its next job to the other.
TEST_P(MailProtocol, TinyJobsThatCompeteAllRun) {
  expect_holds([] {
    Scenario scenario;
    Machine &machine = scenario.machine;
    Countdown all(4);
    for (std::size_t t = 0; t < 2; ++t) {
      machine.work(t) = [&, t, again = true](const Job &) mutable {
        if (std::exchange(again, false)) machine.release(t);
        all.count();
        return Outcome::Finished;
      };
    }
    const std::uint32_t source = spawn([&] { machine.release(1); });
    machine.release(0);
    all.wait();
    explored::join(source);
    machine.finish_calmly();
  });
}

}  // namespace
}  // namespace redag::model_check
