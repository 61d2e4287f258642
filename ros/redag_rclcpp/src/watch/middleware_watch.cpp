// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "watch/middleware_watch.hpp"

#include "rcl/context.h"
#include "rclcpp/logging.hpp"
#include "watch/middleware_report.hpp"

namespace redag_rclcpp {

namespace {

constexpr redag::Duration kThreadsAppear = redag::kSecond;  // after a start or new entities

rclcpp::Logger logger() { return rclcpp::get_logger("redag_rclcpp"); }

}  // namespace

// Threads can appear late: that there are none is not reported yet.
void MiddlewareWatch::begun(redag::Time now) {
  if (!raised_.found().threads.empty()) report();
  next_look_ = now + kThreadsAppear;
}

void MiddlewareWatch::look(redag::Time now, bool entities_came) {
  if (now >= next_look_) {
    next_look_ = redag::kNever;
    raised_.look();
    report();
  }
  if (entities_came && next_look_ == redag::kNever) next_look_ = now + kThreadsAppear;
}

// Logs what was found, if it differs from the last time.
void MiddlewareWatch::report() {
  const rmw_context_t *const rmw = rcl_context_get_rmw_context(parts_.context.get_rcl_context().get());
  const MiddlewareReport report =
      describe(raised_.found(),
               {.rmw = rmw == nullptr || rmw->implementation_identifier == nullptr ? "the middleware"
                                                                                   : rmw->implementation_identifier,
                .wanted = raised_.priority(),
                .top_job = parts_.setup.top_job_priority(),
                .timer = parts_.setup.timer_priority()});
  if (report.summary != parts_.summary) RCLCPP_INFO(logger(), "%s", report.summary.c_str());
  parts_.summary = report.summary;
  for (const std::string &warning : report.warnings) {
    if (parts_.notes.warn(warning)) RCLCPP_WARN(logger(), "%s", warning.c_str());
  }
}

}  // namespace redag_rclcpp
