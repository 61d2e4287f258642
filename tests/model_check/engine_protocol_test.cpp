// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Explores every interleaving of small uses of the engine: releasing jobs, giving them to threads, running and
// preempting them, and halting the engine.
#include <array>
#include <stdexcept>

#include "protocol.hpp"
#include "redag/threads/clock.hpp"
#include "redag/threads/threads.hpp"

namespace redag::model_check {
namespace {

using explored::spawn;

std::string name_of(Preemption preemption) {
  if (preemption == Preemption::None) return "none";
  return preemption == Preemption::Cooperative ? "cooperative" : "os";
}

class EngineProtocol : public ::testing::TestWithParam<Preemption> {
 protected:
  static Platform platform(std::uint32_t workers) { return {GetParam(), workers, workers + 1, false, 0, 0}; }
};
INSTANTIATE_TEST_SUITE_P(Modes, EngineProtocol,
                         ::testing::Values(Preemption::None, Preemption::Cooperative, Preemption::Full),
                         [](const auto &instance) { return name_of(instance.param); });

// Only a job's own wake-up makes it run. If one is lost, the wait does not end.
void what_is_released_runs_once(const Platform &platform) {
  Countdown all(3);
  const auto work = [&](const Job &) {
    all.count();
    return Outcome::Finished;
  };
  Machine machine(ladder(3), platform, {work, work, work});
  machine.start_calmly();
  const std::uint32_t source = spawn([&] { machine.release(0); });
  machine.release(1);
  machine.release(2);
  all.wait();
  explored::join(source);
  machine.finish_calmly();
  for (std::size_t t = 0; t < 3; ++t) explored::check(machine.ran(t) == 1, "a job did not run");
}

TEST_P(EngineProtocol, WhatIsReleasedRunsOnce) {
  expect_holds([] { what_is_released_runs_once(platform(2)); });
}

class SpinningThreads : public EngineProtocol {};
INSTANTIATE_TEST_SUITE_P(Modes, SpinningThreads, ::testing::Values(Preemption::None, Preemption::Cooperative),
                         [](const auto &instance) { return name_of(instance.param); });

// A job is given to a thread that still looks for one, or that has just looked for the last time.
TEST_P(SpinningThreads, RunWhatIsReleased) {
  expect_holds([] {
    Platform looking = platform(1);
    looking.spins = 2;
    what_is_released_runs_once(looking);
  });
}

TEST_P(EngineProtocol, WhatIsReleasedRunsThoughSleepersWakeForNoReason) {
  expect_holds(
      [] {
        Countdown all(2);
        const auto work = [&](const Job &) {
          all.count();
          return Outcome::Finished;
        };
        Machine machine(ladder(2), platform(1), {work, work});
        machine.start_calmly();
        machine.release(0);
        machine.release(1);
        all.wait();
        machine.finish_calmly();
      },
      ExploreOptions{true, 50'000'000, 1, false});
}

// A release before the threads exist, while they start, and after.
TEST_P(EngineProtocol, AReleaseDuringTheStartIsNotLost) {
  expect_holds([] {
    Countdown all(1);
    Machine machine(ladder(1), platform(2), {[&](const Job &) {
                      all.count();
                      return Outcome::Finished;
                    }});
    const std::uint32_t source = spawn([&] { machine.release(0); });
    machine.start();
    all.wait();
    explored::join(source);
    machine.finish_calmly();
  });
}

// The halt and the end of the threads at every point of a run.
TEST_P(EngineProtocol, NothingRunsOnceItIsIdleAfterAHalt) {
  expect_holds([] {
    Machine machine(ladder(2), platform(1), {nullptr, nullptr});
    machine.start_calmly();
    const std::uint32_t source = spawn([&] { machine.release(0); });
    machine.release(1);
    machine.finish();
    explored::join(source);
    machine.release(1);  // ignored after the halt
  });
}

TEST_P(EngineProtocol, AHaltFindsTwoThreadsAtWork) {
  expect_holds([] {
    Machine machine(ladder(2), platform(2), {nullptr, nullptr});
    machine.start_calmly();
    machine.release(0);
    machine.release(1);
    machine.finish();
  });
}

// Joins without waiting first, as the destructor does.
TEST_P(EngineProtocol, JoinWaitsForWhatHasStarted) {
  expect_holds([] {
    Machine machine(ladder(2), platform(1), {nullptr, nullptr});
    machine.start_calmly();
    const std::uint32_t source = spawn([&] { machine.release(0); });
    machine.release(1);
    explored::join(source);
    machine.engine->halt();
    machine.engine->join();
    machine.quiet.begin();
    explored::check(machine.engine->started().empty(), "its threads have ended, and a job has not");
    explored::check(machine.engine->figures(TaskId(0)).jobs.finished == machine.ran(0),
                    "a job that ran is not counted");
  });
}

// The thread looks for its first mail while the job is posted and the threads are told to end.
TEST_P(EngineProtocol, JoinWaitsForWhatHasStartedBeforeItsThreadHas) {
  expect_holds([] {
    Machine machine(ladder(1), platform(1), {nullptr});
    machine.start();
    machine.release(0);
    machine.engine->halt();
    machine.engine->join();
    machine.quiet.begin();
    explored::check(machine.engine->started().empty(), "its threads have ended, and a job has not");
  });
}

// A release that began before the halt decides while the threads are told to end.
TEST_P(EngineProtocol, JoinWaitsForADecisionUnderWay) {
  expect_holds([] {
    Machine machine(ladder(1), platform(1), {nullptr});
    machine.start_calmly();
    const std::uint32_t source = spawn([&] { machine.release(0); });
    machine.engine->halt();
    machine.engine->join();
    machine.quiet.begin();
    explored::join(source);
    explored::check(machine.engine->started().empty(), "its threads have ended, and a job was handed to one");
  });
}

TEST_P(EngineProtocol, AHaltFromABodyEndsTheRun) {
  expect_holds([] {
    Countdown halted(1);
    bool over = false;
    Machine machine(ladder(3), platform(2), {nullptr, nullptr, nullptr});
    machine.work(2) = [&](const Job &) {
      machine.release(0);
      machine.engine->halt();
      over = true;
      machine.release(0);
      halted.count();
      return Outcome::Finished;
    };
    machine.work(0) = [&](const Job &job) {
      explored::check(!over || job.number == 0, "a job was released after the halt, and ran");
      return Outcome::Finished;
    };
    machine.start_calmly();
    const std::uint32_t source = spawn([&] {
      machine.release(1);
      machine.release(2);
    });
    halted.wait();
    explored::check(machine.engine->wait_idle(kNever), "wait_idle() for ever came back without");
    machine.quiet.begin();
    explored::join(source);
    machine.quiet.end();
    machine.finish_calmly();
  });
}

// Three tasks. Two of them belong to a DAG that runs one job at a time, and two of the three share a group.
TEST_P(EngineProtocol, BoundsAndGroupsHold) {
  expect_holds([] {
    Room dag(1);
    Room group(1);
    Countdown all(3);
    Workload workload = ladder(2);
    workload.dags[0].max_active = 1;
    workload.dags.push_back(ladder(1).dags[0]);
    workload.dags[1].name = "other";
    workload.dags[0].tasks[1].group = "g";
    workload.dags[1].tasks[0].group = "g";
    workload.dags[1].tasks[0].priority = 2;
    const auto in = [&](bool first_dag, bool grouped) {
      return [&, first_dag, grouped](const Job &) {
        if (first_dag) dag.enter();
        if (grouped) group.enter();
        preemption_point();
        if (grouped) group.leave();
        if (first_dag) dag.leave();
        all.count();
        return Outcome::Finished;
      };
    };
    Machine machine(workload, platform(2), {in(true, false), in(true, true), in(false, true)});
    machine.start_calmly();
    const std::uint32_t source = spawn([&] { machine.release(1); });
    machine.release(2);
    machine.release(0);
    all.wait();
    explored::join(source);
    machine.finish_calmly();
  });
}

// One worker. The low job is preempted wherever the mode allows it, and always resumes.
TEST_P(EngineProtocol, PreemptedJobsResume) {
  expect_holds([] {
    Countdown all(3);
    std::vector<std::size_t> open;  // cooperative: jobs on the one stack
    const auto work = [&](std::size_t t) {
      return [&, t](const Job &) {
        open.push_back(t);
        preemption_point();
        preemption_point();
        explored::check(GetParam() != Preemption::Cooperative || open.back() == t, "resumed out of order");
        open.pop_back();
        all.count();
        return Outcome::Finished;
      };
    };
    Machine machine(ladder(3), Platform{GetParam(), 1, 3, false, 0}, {work(0), work(1), work(2)});
    machine.start_calmly();
    machine.release(0);
    const std::uint32_t source = spawn([&] { machine.release(2); });
    machine.release(1);
    all.wait();
    explored::join(source);
    machine.finish_calmly();
  });
}

// A task's next job waits for the previous one, and successors get their data.
TEST_P(EngineProtocol, ChainsRunInTheirOrder) {
  expect_holds([] {
    Workload workload = ladder(2);
    workload.dags[0].tasks[1].activation = Activation::Data;
    workload.dags[0].tasks[1].predecessors = {0};
    Countdown ends(1);
    int begun = 0;
    int done = 0;
    Room first(1);
    Machine machine(workload, platform(2),
                    {[&](const Job &) {
                       first.enter();
                       ++begun;
                       first.leave();
                       return Outcome::Finished;
                     },
                     [&](const Job &) {
                       explored::check(++done <= begun, "a successor ran before its predecessor");
                       ends.count();
                       return Outcome::Finished;
                     }});
    machine.start_calmly();
    machine.release(0);
    const std::uint32_t source = spawn([&] { machine.release(0); });
    machine.engine->miss(TaskId(0), 0, Reason::Overrun);
    ends.wait();
    explored::join(source);
    machine.finish_calmly();
  });
}

// A thread goes from job to job of a chain without a look at its mail, while another thread releases and halts.
TEST_P(EngineProtocol, AHaltMeetsAChainThatIsHandedOver) {
  expect_holds([] {
    Workload workload = ladder(3);
    for (std::uint32_t t = 1; t < 3; ++t) {
      workload.dags[0].tasks[t].activation = Activation::Data;
      workload.dags[0].tasks[t].predecessors = {t - 1};
    }
    Machine machine(workload, platform(1), {nullptr, nullptr, nullptr});
    machine.start_calmly();
    const std::uint32_t source = spawn([&] { machine.release(0); });
    machine.finish();
    explored::join(source);
    explored::check(machine.ran(1) <= machine.ran(0) && machine.ran(2) <= machine.ran(1), "a job has no data");
  });
}

// The last task's body releases a job while one worker is free and its thread sleeps. The thread that is first free and
// awake begins the job. A thread whose job was stolen may be given another one.
TEST_P(EngineProtocol, AJobIsBegunByItsThreadOrByOneThatIsFreeBefore) {
  int own = 0;
  int stolen = 0;
  expect_holds([&] {
    Countdown all(3);
    std::vector<std::uint32_t> begun_by(3);
    const auto work = [&](std::size_t t) {
      return [&, t](const Job &) {
        begun_by[t] = explored::self();
        all.count();
        return Outcome::Finished;
      };
    };
    Machine machine(ladder(3), platform(2), {work(0), work(1), nullptr});
    machine.work(2) = [&, note = work(2)](const Job &job) {
      machine.release(1);
      return note(job);
    };
    machine.start_calmly();
    const std::uint32_t source = spawn([&] { machine.release(0); });
    machine.release(2);
    all.wait();
    explored::join(source);
    machine.finish_calmly();
    for (std::size_t t = 0; t < 3; ++t) explored::check(machine.ran(t) == 1, "a job did not run");
    ++(begun_by[1] == begun_by[2] ? stolen : own);
  });
  EXPECT_GT(own, 0);
  EXPECT_GT(stolen, 0);
}

TEST_P(EngineProtocol, AnExceptionEndsItsJobAlone) {
  expect_holds([] {
    Countdown all(2);
    Machine machine(ladder(2), platform(1),
                    {[&](const Job &) {
                       all.count();
                       return Outcome::Finished;
                     },
                     [&](const Job &) -> Outcome {
                       all.count();
                       throw std::runtime_error("on purpose");
                     }});
    machine.start_calmly();
    const std::uint32_t source = spawn([&] { machine.release(1); });
    machine.release(0);
    all.wait();
    explored::join(source);
    machine.finish_calmly();
    explored::check(machine.exceptions == 1, "an exception was told more or less than once");
  });
}

// wait_idle() with a deadline: the result is correct whether the deadline passes or not.
TEST_P(EngineProtocol, WaitIdleWithADeadline) {
  expect_holds(
      [] {
        Machine machine(ladder(2), platform(1), {nullptr, nullptr});
        machine.start_calmly();
        machine.release(0);
        machine.release(1);
        machine.engine->halt();
        if (machine.engine->wait_idle(5)) {
          machine.quiet.begin();
          machine.quiet.end();
        }
        machine.finish();
      },
      ExploreOptions{true, 50'000'000, 0, true});
}

// Events are drained while jobs run. None is lost, and each job's events are in order.
TEST_P(EngineProtocol, EventsAreDrainedInOrder) {
  expect_holds([] {
    Countdown all(2);
    const auto work = [&](const Job &) {
      all.count();
      return Outcome::Finished;
    };
    Platform with_trace = platform(1);
    with_trace.trace_capacity = 64;
    Machine machine(ladder(2), with_trace, {work, work});
    machine.start_calmly();
    machine.release(0);
    machine.release(1);
    std::vector<JobEvent> events;
    machine.engine->drain(events);
    all.wait();
    machine.finish_calmly();
    machine.engine->drain(events, true);
    for (std::size_t t = 0; t < 2; ++t) {
      std::vector<JobEventKind> kinds;
      for (const JobEvent &event : events) {
        if (event.task.value == t && event.kind != JobEventKind::Preempted && event.kind != JobEventKind::Resumed) {
          kinds.push_back(event.kind);
        }
      }
      const std::vector<JobEventKind> expected{JobEventKind::Released, JobEventKind::Ready,    JobEventKind::Dispatched,
                                               JobEventKind::Started,  JobEventKind::Executed, JobEventKind::Finished};
      explored::check(kinds == expected, "the events of a job are not in their order");
    }
    explored::check(machine.engine->lost_events() == 0, "an event was lost");
  });
}

TEST(EngineStart, AThreadThatCannotBeHadEndsTheOthers) {
  expect_holds([] {
    runtime::thread_that_fails = "redag-1";
    Machine machine(ladder(1), Platform{Preemption::None, 2, 0, false, 0}, {nullptr});
    const std::uint32_t source = spawn([&] { machine.release(0); });
    explored::check(!machine.engine->start().has_value(), "a thread failed, and nobody says so");
    explored::join(source);
    explored::check(!machine.engine->halting(), "halted");
    explored::check(machine.ran(0) == 0, "a job ran");
    runtime::thread_that_fails.reset();
    explored::check(machine.engine->start().has_value(), "it cannot be started again");
    machine.finish_calmly();
    explored::check(machine.ran(0) == 1, "what was released did not run");
  });
}

// Two jobs are in progress when tasks above both are added: both get lower priorities. The more urgent one is the first
// in the scheduler's tables.
TEST(EngineProtocolLevels, NoPriorityIsInvertedWhileLevelsChange) {
  int changes = 0;
  expect_holds([&] {
    std::array<int, 16> priorities{};  // indexed by the explorer's threads, which begin with that of the first level
    priorities.fill(8);
    std::optional<std::uint32_t> urgent;
    std::optional<std::uint32_t> other;
    runtime::on_set_priority = [&](std::uint32_t thread, int priority) {
      priorities.at(thread) = priority;
      if (!urgent || !other) return;
      ++changes;
      explored::check(priorities.at(*urgent) > priorities.at(*other), "a thread is below one of a less urgent job");
    };
    Countdown begun(2);
    Countdown may_end(1);
    Workload workload = ladder(2);
    std::swap(workload.dags[0].tasks[0].priority, workload.dags[0].tasks[1].priority);
    Machine machine(workload, {Preemption::Full, 2, 4, false, 0},
                    {[&](const Job &) {
                       urgent = explored::self();
                       begun.count();
                       may_end.wait();
                       return Outcome::Finished;
                     },
                     [&](const Job &) {
                       other = explored::self();
                       begun.count();
                       may_end.wait();
                       return Outcome::Finished;
                     }});
    machine.start_calmly();
    explored::calm(true);
    machine.release(0);
    machine.release(1);
    begun.wait();
    explored::settle();
    Workload above = ladder(4);
    for (Task &task : above.dags[0].tasks) task.priority = *task.priority + 10;
    const runtime::Body nothing = [](const Job &) { return Outcome::Finished; };
    machine.engine->add_dag(above.dags[0], {nothing, nothing, nothing, nothing});
    machine.engine->resume();  // decides
    urgent.reset();
    other.reset();
    explored::calm(false);
    may_end.count();
    machine.finish_calmly();
  });
  runtime::on_set_priority = nullptr;
  EXPECT_GE(changes, 2);
}

// The watchdog looks while jobs begin, are preempted and end. It reports only jobs in progress, and each limit only
// once.
TEST_P(EngineProtocol, AWatchdogSeesOnlyJobsInProgress) {
  expect_holds([] {
    Workload workload = ladder(2);
    for (Task &task : workload.dags[0].tasks) {
      task.budget = 1;
      task.on_budget = OnBudget::Log;
    }
    runtime::cpu_of_others = kSecond;  // every look finds a budget exceeded
    Countdown all(2);
    std::array<int, 2> begun{};
    const auto work = [&](const Job &job) {
      ++begun[job.task.value];
      preemption_point();
      all.count();
      return Outcome::Finished;
    };
    Platform with_events = platform(1);
    with_events.trace_capacity = 32;
    Machine machine(workload, with_events, {work, work});
    machine.start_calmly();
    const std::uint32_t watcher = spawn([&] {
      std::vector<runtime::OverdueJob> named;
      for (int look = 0; look < 2; ++look) machine.engine->watch({1, 0}, kSecond, named);
      for (const runtime::OverdueJob &job : named) {
        explored::check(begun[job.job.task.value] == 1, "a job is named that has not begun");
      }
      explored::check(named.size() <= 2, "a job is named twice");
    });
    machine.release(0);
    machine.release(1);
    all.wait();
    explored::join(watcher);
    machine.finish_calmly();
    std::vector<JobEvent> events;
    machine.engine->drain(events, true);
    std::array<int, 2> told{};
    for (const JobEvent &event : events) {
      if (event.kind == JobEventKind::Exceeded) ++told[event.task.value];
    }
    explored::check(told[0] <= 1 && told[1] <= 1, "a limit is told twice");
  });
}

}  // namespace
}  // namespace redag::model_check
