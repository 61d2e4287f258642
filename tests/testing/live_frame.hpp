// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Pages with fixed figures, for tests of what is shown of them.
#pragma once

#include <string>
#include <vector>

#include "redag/live/pages.hpp"
#include "redag/live/reader.hpp"

namespace redag::testing {

inline live::Listed listed(live::Frame frame, std::int64_t pid = 12, std::uint64_t start = 1) {
  return live::Listed{live::page_path("/x", pid, 0), pid, 0, live::Page{{pid, start, 1}, std::move(frame)}};
}

/// Two DAGs and three tasks of the executor `name`.
inline live::Listed small_page(std::int64_t pid = 12, const std::string &name = "cart", std::uint64_t start = 1) {
  live::Frame frame;
  frame.name = name;
  frame.program = "redag";
  frame.driver = "threads";
  frame.preemption = "os";
  frame.policy = "rate_monotonic";
  frame.workers = 2;
  frame.began = 10 * kSecond;
  frame.published = 20 * kSecond;
  frame.interval = kSecond / 2;
  frame.window = 2 * kSecond;
  frame.publisher_cpu = kMillisecond;
  frame.dags = {{.name = "fast", .max_active = 1}, {.name = "slow"}};
  const auto task = [](const char *task_name, std::uint32_t dag, Duration period, Duration bound) {
    return live::TaskFrame{.name = task_name, .dag = dag, .period = period, .deadline = period, .bound = bound};
  };
  frame.tasks = {task("sense", 0, 10 * kMillisecond, 2 * kMillisecond), task("act", 0, 10 * kMillisecond, 0),
                 task("plan", 1, 100 * kMillisecond, 0)};
  for (std::size_t i = 0; i < 3; ++i) {
    live::page::Figures &figures = frame.tasks[i].figures;
    figures.finished = 100 * (i + 1);
    figures.recent_jobs = 20 * (i + 1);
    figures.recent_cpu = static_cast<Duration>(i + 1) * 100 * kMillisecond;
    figures.recent_p50 = kMillisecond;
    figures.recent_p99 = static_cast<Duration>(3 - i) * kMillisecond;
    figures.recent_max = 4 * kMillisecond;
    figures.response_max = 50 * kMillisecond;
    figures.active = 1;
  }
  frame.dags[0].figures.recent_cpu = 300 * kMillisecond;
  frame.dags[0].figures.active = 1;
  frame.dags[1].figures.recent_cpu = 300 * kMillisecond;
  return listed(std::move(frame), pid, start);
}

}  // namespace redag::testing
