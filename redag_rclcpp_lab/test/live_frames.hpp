// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Frames of live pages for tests of what is published of them.
#pragma once

#include <cstdint>
#include <string>
#include <utility>

#include "redag/live/reader.hpp"

namespace redag_rclcpp::lab {

/// An executor with a DAG that a file names, and a callback that none names.
inline redag::live::Frame small_frame(const std::string &name = "robot", redag::Time began = 10 * redag::kSecond) {
  using redag::kMillisecond;
  using redag::kSecond;
  redag::live::Frame frame;
  frame.name = name;
  frame.program = "component_container";
  frame.driver = "ros";
  frame.workers = 2;
  frame.began = began;
  frame.published = began + 10 * kSecond;
  frame.window = 2 * kSecond;
  frame.dags = {{.name = "control", .max_active = 1, .deadline = 5 * kMillisecond, .late = 3}, {.name = "ros"}};
  frame.tasks = {
      {.name = "pid", .dag = 0, .period = 10 * kMillisecond, .deadline = 8 * kMillisecond, .bound = 2 * kMillisecond},
      {.name = "/ns/imu timer 2 ms (0)", .dag = 1, .period = 2 * kMillisecond}};
  redag::live::page::Figures &figures = frame.tasks[0].figures;
  figures.released = 100;
  figures.finished = 97;
  figures.misses = 4;
  figures.cpu = 1500 * kMillisecond;
  figures.response_p50 = kMillisecond;
  figures.response_p99 = 3 * kMillisecond;
  figures.response_max = 7 * kMillisecond;
  figures.recent_jobs = 20;
  figures.recent_cpu = 100 * kMillisecond;
  figures.recent_p99 = 2500 * redag::kMicrosecond;
  figures.ready = 1;
  frame.threads = {{.index = 0, .used = kSecond, .recent_used = kSecond, .task = 0}};
  frame.threads_in_all = 1;
  frame.devices = {{.name = "gpu", .slots = 2, .used = 1, .served = 40, .recent_served = 8}};
  frame.devices_in_all = 1;
  return frame;
}

/// `tasks` callbacks with names as long as those of ROS often are, ten in each DAG.
inline redag::live::Frame large_frame(std::uint32_t tasks) {
  redag::live::Frame frame = small_frame("large");
  frame.dags.clear();
  frame.tasks.clear();
  for (std::uint32_t i = 0; i < tasks; ++i) {
    const std::string node = "/perception/camera_" + std::to_string(i / 10);
    if (i % 10 == 0) frame.dags.push_back({.name = "pipeline_" + std::to_string(i / 10)});
    redag::live::TaskFrame task{.name = node + " subscription /perception/image_" + std::to_string(i) + " (0)",
                                .dag = i / 10,
                                .period = redag::kMillisecond,
                                .deadline = redag::kMillisecond,
                                .bound = redag::kMillisecond,
                                .priority = 40};
    task.figures.released = i;
    frame.tasks.push_back(std::move(task));
  }
  return frame;
}

}  // namespace redag_rclcpp::lab
