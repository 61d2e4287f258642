// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <gtest/gtest.h>

#include <sys/types.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <numeric>

#include "disturbance.hpp"
#include "experiment.hpp"
#include "lqr.hpp"
#include "pictures.hpp"
#include "redag/loader/workload_yaml.hpp"

namespace closed_loop {
namespace {

using redag::kMicrosecond;
using redag::kMillisecond;
using redag::kSecond;

TEST(Disturbance, EndsWithAllThatItStarted) {
  pid_t group = 0;
  {
    int out[2] = {-1, -1};
    ASSERT_EQ(pipe(out), 0);
    // The shell and its child both ignore SIGTERM.
    Disturbance disturbance({"sh", "-c", "trap '' TERM; sleep 100 & echo $$ >&" + std::to_string(out[1]) + "; wait"});
    disturbance.expect_running();
    std::array<char, 32> text{};
    ASSERT_GT(read(out[0], text.data(), text.size() - 1), 0);
    group = static_cast<pid_t>(std::stol(text.data()));
    EXPECT_EQ(kill(-group, 0), 0);
    close(out[0]);
    close(out[1]);
  }
  // The destructor reaps the shell. The child's new parent reaps the child a little later.
  for (int i = 0; i < 500 && kill(-group, 0) == 0; ++i) usleep(10'000);
  EXPECT_EQ(kill(-group, 0), -1);
  EXPECT_EQ(errno, ESRCH);
}

TEST(Disturbance, SaysWhatCannotBeStarted) {
  try {
    const Disturbance disturbance({"no-such-program"});
    FAIL() << "it started";
  } catch (const std::runtime_error &error) {
    EXPECT_NE(std::string(error.what()).find("apt-get install no-such-program"), std::string::npos) << error.what();
  }
  EXPECT_THROW(Disturbance({"false"}), std::runtime_error);
  EXPECT_EQ(stress_ng(" --cpu 2  --cache 1").size(), 8U);
}

TEST(Lqr, OfOneStateIsTheKnownGain) {
  // With x+ = x + u and Q = R = 1: P = (1 + sqrt 5) / 2, K = P / (1 + P).
  Matrix a(1, 1);
  Matrix b(1, 1);
  a.at(0, 0) = b.at(0, 0) = 1;
  const double p = (1 + std::sqrt(5.0)) / 2;
  EXPECT_NEAR(lqr(a, b, {1}, {1}).at(0, 0), p / (1 + p), 1e-8);
}

TEST(Lqr, SaysWhatCannotBeStabilised) {
  Matrix a(1, 1);
  Matrix b(1, 1);
  a.at(0, 0) = 2;  // the state grows, and no input acts on it
  EXPECT_THROW(static_cast<void>(lqr(a, b, {1}, {1})), std::runtime_error);
}

// Runs the feedback at the plant's own period, with each actuation `delay` late.
Plant controlled(const PlantSpec &spec, Duration delay, Duration length, std::uint64_t seed = 1) {
  Plant plant(spec, seed);
  for (Time t = 0; t < length; t += spec.period) {
    plant.advance(t);
    const State sample = plant.state();
    plant.advance(t + delay);
    plant.actuate(plant.feedback(sample));
  }
  plant.advance(length);
  return plant;
}

TEST(Plant, StaysUpUnderFeedbackAndFallsWithout) {
  for (const PlantSpec &spec : plants()) {
    EXPECT_EQ(controlled(spec, 0, 20 * kSecond).falls(), 0U) << spec.name;
    Plant free(spec, 1);
    free.advance(20 * kSecond);
    EXPECT_GT(free.falls(), 1U) << spec.name;
  }
}

TEST(Plant, LateFeedbackCostsMore) {
  for (const PlantSpec &spec : plants()) {
    const Plant prompt = controlled(spec, 0, 5 * kSecond);
    const Plant late = controlled(spec, spec.period - 1, 5 * kSecond);
    EXPECT_GT(late.cost(), prompt.cost()) << spec.name;
  }
}

TEST(Plant, TheShorterThePoleTheLessDelayItBears) {
  const std::vector<PlantSpec> all = plants();
  const auto bears = [](const PlantSpec &spec) {
    for (Duration hold = spec.period;; hold += kMillisecond) {
      Plant plant(spec, 3);
      for (Time t = 0; t < 10 * kSecond; t += hold) {
        plant.advance(t);
        plant.actuate(plant.feedback(plant.state()));
      }
      if (plant.falls() > 0) return hold;
    }
  };
  const Duration short_pole = bears(all.front());
  const Duration long_pole = bears(all.back());
  EXPECT_LT(short_pole, long_pole);
  EXPECT_GT(short_pole, 2 * all.front().period);
}

TEST(Plant, PushesComeWhateverIsDone) {
  const PlantSpec spec = plants().back();
  Plant once(spec, 7);
  once.advance(600 * kMillisecond);
  Plant often(spec, 7);
  for (Time t = 0; t <= 600 * kMillisecond; t += 170 * kMicrosecond) often.advance(t);
  often.advance(600 * kMillisecond);
  EXPECT_NE(once.angle(), 0);
  EXPECT_NEAR(once.angle(), often.angle(), 0.02 * std::abs(once.angle()));
  Plant other(spec, 8);
  other.advance(600 * kMillisecond);
  EXPECT_GT(std::abs(other.angle() - once.angle()), 0.02 * std::abs(once.angle()));
}

TEST(Plant, TimeDoesNotGoBack) {
  Plant plant(plants().front(), 1);
  plant.advance(kSecond);
  const State before = plant.state();
  plant.advance(kMillisecond);
  EXPECT_EQ(plant.time(), kSecond);
  EXPECT_EQ(plant.state(), before);
}

redag::Workload robot() {
  const auto file = redag::load_workload(REDAG_SOURCE_DIR "/examples/closed_loop/robot.yaml");
  EXPECT_TRUE(file) << to_string(file.error());
  return file->workload;
}

std::uint32_t falls(const RunOutcome &outcome) {
  return std::accumulate(outcome.plants.begin(), outcome.plants.end(), 0U,
                         [](std::uint32_t sum, const PlantResult &plant) { return sum + plant.falls; });
}

TEST(VirtualTime, ThePeriodsAreThoseOfTheWorkload) {
  const redag::Workload workload = robot();
  for (const PlantSpec &spec : plants()) {
    for (const redag::Dag &dag : workload.dags) {
      if (dag.name == spec.name) {
        EXPECT_EQ(dag.tasks.front().period, spec.period) << spec.name;
      }
    }
  }
}

TEST(VirtualTime, IsTheSameEveryTime) {
  RunSetup setup;
  setup.duration = 2 * kSecond;
  const RunOutcome first = run_in_virtual_time(robot(), executor_choice("mte"), setup);
  const RunOutcome second = run_in_virtual_time(robot(), executor_choice("mte"), setup);
  for (std::size_t i = 0; i < first.plants.size(); ++i) {
    EXPECT_EQ(first.plants[i].cost, second.plants[i].cost);
    EXPECT_EQ(first.plants[i].missed, second.plants[i].missed);
  }
}

TEST(VirtualTime, WhatMissesFallsAndWhatDoesNotStaysUp) {
  RunSetup setup;
  setup.duration = 10 * kSecond;
  const RunOutcome alone = run_in_virtual_time(robot(), executor_choice("alone"), setup);
  const RunOutcome redag = run_in_virtual_time(robot(), executor_choice("redag"), setup);
  const RunOutcome ste = run_in_virtual_time(robot(), executor_choice("ste"), setup);
  EXPECT_EQ(falls(alone), 0U);
  EXPECT_EQ(falls(redag), 0U);
  EXPECT_GT(falls(ste), 0U);
  EXPECT_EQ(alone.other_jobs, 0U);
  EXPECT_GT(redag.other_jobs, 0U);
  for (std::size_t i = 0; i < redag.plants.size(); ++i) {
    EXPECT_EQ(redag.plants[i].missed, 0U) << redag.plants[i].plant;
    EXPECT_GT(ste.plants[i].missed, redag.plants[i].missed) << redag.plants[i].plant;
  }
}

// The pictures of README.md (tools/pictures) show this.
TEST(VirtualTime, InThePicturesAPlantFallsUnderMteAndNoneUnderRedag) {
  RunSetup setup;
  setup.seed = 13;
  setup.duration = 8 * kSecond;
  EXPECT_EQ(falls(run_in_virtual_time(robot(), executor_choice("redag"), setup)), 0U);
  EXPECT_EQ(falls(run_in_virtual_time(robot(), executor_choice("mte"), setup)), 1U);
}

TEST(VirtualTime, SnapshotsDoNotDisturb) {
  RunSetup setup;
  setup.duration = kSecond;
  const RunOutcome plain = run_in_virtual_time(robot(), executor_choice("redag"), setup);
  setup.snapshots_every = 10 * kMillisecond;
  const RunOutcome seen = run_in_virtual_time(robot(), executor_choice("redag"), setup);
  for (std::size_t i = 0; i < plain.plants.size(); ++i) {
    EXPECT_EQ(seen.plants[i].snapshots.size(), 101U);
    EXPECT_NEAR(seen.plants[i].cost, plain.plants[i].cost, 0.02 * plain.plants[i].cost);
  }
  const std::string svg = trajectories_svg({{"redag", seen.plants}}, "t", "s");
  EXPECT_NE(svg.find("pole_10cm"), std::string::npos);
}

TEST(VirtualTime, SaysWhatTheWorkloadLacks) {
  redag::Workload workload = robot();
  workload.dags.erase(workload.dags.begin());
  EXPECT_THROW(static_cast<void>(run_in_virtual_time(workload, executor_choice("redag"), {})), std::runtime_error);
  EXPECT_THROW(static_cast<void>(executor_choice("redagg")), std::runtime_error);
}

// Checks only that the loop is closed on threads, too; timing depends on the machine.
TEST(Threads, ClosesTheLoop) {
  RunSetup setup;
  setup.duration = 500 * kMillisecond;
  setup.snapshots_every = 50 * kMillisecond;
  const RunOutcome outcome = run_on_threads(robot(), executor_choice("redag-cooperative"), setup);
  for (const PlantResult &plant : outcome.plants) {
    EXPECT_GT(plant.jobs, 0U);
    EXPECT_FALSE(plant.snapshots.empty());
  }
}

}  // namespace
}  // namespace closed_loop
