// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Pages with fixed figures, for tests of what is shown of them.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include "redag/live/reader.hpp"

namespace redag::cli::testing {

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

/// A robot: ten DAGs of three tasks with names as in ROS 2, four worker threads, some misses.
inline live::Listed robot_page() {
  live::Frame frame;
  frame.name = "robot";
  frame.program = "component_container";
  frame.driver = "ros";
  frame.preemption = "os";
  frame.policy = "rate_monotonic";
  frame.workers = 4;
  frame.sequence = 7;
  frame.began = 100 * kSecond;
  frame.published = 3'700 * kSecond;
  frame.interval = kSecond / 2;
  frame.window = 2'500 * kMillisecond;
  frame.publisher_cpu = 600 * kMillisecond;
  const char *const dags[] = {"control",      "imu_filter",           "wheel_odometry", "lidar_front", "lidar_rear",
                              "localization", "local_costmap_update", "planner",        "diagnostics", "map_server"};
  const char *const tasks[] = {"receive", "compute_and_fuse", "publish"};
  for (std::uint32_t d = 0; d < 10; ++d) {
    const Duration period = (d + 1) * 4 * kMillisecond;
    live::DagFrame dag{.name = dags[d], .max_active = d % 3 == 0 ? 2U : 0U, .deadline = d % 2 == 0 ? period : 0};
    for (std::uint32_t t = 0; t < 3; ++t) {
      live::TaskFrame task{.name = tasks[t], .dag = d, .period = period, .deadline = period};
      task.bound = d < 4 ? period / 2 : 0;
      const std::uint64_t jobs = static_cast<std::uint64_t>(3'600 * kSecond / period);
      const Duration typical = (t + 1) * period / 16;
      live::page::Figures &figures = task.figures;
      figures.released = figures.finished = jobs;
      figures.recent_jobs = static_cast<std::uint64_t>(frame.window / period);
      figures.cpu = static_cast<Duration>(jobs) * typical / 2;
      figures.recent_cpu = static_cast<Duration>(figures.recent_jobs) * typical / 2;
      figures.response_p50 = figures.recent_p50 = typical;
      figures.recent_p99 = typical * 2;
      figures.response_p99 = typical * 3;
      figures.recent_max = typical * 3;
      figures.response_max = typical * 7;
      figures.preemptions = jobs / 9;
      figures.recent_preemptions = figures.recent_jobs / 9;
      figures.active = (d + t) % 4 == 0 ? 1 : 0;
      figures.ready = (d + t) % 5 == 0 ? 1 : 0;
      if (d == 3 && t == 2) figures.misses = 4'231;
      if (d == 6 && t == 1) {
        figures.misses = 17;
        figures.recent_misses = 2;
        figures.recent_max = figures.recent_p99 = 31 * kMillisecond;
      }
      // A hill around the typical response.
      for (std::size_t i = 0; i + 1 < live::page::kClasses; ++i) {
        if (live::page::least_in(i + 1) <= typical / 2 || live::page::least_in(i) > 4 * typical) continue;
        const std::uint32_t height = live::page::least_in(i + 1) <= typical   ? 20
                                     : live::page::least_in(i) <= typical     ? 100
                                     : live::page::least_in(i) <= 2 * typical ? 40
                                                                              : 2;
        task.spread.recent[i] = height;
        task.spread.all[i] = height * 100;
      }
      dag.figures.released += figures.released;
      dag.figures.finished += figures.finished;
      dag.figures.misses += figures.misses;
      dag.figures.cpu += figures.cpu;
      dag.figures.recent_jobs += figures.recent_jobs;
      dag.figures.recent_misses += figures.recent_misses;
      dag.figures.recent_cpu += figures.recent_cpu;
      dag.figures.preemptions += figures.preemptions;
      dag.figures.recent_preemptions += figures.recent_preemptions;
      dag.figures.active += figures.active;
      dag.figures.ready += figures.ready;
      dag.figures.recent_p50 = dag.figures.response_p50 = 2 * typical;
      dag.figures.recent_p99 = std::max(dag.figures.recent_p99, 3 * typical);
      dag.figures.recent_max = std::max(dag.figures.recent_max, 4 * typical);
      dag.figures.response_p99 = 4 * typical;
      dag.figures.response_max = 8 * typical;
      dag.spread = task.spread;
      frame.tasks.push_back(std::move(task));
    }
    frame.dags.push_back(std::move(dag));
  }
  frame.threads_in_all = 5;
  frame.threads = {{.index = 0, .used = 1'900 * kSecond, .recent_used = 2'350 * kMillisecond, .task = 19},
                   {.index = 1, .used = 900 * kSecond, .recent_used = 1'820 * kMillisecond, .task = 4},
                   {.index = 2, .used = 300 * kSecond, .recent_used = 600 * kMillisecond},
                   {.index = 3, .used = 30 * kSecond, .recent_used = 20 * kMillisecond, .task = 22},
                   {.index = 4}};
  return listed(std::move(frame), 20'817);
}

/// The robot with accelerators: some jobs wait for them, and some for answers.
inline live::Listed accelerated_page() {
  live::Listed robot = robot_page();
  live::Frame &frame = robot.page->frame;
  frame.devices_in_all = 2;
  frame.devices = {{.name = "gpu",
                    .slots = 1,
                    .used = 1,
                    .queued = 2,
                    .served = 360'000,
                    .recent_served = 249,
                    .busy = 2'880 * kSecond,
                    .recent_busy = 2'010 * kMillisecond,
                    .tasks = {10}},
                   {.name = "encoder",
                    .slots = 6,
                    .used = 5,
                    .served = 90'000,
                    .recent_served = 61,
                    .busy = 1'900 * kSecond,
                    .recent_busy = 4'800 * kMillisecond,
                    .tasks = {13, 16, 19, 22}}};
  for (const std::uint32_t task : {10U, 13U, 16U, 19U, 22U, 25U}) {
    frame.tasks[task].figures.active += 1;
    frame.tasks[task].figures.away = 1;
    frame.dags[frame.tasks[task].dag].figures.active += 1;
    frame.dags[frame.tasks[task].dag].figures.away += 1;
  }
  frame.dags[3].figures.away += 2;
  return robot;
}

}  // namespace redag::cli::testing
