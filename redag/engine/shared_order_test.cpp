// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Engines that share one order: jobs in progress have the priorities of all engines' rates. The bodies wait instead of
// computing. Each expectation is awaited, because an engine looks at the others' pages from time to time.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <memory>
#include <thread>
#include <vector>

#include "redag/engine/engine.hpp"
#include "redag/sched/priority_scheduler.hpp"
#include "redag/threads/clock.hpp"
#include "redag/threads/parker.hpp"
#include "redag/threads/threads.hpp"
#include "tests/testing/builders.hpp"

namespace redag::runtime {
namespace {

using sched::Outcome;
using testing::make_dag;

constexpr Duration kPatience = 100 * kSecond;

/// An engine with a job in progress for each of its tasks, one task for each period.
class SharingEngine {
 public:
  SharingEngine(const std::string &folder, PriorityBand band, const std::vector<Duration> &periods)
      : band_(std::move(band)), held_(periods.size()) {
    Workload workload;
    std::vector<Body> bodies;
    std::vector<testing::TestTask> tasks;
    for (std::size_t i = 0; i < periods.size(); ++i) {
      tasks.push_back({.name = "t" + std::to_string(i), .period = periods[i]});
      bodies.emplace_back([this, i](const Job &) {
        held_[i].thread = pthread_self();
        held_[i].begun.set();
        may_end_.wait();
        return Outcome::Finished;
      });
    }
    if (!tasks.empty()) workload.dags.push_back(make_dag("d", tasks));
    EngineOptions options;
    options.config = make_config(Mode{PreemptionMode::Os, {}}, 1, workload.policy, band_, 8);
    options.band = band_;
    options.band.shared = true;
    options.order_folder = folder;
    engine = std::make_unique<Engine>(std::make_unique<sched::PriorityScheduler>(workload, options.config), options);
    engine->bind(workload, std::move(bodies));
    engine->share_releases(releases_);
    EXPECT_TRUE(releases_.start({.name = "releases", .fifo_priority = band_.timer, .cpus = {}}));
    EXPECT_TRUE(engine->start());
    release_thread_known_.wait();
    engine->set_origin(monotonic_now());
    // The most urgent one comes last: the others are in progress, too, because each has a thread.
    for (std::size_t i = periods.size(); i-- > 0;) {
      engine->release(TaskId(i), engine->now());
      held_[i].begun.wait();
    }
  }
  ~SharingEngine() {
    engine->halt();
    may_end_.set();
    EXPECT_TRUE(engine->wait_idle(kNever));
    engine->join();
    EXPECT_TRUE(engine->problems().empty());
  }

  [[nodiscard]] std::vector<int> priorities() const {
    std::vector<int> priorities;
    for (const Held &held : held_) priorities.push_back(fifo_priority(held.thread));
    return priorities;
  }
  void expect(const std::vector<int> &wanted) const {
    for (const Time end = monotonic_now() + kPatience; priorities() != wanted && monotonic_now() < end;) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    EXPECT_EQ(priorities(), wanted);
  }
  /// Priority of the thread that releases jobs.
  [[nodiscard]] int of_releases() const { return fifo_priority(release_thread_); }
  void expect_of_releases(int wanted) const {
    for (const Time end = monotonic_now() + kPatience; of_releases() != wanted && monotonic_now() < end;) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    EXPECT_EQ(of_releases(), wanted);
  }

  std::unique_ptr<Engine> engine;

