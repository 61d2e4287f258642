// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "watch/middleware_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <iterator>
#include <map>

#include "redag/threads/threads.hpp"

namespace redag_rclcpp {
namespace {

/// "dq.user, recv (2)": equal names once, with their number.
std::string names_of(const std::vector<MiddlewareThread> &threads) {
  std::map<std::string, int> counts;
  for (const MiddlewareThread &thread : threads) ++counts[thread.name];
  std::vector<std::string> names;
  for (const auto &[name, count] : counts) names.push_back(count == 1 ? name : fmt::format("{} ({})", name, count));
  return fmt::format("{}", fmt::join(names, ", "));
}

std::string summarize(const MiddlewareThreads &found, const std::string &rmw) {
  std::map<int, std::vector<MiddlewareThread>, std::greater<>> by_priority;
  std::vector<MiddlewareThread> background;
  for (const MiddlewareThread &thread : found.threads) {
    if (thread.delivers) {
      by_priority[thread.priority].push_back(thread);
    } else {
      background.push_back(thread);
    }
  }
  std::vector<std::string> parts;
  for (const auto &[priority, threads] : by_priority) {
    const std::string which = priority == 0 ? "no real-time priority" : fmt::format("priority {}", priority);
    parts.push_back(fmt::format("{} have {}", names_of(threads), which));
  }
  if (!background.empty()) parts.push_back(fmt::format("{} in the background", names_of(background)));
  std::string text = fmt::format("{} threads of {}", found.threads.size(), rmw);
  if (!parts.empty()) text += fmt::format(": {}", fmt::join(parts, "; "));
  if (!found.by_names_because.empty()) text += fmt::format(" (recognised by name alone: {})", found.by_names_because);
  return text;
}

}  // namespace

MiddlewareReport describe(const MiddlewareThreads &found, const MiddlewareSetting &setting) {
  MiddlewareReport report{.summary = summarize(found, setting.rmw), .warnings = {}};
  std::vector<MiddlewareThread> low;
  std::copy_if(found.threads.begin(), found.threads.end(), std::back_inserter(low),
               [&](const MiddlewareThread &thread) { return thread.delivers && thread.priority <= setting.top_job; });
  if (std::none_of(found.threads.begin(), found.threads.end(), [](const auto &thread) { return thread.delivers; })) {
    report.warnings.push_back(fmt::format(
        "no thread of {} that delivers messages was found, and busy workers can delay messages: give its receiving "
        "threads SCHED_FIFO priority {} in the middleware's configuration (docs/ros2.md, \"The middleware's threads\")",
        setting.rmw, setting.timer));
  } else if (!low.empty() && setting.wanted == 0) {
    report.warnings.push_back(fmt::format(
        "busy workers (up to priority {}) can delay messages of {}, because these threads are not above them: {}; set "
        "'raise_middleware', or give them SCHED_FIFO priority {} in the middleware's configuration",
        setting.top_job, setting.rmw, names_of(low), setting.timer));
  } else if (!low.empty()) {
    report.warnings.push_back(fmt::format(
        "busy workers (up to priority {}) can delay messages of {}, because the system refused priority {} to these "
        "threads: {}; {}",
        setting.top_job, setting.rmw, setting.wanted, names_of(low), redag::runtime::realtime_hint()));
  }
  return report;
}

}  // namespace redag_rclcpp
