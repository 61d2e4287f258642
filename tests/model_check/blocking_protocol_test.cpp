// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Explores every interleaving of jobs that block and lend their workers meanwhile: the call returns while the worker is
// being lent, while another job has it, and while the engine halts.
#include "protocol.hpp"
#include "redag/runtime/blocking.hpp"

namespace redag::model_check {
namespace {

using explored::spawn;

class BlockingProtocol : public ::testing::TestWithParam<Preemption> {
 protected:
  static Platform platform() {
    Platform one_worker{GetParam(), 1, 3};
    one_worker.spare_threads = 1;
    return one_worker;
  }
};
INSTANTIATE_TEST_SUITE_P(Modes, BlockingProtocol,
                         ::testing::Values(Preemption::None, Preemption::Cooperative, Preemption::Full),
                         [](const auto &test) {
                           if (test.param == Preemption::None) return "none";
                           return test.param == Preemption::Full ? "os" : "cooperative";
                         });

// If the wake-up was lost, the countdown would not end. The other job is the more urgent one.
TEST_P(BlockingProtocol, AJobGoesOnAfterItsCall) {
  expect_holds([] {
    Countdown ended(2);
    Countdown answer(1);
    bool lent = false;
    const auto client = [&](const Job &) {
      {
        const Blocking scope;
        lent = scope.lends();
        answer.wait();
      }
      ended.count();
      return Outcome::Finished;
    };
    const auto server = [&](const Job &) {
      answer.count();
      ended.count();
      return Outcome::Finished;
    };
    Machine machine(ladder(2), platform(), {client, server});
    machine.start_calmly();
    machine.release(0);
    machine.release(1);
    ended.wait();
    machine.finish_calmly();
    // On top of a job that has the worker, none can lend it. The client is the less urgent one, and never on top.
    explored::check(lent, "the worker was not lent");
    explored::check(machine.ran(0) == 1 && machine.ran(1) == 1, "a job did not run");
  });
}

// A thread outside ends the call at any point.
TEST_P(BlockingProtocol, AHaltWaitsForTheCall) {
  expect_holds([] {
    Countdown answer(1);
    const auto client = [&](const Job &) {
      const Blocking scope;
      answer.wait();
      return Outcome::Finished;
    };
    Machine machine(ladder(1), platform(), {client});
    machine.start_calmly();
    const std::uint32_t setter = spawn([&] { answer.count(); });
    machine.release(0);
    machine.finish();
    explored::join(setter);
  });
}

// The more urgent job blocks, and goes on while the other one has the worker and reaches a preemption point.
TEST_P(BlockingProtocol, AtMostOneJobHasTheWorker) {
  if (GetParam() == Preemption::Full) GTEST_SKIP() << "the kernel decides which of two threads runs";
  expect_holds([] {
    Countdown ended(2);
    Room worker(1);
    const auto client = [&](const Job &) {
      { const Blocking scope; }
      worker.enter();
      worker.leave();
      ended.count();
      return Outcome::Finished;
    };
    const auto other = [&](const Job &) {
      worker.enter();
      worker.leave();
      preemption_point();
      worker.enter();
      worker.leave();
      ended.count();
      return Outcome::Finished;
    };
    Machine machine(ladder(2), platform(), {other, client});
    machine.start_calmly();
    machine.release(1);
    machine.release(0);
    ended.wait();
    machine.finish_calmly();
  });
}

// The second job to block finds no thread left where there is one spare thread, and keeps its worker.
TEST_P(BlockingProtocol, TwoJobsBlock) {
  expect_holds([] {
    Countdown ended(2);
    const auto client = [&](const Job &) {
      { const Blocking scope; }
      ended.count();
      return Outcome::Finished;
    };
    Machine machine(ladder(2), platform(), {client, client});
    machine.start_calmly();
    machine.release(0);
    machine.release(1);
    ended.wait();
    machine.finish_calmly();
  });
}

}  // namespace
}  // namespace redag::model_check