 private:
  struct Held {
    Event begun;
    pthread_t thread{};
  };
  PriorityBand band_;
  pthread_t release_thread_{};
  Event release_thread_known_;
  ReleaseThread releases_{[this] {
    if (!release_thread_known_.is_set()) release_thread_ = pthread_self();
    release_thread_known_.set();
    return kNever;
  }};
  std::vector<Held> held_;
  Event may_end_;
};

class EngineOrder : public ::testing::Test {
 protected:
  EngineOrder() {
    std::string name = ::testing::TempDir() + "redag_order_XXXXXX";
    EXPECT_NE(::mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void SetUp() override {
    if (band_.top_job < 10) GTEST_SKIP() << "this process may use too few SCHED_FIFO priorities: " << realtime_hint();
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::unique_ptr<SharingEngine> member(const std::vector<Duration> &periods) {
    return std::make_unique<SharingEngine>(folder_, band_, periods);
  }

  const PriorityBand band_ = probe_priority_band();
  const int top_ = band_.top_job;
  std::string folder_;
};

TEST_F(EngineOrder, FollowsThoseThatComeAndGo) {
  const auto a = member({10, 30});
  a->expect({top_, top_ - 1});
  auto b = member({20, 30, 40});
  EXPECT_EQ(b->priorities(), (std::vector<int>{top_ - 1, top_ - 2, top_ - 3})) << "before its first job";
  a->expect({top_, top_ - 2});
  auto c = member({5});
  a->expect({top_ - 1, top_ - 3});
  b->expect({top_ - 2, top_ - 3, top_ - 4});
  b.reset();
  a->expect({top_ - 1, top_ - 2});
  c.reset();
  a->expect({top_, top_ - 1});
}

TEST_F(EngineOrder, FollowsOtherPeriodsAndOtherTasks) {
  const auto a = member({10, 30});
  const auto b = member({20});
  a->expect({top_, top_ - 2});
  b->engine->set_timing(TaskId(0), 40 * kMillisecond, 40 * kMillisecond);
  a->expect({top_, top_ - 1});
  b->expect({top_ - 2});
  const Body nothing = [](const Job &) { return Outcome::Finished; };
  const AddedDag added = b->engine->add_dag(make_dag("added", {{"u", 5}}), {nothing});
  a->expect({top_ - 1, top_ - 2});
  b->expect({top_ - 3});
  b->engine->remove_dag(added.dag);
  a->expect({top_, top_ - 1});
  b->expect({top_ - 2});
}

TEST_F(EngineOrder, KeepsToWhatAllMayUse) {
  const auto a = member({10, 30});
  PriorityBand small = band_;
  small.top_job = 5;
  auto b = std::make_unique<SharingEngine>(folder_, small, std::vector<Duration>{20});
  b->expect({4});
  a->expect({5, 3});
  b.reset();
  a->expect({top_, top_ - 1});
}

TEST_F(EngineOrder, RestoresAPageThatSomeoneRemoved) {
  const auto a = member({10});
  const auto b = member({20});
  a->expect({top_});
  for (const auto &entry : std::filesystem::directory_iterator(folder_)) std::filesystem::remove(entry.path());
  b->expect({top_ - 1});
  const Time end = monotonic_now() + kPatience;
  while (live::read_order_pages(folder_).size() < 2 && monotonic_now() < end) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  EXPECT_THAT(live::read_order_pages(folder_), ::testing::SizeIs(2));
  a->expect({top_});
  b->expect({top_ - 1});
}

TEST_F(EngineOrder, StatesThePrioritiesOfTasks) {
  const auto a = member({10, 30});
  const auto b = member({20});
  a->expect({top_, top_ - 2});
  EXPECT_EQ(a->engine->figures(TaskId(0)).priority, top_);
  EXPECT_EQ(a->engine->figures(TaskId(1)).priority, top_ - 2);
}

// The releases of b do not delay the jobs of a, which are more urgent than all jobs of b.
TEST_F(EngineOrder, ReleasesAreJustAboveTheOwnJobs) {
  const auto a = member({10, 30});
  auto b = member({20, 40});
  EXPECT_EQ(b->of_releases(), top_) << "before its first job";
  a->expect({top_, top_ - 2});
  EXPECT_EQ(a->of_releases(), band_.timer);
  // The most urgent task of b becomes the most urgent of all. Its release thread is above it from then on.
  b->engine->set_timing(TaskId(0), 5 * kMillisecond, 5 * kMillisecond);
  EXPECT_EQ(b->of_releases(), band_.timer);
  a->expect({top_ - 1, top_ - 2});
  a->expect_of_releases(top_);
  b.reset();
  a->expect_of_releases(band_.timer);
}

// a has all rates of b: when b loses one, the order stays.
TEST_F(EngineOrder, ReleasesFollowARateThatGoes) {
  const auto a = member({10, 20, 30});
  const auto b = member({20});
  b->expect_of_releases(top_);
  b->engine->set_timing(TaskId(0), 30 * kMillisecond, 30 * kMillisecond);
  b->expect_of_releases(top_ - 1);
}

// An idle thread that waits in the place of the release thread.
TEST_F(EngineOrder, ALeaderIsJustAboveTheOwnJobs) {
  auto a = member({10});
  pthread_t leader{};
  Event called;
  const Workload workload = testing::make_workload({make_dag("d", {{"t", 20}})});
  EngineOptions options;
  options.config = make_config(Mode{PreemptionMode::Os, {}}, 1, workload.policy, band_, 1);
  options.band = band_;
  options.band.shared = true;
  options.order_folder = folder_;
  ReleaseThread releases([] { return monotonic_now() + 3600 * kSecond; });
  Engine engine(std::make_unique<sched::PriorityScheduler>(workload, options.config), options);
  engine.bind(workload, {[&](const Job &) {
                leader = pthread_self();
                called.set();
                return Outcome::Finished;
              }});
  engine.share_releases(releases);
  ASSERT_TRUE(releases.start({.name = "releases", .fifo_priority = band_.timer, .cpus = {}}));
  ASSERT_TRUE(engine.start());
  engine.set_origin(monotonic_now());
  engine.release(TaskId(0), engine.now());
  called.wait();
  const auto expect = [&](int wanted) {
    for (const Time end = monotonic_now() + kPatience; fifo_priority(leader) != wanted && monotonic_now() < end;) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    EXPECT_EQ(fifo_priority(leader), wanted);
  };
  expect(top_);
  a.reset();
  expect(band_.timer);
  releases.stop();
  releases.join();
}

// A job of another executor can have a priority in between. `seen` is what the job's own thread has.
TEST_F(EngineOrder, AShortJobKeepsNoHigherPriority) {
  int seen = 0;
  std::atomic<int> ends{0};
  const auto body = [&](const Job &) {
    seen = fifo_priority(pthread_self());
    ends.fetch_add(1, std::memory_order_release);
    return Outcome::Finished;
  };
  const Workload workload = testing::make_workload({make_dag("d", {{"fast", 5}, {"slow", 50}})});
  EngineOptions options;
  options.config = make_config(Mode{PreemptionMode::Os, {}}, 1, workload.policy, band_, 1);
  options.band = band_;
  options.band.shared = true;
  options.order_folder = folder_;
  Engine engine(std::make_unique<sched::PriorityScheduler>(workload, options.config), options);
  engine.bind(workload, {body, body});
  ASSERT_TRUE(engine.start());
  engine.set_origin(monotonic_now());
  for (int i = 0; i < 40; ++i) {
    const auto task = static_cast<std::size_t>(i % 2);
    engine.release(TaskId(task), engine.now());
    while (ends.load(std::memory_order_acquire) <= i) std::this_thread::yield();
    EXPECT_EQ(seen, top_ - static_cast<int>(task)) << i;
  }
}

TEST_F(EngineOrder, AFolderThatCannotBeUsedStopsTheStart) {
  EngineOptions options;
  options.config = make_config(Mode{PreemptionMode::Os, {}}, 1, PolicyKind::RateMonotonic, band_, 8);
  options.band = band_;
  options.band.shared = true;
  options.order_folder = folder_ + "/none";
  Engine engine(std::make_unique<sched::PriorityScheduler>(Workload{}, options.config), options);
  const Result<void> started = engine.start();
  ASSERT_FALSE(started);
  EXPECT_THAT(to_string(started.error()), ::testing::HasSubstr("No such file"));
  std::filesystem::create_directory(options.order_folder);
  EXPECT_TRUE(engine.start()) << "it can be started again";
}

}  // namespace
}  // namespace redag::runtime
