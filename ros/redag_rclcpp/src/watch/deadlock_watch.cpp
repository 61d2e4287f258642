// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "watch/deadlock_watch.hpp"

#include <algorithm>
#include <string>

#include "rclcpp/logging.hpp"
#include "watch/thread_wait.hpp"

namespace redag_rclcpp {

using redag::kNever;

namespace {

class View final : public DeadlockView {
 public:
  View(const TaskTable &tasks, std::uint32_t workers, const std::vector<Endpoint> &endpoints)
      : tasks_(tasks), workers_(workers), endpoints_(endpoints) {}
  [[nodiscard]] std::uint32_t workers() const override { return workers_; }
  [[nodiscard]] CallbackPlace place_of(redag::TaskId task) const override { return tasks_.place_of(task); }
  [[nodiscard]] std::vector<Endpoint> endpoints() const override { return endpoints_; }
  [[nodiscard]] ThreadWait wait_of(int thread_id) const override { return wait_of_thread(thread_id); }

 private:
  const TaskTable &tasks_;
  const std::uint32_t workers_;
  const std::vector<Endpoint> &endpoints_;
};

rclcpp::Logger logger() { return rclcpp::get_logger("redag_rclcpp"); }

}  // namespace

void DeadlockWatch::look() {
  const redag::Time now = parts_.engine.now();
  if (wanted_ && next_look_ == kNever) next_look_ = now + DeadlockDetector::kInterval;
  if (now >= next_look_) look_now();
}

void DeadlockWatch::jobs_ended() {
  if (next_look_ != kNever) look_now();
}

void DeadlockWatch::look_now() {
  wanted_ = false;  // what arrives from here on sets it again
  parts_.engine.started(started_);
  const std::vector<Endpoint> endpoints = parts_.tasks.endpoints();
  const redag::Time now = parts_.engine.now();
  std::vector<Deadlock> begun;
  std::vector<Deadlock> ended;
  detector_.look(now, started_, View(parts_.tasks, workers_, endpoints), begun, ended);
  for (const Deadlock &deadlock : begun) {
    parts_.notes.add(deadlock);
    if (deadlock.certain) {
      RCLCPP_ERROR(logger(), "deadlock: %s", deadlock.text.c_str());
    } else {
      RCLCPP_WARN(logger(), "possible deadlock: %s", deadlock.text.c_str());
    }
  }
  for (const Deadlock &deadlock : ended) {
    parts_.notes.add(deadlock);
    RCLCPP_INFO(logger(), "the deadlock of %s has ended after %s", deadlock.waiting.c_str(),
                redag::humanize_duration(deadlock.ended - deadlock.begun).c_str());
  }
  const bool goes_on = detector_.has_reported() || std::any_of(endpoints.begin(), endpoints.end(),
                                                               [](const Endpoint &e) { return !e.kept.empty(); });
  if (goes_on) wanted_ = true;
  next_look_ = goes_on ? now + DeadlockDetector::kInterval : kNever;
}

}  // namespace redag_rclcpp
