// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Real-time throttling on threads: which jobs are demoted before the kernel takes a processor from all. The test sets
// what the kernel leaves, mostly nothing. Jobs that can be demoted are then demoted all the time.
#include <gtest/gtest.h>
#include <sched.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <optional>
#include <thread>
#include <vector>

#include "redag/runtime/clock.hpp"
#include "redag/runtime/engine.hpp"
#include "redag/runtime/parker.hpp"
#include "redag/runtime/threads.hpp"
#include "redag/sched/priority_scheduler.hpp"

namespace redag::runtime {
namespace {

using sched::Outcome;

constexpr Throttling kNothingIsLeft{0, 20'000};

// An engine for two DAGs of one task each; the second one is more urgent.
class EngineShare : public ::testing::Test {
 protected:
  void SetUp() override {
    if (band_.top_job == 0) GTEST_SKIP() << "this process may not use SCHED_FIFO";
  }

  void start(const Throttling &throttling, Criticality first, Criticality second, std::vector<Body> bodies,
             const std::string &group = "", std::uint32_t workers = 1) {
    Workload workload;
    workload.policy = PolicyKind::Fixed;
    for (const Criticality criticality : {first, second}) {
      Dag &dag = workload.dags.emplace_back();
      dag.criticality = criticality;
      Task &task = dag.tasks.emplace_back();
      task.period = task.deadline = task.wcet = kSecond;
      task.priority = static_cast<int>(workload.dags.size());
      task.group = group;
    }
    EngineOptions options;
    options.config = make_config(Mode{PreemptionMode::Os, {}}, workers, workload.policy, band_, 4);
    options.band = band_;
    options.throttling = throttling;
    engine_ = std::make_unique<Engine>(std::make_unique<sched::PriorityScheduler>(workload, options.config), options);
    engine_->bind(workload, std::move(bodies));
    ASSERT_TRUE(engine_->start());
    engine_->set_origin(monotonic_now());
  }

  void release(std::size_t task) { engine_->release(TaskId(task), engine_->now()); }
  void finish() {
    engine_->halt();
    ASSERT_TRUE(engine_->wait_idle(kNever));
    engine_->join();
  }

  // For a body: waits for the condition, and returns false if it does not come true for a long time.
  template <typename Condition>
  static bool wait_for(Condition condition) {
    const Time end = monotonic_now() + 20 * kSecond;
    while (!condition()) {
      if (monotonic_now() > end) return false;
    }
    return true;
  }
  static int own_priority() { return fifo_priority(pthread_self()); }

  const PriorityBand band_ = probe_priority_band();
  std::unique_ptr<Engine> engine_;
};

// Jobs of lower criticality run one after the other on one thread, which moves to the other processor in between. One
// of the processors is busy all the time, and each is busy for half of it. One run without interference from the
// machine is enough.
TEST_F(EngineShare, EachProcessorCountsByItself) {
  const std::vector<int> cpus = usable_cpus();
  if (cpus.size() < 2) GTEST_SKIP() << "one processor is all of them";
  if (this_threads_processor() == nullptr) GTEST_SKIP() << "this system does not say where threads run";
  const auto move_to = [&](int job) {
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET(static_cast<std::size_t>(cpus[cpus.size() - 1 - static_cast<std::size_t>(job % 2)]), &one);
    EXPECT_EQ(sched_setaffinity(0, sizeof(one), &one), 0);
  };
  bool kept = false;
  for (int attempt = 0; attempt < 50 && !kept; ++attempt) {
    constexpr int kJobs = 40;
    int ran = 0;
    Event done;
    // A credit of 20 ms; 670 ms are refilled in a second.
    start(Throttling{700'000, 1'000'000}, Criticality::Low, Criticality::High,
          {[&](const Job &) {
             const Time begin = monotonic_now();
             while (monotonic_now() - begin < 5 * kMillisecond) {
             }
             if (++ran < kJobs) {
               release(0);
             } else {
               done.set();
             }
             move_to(ran);
             return Outcome::Finished;
           },
           [](const Job &) { return Outcome::Finished; }},
          "", 2);
    release(0);
    done.wait();
    finish();
    kept = engine_->gave_way() == 0;
  }
  EXPECT_TRUE(kept);
}

// Keeps the calling thread, and threads that it starts, on one processor for its lifetime.
class OnOneProcessor {
 public:
  OnOneProcessor() {
    EXPECT_EQ(sched_getaffinity(0, sizeof(before_), &before_), 0);
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET(static_cast<std::size_t>(usable_cpus().back()), &one);
    EXPECT_EQ(sched_setaffinity(0, sizeof(one), &one), 0);
  }
  ~OnOneProcessor() { sched_setaffinity(0, sizeof(before_), &before_); }
  OnOneProcessor(const OnOneProcessor &) = delete;
  OnOneProcessor &operator=(const OnOneProcessor &) = delete;

 private:
  cpu_set_t before_{};
};

TEST_F(EngineShare, AJobOfLowerCriticalityGivesWayAndComesBack) {
  bool gave_way = false;
  bool came_back = false;
  // A credit of 20 ms; 170 ms are refilled in a second.
  start(Throttling{200'000, 1'000'000}, Criticality::Normal, Criticality::High,
        {[&](const Job &) {
           gave_way = wait_for([] { return own_priority() == 0; });
           came_back = wait_for([] { return own_priority() > 0; });
           return Outcome::Finished;
         },
         [](const Job &) { return Outcome::Finished; }});
  release(0);
  finish();
  EXPECT_TRUE(gave_way);
  EXPECT_TRUE(came_back);
  EXPECT_GT(engine_->gave_way(), 10 * kMillisecond);
  EXPECT_EQ(engine_->refused_priorities(), 0U);
}

TEST_F(EngineShare, AJobOfHighCriticalityNeverDoes) {
  std::atomic<bool> stop{false};
  std::atomic<int> ordinary{0};
  std::atomic<int> ran{0};
  bool gave_way = false;
  start(kNothingIsLeft, Criticality::Low, Criticality::High,
        {[&](const Job &) {
           gave_way = wait_for([] { return own_priority() == 0; });
           static_cast<void>(wait_for([&] { return stop.load(); }));
           return Outcome::Finished;
         },
         [&](const Job &) {
           if (own_priority() != band_.of_level(0)) ++ordinary;
           ++ran;
           return Outcome::Finished;
         }});
  release(0);
  for (int i = 1; i <= 50; ++i) {
    release(1);
    while (ran < i) std::this_thread::yield();
  }
  stop = true;
  finish();
  EXPECT_TRUE(gave_way);
  EXPECT_EQ(ordinary, 0);
}

// The job takes the only processor from the ordinary thread that releases it, in the middle of the release. It keeps it
// until the kernel serves ordinary threads again: up to a second, by chance less.
TEST_F(EngineShare, AJobGivesWayThatPreemptsWhoReleasesIt) {
  const OnOneProcessor one;
  for (int round = 0; round < 5; ++round) {
    Duration used = kNever;
    start(kNothingIsLeft, Criticality::Low, Criticality::High,
          {[&](const Job &) {
             const Time begin = thread_cpu_now();
             if (wait_for([] { return own_priority() == 0; })) used = thread_cpu_now() - begin;
             return Outcome::Finished;
           },
           [](const Job &) { return Outcome::Finished; }});
    release(0);
    finish();
    EXPECT_LT(used, 100 * kMillisecond);
  }
}

// A thread keeps a higher priority for a job that is expected to be short, but not for a demoted job.
TEST_F(EngineShare, ShortJobsDoToo) {
  constexpr int kRounds = 300;
  std::atomic<int> ran{0};
  std::atomic<bool> gives_way{false};
  int realtime = 0;
  start(kNothingIsLeft, Criticality::Low, Criticality::High,
        {[&](const Job &) {
           if (!gives_way) {
             gives_way = wait_for([] { return own_priority() == 0; });
           } else if (own_priority() > 0) {
             ++realtime;
           }
           ++ran;
           return Outcome::Finished;
         },
         [&](const Job &) {
           ++ran;
           return Outcome::Finished;
         }});
  for (int i = 0; i < kRounds; ++i) {
    release(static_cast<std::size_t>(i % 2));
    while (ran <= i) std::this_thread::yield();
  }
  finish();
  EXPECT_TRUE(gives_way);
  EXPECT_EQ(realtime, 0);
}

// Without inheritance, ordinary threads would preempt the job while the urgent one waits.
TEST_F(EngineShare, AJobThatAnUrgentOneWaitsForIsRaised) {
  std::atomic<bool> is_ordinary{false};
  int raised = 0;
  std::atomic<bool> after{false};
  start(kNothingIsLeft, Criticality::Low, Criticality::High,
        {[&](const Job &) {
           is_ordinary = wait_for([] { return own_priority() == 0; });
           static_cast<void>(wait_for([] { return own_priority() > 0; }));
           raised = own_priority();
           return Outcome::Finished;
         },
         [&](const Job &) {
           after = true;
           return Outcome::Finished;
         }},
        "shared");
  release(0);
  ASSERT_TRUE(wait_for([&] { return is_ordinary.load(); }));
  release(1);
  ASSERT_TRUE(wait_for([&] { return after.load(); }));
  finish();
  EXPECT_EQ(raised, band_.of_level(0));
}

TEST_F(EngineShare, WhereNobodyIsSparedNobodyGivesWay) {
  for (const Criticality all : {Criticality::Normal, Criticality::High}) {
    std::atomic<int> ordinary{0};
    const Body body = [&](const Job &) {
      const Time end = monotonic_now() + 60 * kMillisecond;  // three periods of the kernel's account
      while (monotonic_now() < end) {
        if (own_priority() == 0) ++ordinary;
      }
      return Outcome::Finished;
    };
    start(kNothingIsLeft, all, all, {body, body});
    release(0);
    release(1);
    finish();
    EXPECT_EQ(ordinary, 0);
    EXPECT_EQ(engine_->gave_way(), 0);
  }
}

// The only spared task is removed while another one is demoted.
TEST_F(EngineShare, WithTheLastOneThatIsSparedItEnds) {
  std::atomic<bool> is_ordinary{false};
  bool came_back = false;
  start(kNothingIsLeft, Criticality::Low, Criticality::High,
        {[&](const Job &) {
           is_ordinary = wait_for([] { return own_priority() == 0; });
           came_back = wait_for([] { return own_priority() > 0; });
           return Outcome::Finished;
         },
         [](const Job &) { return Outcome::Finished; }});
  release(0);
  ASSERT_TRUE(wait_for([&] { return is_ordinary.load(); }));
  engine_->remove_task(TaskId(1));
  finish();
  EXPECT_TRUE(came_back);
}

}  // namespace
}  // namespace redag::runtime
