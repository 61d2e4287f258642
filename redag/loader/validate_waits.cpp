// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/loader/validate_parts.hpp"

#include <string>
#include <utility>

#include <fmt/format.h>

#include "redag/base/text.hpp"
#include "redag/derived/waits.hpp"

namespace redag {
namespace {

void check_wait(const Workload &workload, const Task &task, std::size_t index, FindingList &findings) {
  const Wait &wait = task.waits[index];
  const auto refuse = [&](std::string message, const char *hint = "") {
    findings.error(Field::Segments, Field::Devices, std::move(message), hint, index);
  };
  if (wait.longest < 1 || wait.longest > kMaxDuration) {
    refuse(fmt::format("a wait of task '{}' must last from 1 ns to {}, not {}", task.name, kMaxDurationText,
                       format_duration(wait.longest)));
  }
  if (wait.shortest < 0 || wait.shortest > wait.longest) {
    refuse(fmt::format("at_least {} of a wait of task '{}' is not from 0 to its longest time {}",
                       format_duration(wait.shortest), task.name, format_duration(wait.longest)));
  }
  if (wait.device.valid() && wait.device.value >= workload.platform.devices.size()) {
    refuse(fmt::format("task '{}' waits for a device that the platform does not have", task.name),
           "add it to 'devices:' of the platform");
  }
  const Duration earliest = index == 0 ? 1 : task.waits[index - 1].after + 1;
  if (wait.after < earliest || wait.after >= task.wcet) {
    findings.error(Field::Segments, {},
                   fmt::format("the waits of task '{}' must be at different points within its wcet", task.name),
                   "a job executes before each wait and after the last one");
  }
}

}  // namespace

void check_waits(const Workload &workload, const Task &task, bool allowed, FindingList &findings) {
  if (task.waits.empty()) return;
  if (!allowed) {
    findings.error(
        Field::Segments, {}, fmt::format("task '{}' has segments, which cannot be handled here", task.name),
        "'redag analyze', 'simulate', 'run', 'compare' and 'tune' know them, with executors of ReDAG-RT; elsewhere, "
        "state 'wcet:' in place of 'segments:'");
  }
  if (task.waits.size() > kMaxWaits) {
    findings.error(
        Field::Segments, {},
        fmt::format("task '{}' has {} waits; at most {} are allowed", task.name, task.waits.size(), kMaxWaits));
    return;
  }
  for (std::size_t w = 0; w < task.waits.size(); ++w) check_wait(workload, task, w, findings);
  if (longest_waits(task) > kMaxDuration - task.wcet) {
    findings.error(Field::Segments, {},
                   fmt::format("the segments of task '{}' take longer than {} together", task.name, kMaxDurationText));
    return;
  }
  const Duration alone = task.wcet + longest_waits(task);
  if (task.deadline <= 0 || alone <= task.deadline || task.wcet > task.deadline) return;
  findings.warning(Field::Segments, Field::Deadline | Field::Period,
                   fmt::format("the segments of task '{}' take {}, more than its deadline {}", task.name,
                               format_duration(alone), format_duration(task.deadline)),
                   "a job that takes its longest times misses its deadline");
}

}  // namespace redag
