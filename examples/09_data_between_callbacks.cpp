// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Passes data between tasks of different rates, and from them to an ordinary thread, without a lock: the latest pose
// for two readers, and a queue of log entries. With preemption `os` any of these bodies may be preempted at any
// instruction.
#include <array>
#include <cstdio>
#include <thread>

#include "redag/redag.hpp"

using namespace std::chrono_literals;
using namespace redag::runtime;

namespace {

struct Pose {
  double x = 0;
  double y = 0;
  std::uint64_t number = 0;
};

struct Entry {
  const char *what = "";
  std::uint64_t pose = 0;
};

}  // namespace

int main() {
  LatestValue<Pose> pose({}, 2);  // one writer, two readers
  auto new_pose = pose.writer();
  auto pose_for_control = pose.reader();
  auto pose_for_planner = pose.reader();
  BoundedQueue<Entry> log(64);  // one writer, one reader
  auto new_entry = log.writer();
  auto entries = log.reader();
  std::uint64_t dropped = 0;

  Executor executor;
  DagBuilder localisation("localisation");
  std::uint64_t number = 0;
  localisation.timer("ekf", 5ms, [&] { new_pose.write(Pose{.x = 0.1, .y = 0.2, .number = ++number}); });
  executor.add(std::move(localisation));

  DagBuilder control("control");
  std::uint64_t steered_by = 0;
  control.timer("pid", 2ms, [&] { steered_by = pose_for_control.read().number; });
  executor.add(std::move(control));

  DagBuilder planning("planning");
  planning.timer("plan", 50ms, [&] {
    if (!pose_for_planner.has_news()) return;
    if (!new_entry.push(Entry{"planned from pose", pose_for_planner.read().number})) ++dropped;
  });
  executor.add(std::move(planning));

  executor.start();
  std::this_thread::sleep_for(300ms);
  executor.stop();
  // Reading the queue costs the executor's threads nothing; a logger's thread would do it while they run.
  while (const auto entry = entries.pop()) {
    std::printf("%s %llu\n", entry->what, static_cast<unsigned long long>(entry->pose));
  }
  std::printf("control steered by pose %llu of %llu; %llu entries were dropped\n",
              static_cast<unsigned long long>(steered_by), static_cast<unsigned long long>(number),
              static_cast<unsigned long long>(dropped));
}
