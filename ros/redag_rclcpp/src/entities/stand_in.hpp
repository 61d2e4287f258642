// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A job that waits for something that the callback of an action client brings may hold that callback's group. The
// callback cannot start then. The job stands in for it: it is woken by what arrives, and handles it.
#pragma once

#include <memory>

#include "redag/runtime/async_event.hpp"

namespace redag_rclcpp {

class Callback;

/// The callback of an action client. Any thread.
class ActionClientCallback {
 public:
  virtual ~ActionClientCallback() = default;
  /// From here on, a job of the callback's mutually exclusive group handles what arrives: `event` is set by each
  /// arrival. There is one such job at a time, as it holds the group.
  virtual void begin_stand_in(redag::AsyncEvent &event) = 0;
  /// Handles one arrival on the job's thread. Returns false if there is none. Throws what the user's function throws.
  [[nodiscard]] virtual bool stand_in() = 0;
  virtual void end_stand_in() = 0;
};

/// A part of the job that waits. Used on the thread that runs it.
class StandIn {
 public:
  /// `event`: for which the job waits. It outlives this.
  StandIn(Callback &waiting, redag::AsyncEvent &event) : waiting_(waiting), event_(event) {}
  ~StandIn() { leave(); }
  StandIn(const StandIn &) = delete;
  StandIn &operator=(const StandIn &) = delete;

  /// Stands in for the callback of this action client if it is in the group of the waiting one. A client can join and
  /// leave the executor during a wait. Throws redag::WaitCancelled if the waiting callback has left it.
  void look_for(const void *client);
  /// See ActionClientCallback::stand_in().
  [[nodiscard]] bool handle_one() { return replaced_ && replaced_->stand_in(); }

 private:
  void leave();

  Callback &waiting_;
  redag::AsyncEvent &event_;
  std::shared_ptr<ActionClientCallback> replaced_;  // null: it runs its own jobs, or there is none
};

}  // namespace redag_rclcpp
