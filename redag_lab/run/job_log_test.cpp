// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/run/job_log.hpp"

#include <gtest/gtest.h>

#include <map>
#include <thread>
#include <vector>

namespace redag::lab {
namespace {

TEST(JobLog, AFullRingDropsJobsUntilItIsRead) {
  JobLog log(4);
  for (std::uint32_t number = 0; number < 6; ++number) log.push({TaskId(0), number, 7});
  std::vector<std::uint32_t> numbers;
  const auto take = [&](const metrics::JobThread &job) { numbers.push_back(job.number); };
  log.drain(take);
  EXPECT_EQ(numbers, (std::vector<std::uint32_t>{0, 1, 2, 3}));
  for (std::uint32_t number = 6; number < 9; ++number) log.push({TaskId(0), number, 7});
  log.drain(take);
  EXPECT_EQ(numbers, (std::vector<std::uint32_t>{0, 1, 2, 3, 6, 7, 8}));
}

TEST(JobLog, JobsOfEachThreadComeInOrder) {
  constexpr std::size_t kThreads = 4;
  constexpr std::uint32_t kJobs = 20'000;
  JobLog log(64);
  std::map<int, std::uint32_t> next;
  std::size_t taken = 0;
  const auto take = [&](const metrics::JobThread &job) {
    EXPECT_EQ(job.task, TaskId(static_cast<std::size_t>(job.thread)));
    EXPECT_GE(job.number, next[job.thread]);
    next[job.thread] = job.number + 1;
    ++taken;
  };
  std::vector<std::jthread> threads;
  for (std::size_t t = 0; t < kThreads; ++t) {
    threads.emplace_back([&log, t] {
      for (std::uint32_t number = 0; number < kJobs; ++number) log.push({TaskId(t), number, static_cast<int>(t)});
    });
  }
  for (int i = 0; i < 1000; ++i) log.drain(take);
  threads.clear();
  log.drain(take);
  EXPECT_GE(taken, 64U) << "the ring was full at the end";
  EXPECT_LE(taken, kThreads * kJobs);
}

}  // namespace
}  // namespace redag::lab
