// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Explores every interleaving of pausing, stepping and reconfiguring an engine at work.
#include <deque>

#include "protocol.hpp"

namespace redag::model_check {
namespace {

using explored::spawn;

constexpr Preemption kModes[] = {Preemption::None, Preemption::Cooperative, Preemption::Full};

Platform platform(Preemption preemption, std::uint32_t workers) { return {preemption, workers, workers + 1, false, 0}; }

// From wait_paused() to resume() no job is in progress. Jobs that are released meanwhile run afterwards.
TEST(PauseProtocol, PausedNothingRunsAndAfterwardsEverythingDoes) {
  for (const Preemption preemption : kModes) {
    expect_holds([&] {
      Countdown all(2);
      const auto work = [&](const Job &) {
        preemption_point();
        all.count();
        return Outcome::Finished;
      };
      Machine machine(ladder(2), platform(preemption, 1), {work, work});
      machine.start_calmly();
      const std::uint32_t source = spawn([&] { machine.release(1); });
      machine.release(0);
      machine.engine->pause();
      explored::check(machine.engine->wait_paused(kNever), "nobody resumed, and it did not wait");
      machine.quiet.begin();
      machine.quiet.end();
      machine.engine->resume();
      all.wait();
      explored::join(source);
      machine.finish_calmly();
    });
  }
}

TEST(PauseProtocol, WaitPausedEndsWhenItIsResumedOrInTime) {
  for (const Preemption preemption : kModes) {
    expect_holds(
        [&] {
          Machine machine(ladder(1), platform(preemption, 1), {nullptr});
          machine.start_calmly();
          machine.release(0);
          machine.engine->pause();
          const std::uint32_t resumer = spawn([&] { machine.engine->resume(); });
          static_cast<void>(machine.engine->wait_paused(kNever));
          explored::join(resumer);
          machine.engine->pause();
          if (machine.engine->wait_paused(5)) {
            machine.quiet.begin();
            machine.quiet.end();
          }
          machine.engine->resume();
          machine.finish_calmly();
        },
        ExploreOptions{true, 50'000'000, 0, true});
  }
}

// The job ends only after the wait: resume() must end the wait.
TEST(PauseProtocol, ResumeEndsAWaitThoughAJobGoesOn) {
  for (const Preemption preemption : kModes) {
    expect_holds([&] {
      Countdown begun(1);
      Countdown waited(1);
      Machine machine(ladder(1), platform(preemption, 1), {[&](const Job &) {
                        begun.count();
                        waited.wait();
                        return Outcome::Finished;
                      }});
      machine.start_calmly();
      machine.release(0);
      begun.wait();
      machine.engine->pause();
      const std::uint32_t resumer = spawn([&] { machine.engine->resume(); });
      explored::check(!machine.engine->wait_paused(kNever), "a job goes on, and it is said to be paused");
      waited.count();
      explored::join(resumer);
      machine.finish_calmly();
    });
  }
}

// run_one() executes one job on this thread while another releases jobs. The workers execute the others after resume().
TEST(PauseProtocol, RunOneTakesOneJobThatNobodyElseRuns) {
  for (const Preemption preemption : kModes) {
    expect_holds([&] {
      Countdown all(3);
      const auto work = [&](const Job &) {
        preemption_point();
        all.count();
        return Outcome::Finished;
      };
      Machine machine(ladder(3), platform(preemption, 2), {work, work, work});
      machine.start_calmly();
      machine.engine->pause();
      machine.release(0);
      const std::uint32_t source = spawn([&] { machine.release(1); });
      machine.release(2);
      explored::check(machine.engine->run_one(), "there was a job to run");
      explored::check(machine.ran(2) == 1, "it was not the most urgent one");
      explored::check(machine.ran(0) == 0 && machine.ran(1) == 0, "another job ran in the pause");
      machine.engine->resume();
      all.wait();
      explored::join(source);
      machine.finish_calmly();
    });
  }
}

// A halt meets a pause, and neither waits for the other.
TEST(PauseProtocol, AHaltEndsAPause) {
  for (const Preemption preemption : kModes) {
    expect_holds([&] {
      Machine machine(ladder(2), platform(preemption, 1), {nullptr, nullptr});
      machine.start_calmly();
      const std::uint32_t source = spawn([&] {
        machine.release(0);
        machine.engine->halt();
      });
      machine.release(1);
      machine.engine->pause();
      explored::check(machine.engine->wait_paused(kNever), "not paused");
      static_cast<void>(machine.engine->run_one());
      machine.engine->resume();
      explored::join(source);
      machine.finish_calmly();
    });
  }
}

// Ids are reused. A body lives until the last of its jobs has ended, and no longer.
TEST(TaskProtocol, ATaskThatIsRemovedEndsItsJobsAndThenItsBody) {
  for (const Preemption preemption : kModes) {
    expect_holds([&] {
      runtime::EngineOptions options;
      options.config.workers = 1;
      options.config.preemption = preemption;
      options.config.policy = PolicyKind::RateMonotonic;
      options.config.reuse_ids = true;
      if (preemption == Preemption::Full) {
        options.config.max_started = 2;
        options.config.levels = 8;
        options.band = runtime::PriorityBand{8, 9};
      }
      struct Record {
        testing::ObjectId object = explored::new_object();
        bool destroyed = false;
      };
      std::deque<Record> records;
      std::vector<std::weak_ptr<Record>> bodies;
      int ran = 0;
      {
        Engine engine(std::make_unique<sched::PriorityScheduler>(Workload{}, options.config), options);
        const DagId dag = engine.add_dag(Dag{}, {}).dag;
        explored::calm(true);
        explored::check(engine.start().has_value(), "the engine does not start");
        explored::settle();
        explored::calm(false);
        Task task;
        task.period = task.deadline = kSecond;
        const auto add = [&] {
          std::shared_ptr<Record> alive(&records.emplace_back(), [](Record *it) { it->destroyed = true; });
          bodies.emplace_back(alive);
          return engine
              .add_tasks({{dag, 0, task,
                           [&ran, alive = std::move(alive)](const Job &) {
                             // Reads the captures first: they no longer exist if the body is destroyed while it runs.
                             Record &record = *alive;
                             int &count = ran;
                             explored::write(record.object, "body begins");
                             preemption_point();
                             explored::write(record.object, "body ends");
                             explored::check(!record.destroyed, "a body was destroyed while it ran");
                             ++count;
                             return Outcome::Finished;
                           }}})
              .front();
        };
        const TaskId steady = add();
        const std::uint32_t source = spawn([&] { engine.release(steady, 0); });
        const TaskId first = add();
        engine.release(first, 0);
        engine.remove_task(first);
        const TaskId second = add();
        engine.release(second, 0);
        engine.set_timing(second, kSecond / 2, kSecond / 2);
        explored::join(source);
        explored::settle();
        explored::check(bodies[1].expired(), "the body of a removed task lives on");
        explored::check(!bodies[0].expired() && !bodies[2].expired(), "the body of a task is gone");
        explored::check(ran == 2 || ran == 3, "a job was lost");
        explored::calm(true);
        engine.halt();
        explored::check(engine.wait_idle(kNever), "wait_idle() for ever came back without");
      }
      for (const auto &body : bodies) explored::check(body.expired(), "a body outlives the engine");
    });
  }
}

TEST(TaskProtocol, ADagThatIsRemovedFromItsOwnBody) {
  for (const Preemption preemption : kModes) {
    expect_holds([&] {
      Countdown all(1);
      Machine machine(ladder(1), platform(preemption, 1), {nullptr});
      machine.work(0) = [&](const Job &) {
        machine.engine->remove_dag(DagId(0));
        machine.release(0);  // ignored: the task is removed
        all.count();
        return Outcome::Finished;
      };
      machine.start_calmly();
      const std::uint32_t source = spawn([&] {
        machine.release(0);
        const runtime::AddedDag added =
            machine.engine->add_dag(ladder(1).dags[0], {[](const Job &) { return Outcome::Finished; }});
        machine.engine->release(added.tasks[0], 0);
        machine.engine->remove_dag(added.dag);
      });
      all.wait();
      explored::join(source);
      machine.finish_calmly();
      explored::check(machine.ran(0) == 1, "a removed task ran");
    });
  }
}

}  // namespace
}  // namespace redag::model_check
