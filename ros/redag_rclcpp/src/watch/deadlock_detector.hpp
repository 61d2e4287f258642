// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Finds callbacks that wait for a response which cannot reach them: the response, or the request for it, has arrived,
// and the callback that would take it cannot start because of callbacks that all wait like this. A value that remembers
// earlier looks, without clock or thread. Not thread-safe.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "redag/engine/engine.hpp"
#include "redag_rclcpp/executor.hpp"
#include "watch/thread_wait.hpp"

namespace redag_rclcpp {

/// What a callback must get in order to start, besides a worker.
struct CallbackPlace {
  std::string name;        // "control.ekf", or the callback's own description
  std::string node;        // fully qualified
  std::string group;       // name of its mutually exclusive group; empty: it is in a reentrant one
  std::string group_text;  // "the default callback group of /planner"
  std::uint32_t dag = 0;
  std::string dag_name;
  std::uint32_t max_active = 0;  // of the DAG; 0: no bound
};

/// A request or response that has arrived and was not taken.
struct KeptInput {
  redag::Time arrived = 0;
  redag::JobSlot sender;  // the job on whose thread it arrived; invalid: a thread of the middleware, or unknown
};

/// The part of a callback in requests and responses.
struct Exchange {
  enum class Side : std::uint8_t { None, Client, Server };
  Side side = Side::None;
  bool is_action = false;
  std::string name;  // of the service; of an action, its type
};

/// The callback of a client or server of a service or action.
struct Endpoint {
  CallbackPlace place;
  Exchange exchange;
  std::vector<KeptInput> kept;
};

/// What the detector asks about the executor.
class DeadlockView {
 public:
  virtual ~DeadlockView() = default;
  [[nodiscard]] virtual std::uint32_t workers() const = 0;
  [[nodiscard]] virtual CallbackPlace place_of(redag::TaskId task) const = 0;
  [[nodiscard]] virtual std::vector<Endpoint> endpoints() const = 0;
  [[nodiscard]] virtual ThreadWait wait_of(int thread_id) const = 0;
};

class DeadlockDetector {
 public:
  /// Between two looks. A standstill is reported at most kStill and two of these after it began.
  static constexpr redag::Duration kInterval = 125 * redag::kMillisecond;
  /// A job that waits for a future is reported after this time without progress, together with the input that waits.
  static constexpr redag::Duration kStill = 500 * redag::kMillisecond;
  /// The same where it is uncertain what the job waits for.
  static constexpr redag::Duration kStillUncertain = 10 * redag::kSecond;

  /// Looks at the started jobs at `now`, which must not decrease. Appends what has begun and what has ended since the
  /// last look. Asks `view` only if a job has made no progress for some time.
  void look(redag::Time now, std::span<const redag::runtime::StartedJob> started, const DeadlockView &view,
            std::vector<Deadlock> &begun, std::vector<Deadlock> &ended);

  /// True while a deadlock lasts that was reported.
  [[nodiscard]] bool has_reported() const { return !reported_.empty(); }

 private:
  /// The topmost job of a thread that makes no progress. A loop that polls uses a little processor time.
  struct Still {
    redag::TaskId task;
    std::uint32_t number = 0;
    redag::Time since = 0;
    redag::Duration cpu = 0;            // at `since`
    std::uint32_t looks = 0;            // at which it waited
    std::uint32_t looks_at_future = 0;  // at which it waited for a future
    bool waits = false;                 // at the last look
  };
  struct Reported {
    redag::TaskId task;
    std::uint32_t number = 0;
    redag::Time arrived = 0;  // of the input that was blocked
    Deadlock deadlock;
  };
  class Picture;

  bool track(redag::Time now, std::span<const redag::runtime::StartedJob> started);
  void look_at_threads(redag::Time now, std::span<const redag::runtime::StartedJob> started, const DeadlockView &view);

  std::map<std::uint32_t, Still> still_;  // by thread
  std::vector<Reported> reported_;
};

}  // namespace redag_rclcpp
