// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/doctor/measure.hpp"

#include <gtest/gtest.h>

#include <atomic>

#include "redag/loader/validate.hpp"
#include "redag_lab/doctor/figures.hpp"
#include "redag_lab/doctor/measured_jobs.hpp"
#include "tests/testing/trace_builder.hpp"

namespace redag::doctor {
namespace {

constexpr Duration kUs = kMicrosecond;
constexpr Duration kMs = kMillisecond;

// Expects that no window of the samples exceeds the bucket's bound.
void expect_fits(const Loss &loss, const std::vector<LossSample> &samples) {
  for (std::size_t from = 0; from < samples.size(); ++from) {
    Duration sum = 0;
    for (std::size_t to = from; to < samples.size(); ++to) {
      sum += samples[to].length;
      const Duration window = samples[to].at - (samples[from].at - samples[from].length);
      EXPECT_LE(sum, loss.in(window)) << from << " to " << to;
    }
  }
}

TEST(FitLoss, NothingLost) { EXPECT_EQ(fit_loss({}, kSecond), Loss{}); }

TEST(FitLoss, OneStallIsTheBucket) {
  const std::vector<LossSample> samples = {{500 * kMs, 3 * kMs}};
  const Loss loss = fit_loss(samples, kSecond);
  EXPECT_EQ(loss.longest, 3 * kMs);
  EXPECT_EQ(loss.per_second, 6 * kMs) << "twice the mean";
  expect_fits(loss, samples);
}

TEST(FitLoss, TicksDoNotFillTheBucket) {
  std::vector<LossSample> samples;
  for (int i = 1; i <= 250; ++i) samples.push_back({i * 4 * kMs, 5 * kUs});
  const Loss loss = fit_loss(samples, kSecond);
  EXPECT_EQ(loss.longest, 5 * kUs);
  EXPECT_EQ(loss.per_second, 2500 * kUs);
  expect_fits(loss, samples);
}

TEST(FitLoss, ABurstAddsUp) {
  std::vector<LossSample> samples;
  for (int i = 1; i <= 10; ++i) samples.push_back({100 * kMs + i * 150 * kUs, 100 * kUs});
  const Loss loss = fit_loss(samples, kSecond);
  EXPECT_GT(loss.longest, 990 * kUs);
  EXPECT_LE(loss.longest, kMs);
  expect_fits(loss, samples);
}

TEST(FitLoss, AProcessorThatIsMostlyLostIsNotPromised) {
  const Loss loss = fit_loss(std::vector<LossSample>{{kSecond, 900 * kMs}}, kSecond);
  EXPECT_EQ(loss.per_second, kSecond - kMs);
}

TEST(Measure, ItsWorkloadIsValid) {
  const Workload workload = measured_workload(3);
  EXPECT_EQ(workload.task_count(), 6U);
  EXPECT_FALSE(has_errors(validate(workload))) << to_string(validate(workload));
}

TEST(TraceFigures, ComeFromTheTrace) {
  const Workload workload = measured_workload(1);
  const TaskId tick(0);
  const TaskId tock(1);
  const TaskId long_job(3);
  std::vector<JobEvent> events;
  const auto add = [&](JobEventKind kind, TaskId task, Time time, std::int64_t value) {
    events.push_back(JobEvent{time, value, task, 0, 0, kind, Reason::None, 0});
  };
  add(JobEventKind::Released, tick, 1000 + 30, 1000);
  add(JobEventKind::Dispatched, tick, 1040, 0);
  add(JobEventKind::Preempted, long_job, 1040, 0);
  add(JobEventKind::Started, tick, 1100, 1090);
  add(JobEventKind::Released, tock, 1500, 1400);
  add(JobEventKind::Resumed, long_job, 2000, 0);
  add(JobEventKind::Resumed, long_job, 3000, 0);
  const TraceFigures figures = figures_of(workload, events, {{}, {}, {}, {{500, 600}, {1050, 2070}, {5000, 5100}}});
  EXPECT_EQ(figures.lateness, std::vector<Duration>{30}) << "data tasks have no timer";
  ASSERT_EQ(figures.dispatch.size(), 1U);
  EXPECT_EQ(figures.dispatch[0].at, 1040);
  EXPECT_EQ(figures.dispatch[0].length, 50);
  ASSERT_EQ(figures.preempt.size(), 1U) << "the second time it had never stopped";
  EXPECT_EQ(figures.preempt[0].length, 70);
}

TEST(Measure, WhatADispatchTakesBeyondTheUsualIsAStall) {
  std::vector<LossSample> delays;
  for (int i = 1; i <= 200; ++i) delays.push_back({i * kMs, i == 100 ? 500 * kUs : 20 * kUs});
  Loss beyond;
  EXPECT_EQ(usual_delay(delays, kSecond, beyond), 20 * kUs);
  EXPECT_EQ(beyond.longest, 480 * kUs);
  EXPECT_EQ(beyond.per_second, 960 * kUs);
}

TEST(Measure, MeasuresOrdinaryThreadsEverywhere) {
  MeasureOptions options;
  options.duration = kSecond;
  const Result<Measurement> measured = measure(options);
  ASSERT_TRUE(measured) << to_string(measured.error());
  const Calibration *const calibration = &measured->calibration;
  EXPECT_GT(measured->wake_ups.total(), 10U);
  EXPECT_GT(measured->wake_ups.longest(), 0);
  EXPECT_TRUE(calibration->complete);
  ASSERT_TRUE(calibration->normal);
  const Overheads &normal = *calibration->normal;
  EXPECT_GT(normal.dispatch, 0);
  EXPECT_GT(normal.lateness, 0);
  EXPECT_GT(normal.timer, 0);
  EXPECT_GT(normal.clock, 0);
  EXPECT_LT(normal.stall.per_second, kSecond);
  // Noise is a part of the stalls. Its burst may be the longer one: a burst is what exceeds the rate.
  EXPECT_LE(normal.noise.per_second, normal.stall.per_second);
}

TEST(Measure, EndsWhenTold) {
  std::atomic<bool> stop{true};
  MeasureOptions options;
  options.duration = 3600 * kSecond;
  options.stop = &stop;
  const Result<Measurement> measured = measure(options);
  ASSERT_FALSE(measured);
  EXPECT_NE(to_string(measured.error()).find("interrupted"), std::string::npos);
}

}  // namespace
}  // namespace redag::doctor
