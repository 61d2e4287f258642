// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// How long the jobs of a unit wait for the workers and for devices together: the arithmetic of the bounds for tasks
// that wait (suspension_aware.hpp). The workers and each device are resources of several servers. Not thread-safe; the
// fixed points allocate nothing.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "redag/base/int128.hpp"
#include "redag_analysis/many_workers/global.hpp"

namespace redag::analysis::global {

/// The workers, or a device.
struct Resource {
  std::uint32_t servers = 1;
  bool is_fifo = false;     // first come, first served; otherwise the most urgent first
  bool is_instant = false;  // more urgent jobs take a server at once; otherwise jobs keep theirs
  DeviceId device;          // none: the workers
};

/// What the jobs of a unit do at one resource.
struct Demand {
  GlobalUnit work;             // `volume` is the time at this resource; what dag_work() reads
  Duration path = 0;           // the most of it on one path
  Duration ahead = 0;          // the most of it that can be in a first-come queue at one time
  std::uint32_t requests = 0;  // the most on one path; of all tasks if a max_active can bind
  std::uint32_t tasks = 0;     // those with a request
};

/// The windows of all units. `units` must outlive this object; their order may change between calls. A unit is delayed
/// by all units before it, and blocked by services of those behind it that have begun.
class Contention {
 public:
  /// Sets the `volume` (processor time) and the `length` (of the longest path, with its waits) of each unit.
  Contention(const TaskSet &task_set, std::vector<GlobalUnit> &units, std::uint32_t workers);

  /// Why sums would not be exact; empty if they are.
  [[nodiscard]] const std::optional<std::string> &why_not() const { return why_not_; }

  /// Sets the response of units[k] from those of units[0 .. k). Returns false above its limit. Below the window `start`
  /// there is no fixed point.
  [[nodiscard]] bool respond(std::size_t k, Duration start);

  /// narrow() leaves of the unit only this part; null gives back the whole.
  void narrow(GlobalUnit &unit, const Part *part);

  /// The response of units[k], itemised if that is asked for.
  [[nodiscard]] ResponseBound explain(std::size_t k);

 private:
  // What one task does at one resource.
  struct Use {
    Duration time = 0;
    Duration longest = 0;
    std::uint32_t requests = 0;
  };
  // A longest path by scaled weights.
  struct Path {
    Int128 weight = 0;
    std::vector<std::uint32_t> tasks;
  };

  void find_uses();
  void find_demands(GlobalUnit &unit);
  [[nodiscard]] const std::vector<std::uint32_t> &tasks_of(const Unit &unit) const {
    return part_ ? part_->tasks : unit.tasks;
  }
  [[nodiscard]] const std::vector<std::uint32_t> &paths_of(const Unit &unit) const {
    return part_ ? part_->paths : unit.tasks;
  }
  void check_sums();
  void make_divisible(std::uint32_t divisor);
  [[nodiscard]] std::uint32_t cap_of(const GlobalUnit &unit) const;
  [[nodiscard]] Duration blocking_at(std::size_t resource, std::size_t k) const;
  [[nodiscard]] Int128 share(Int128 time, std::uint32_t divisor) const { return time * (scale_ / divisor); }
  [[nodiscard]] std::uint32_t own_divisor(std::size_t resource) const;
  [[nodiscard]] Path heaviest_path(const Unit &unit) const;

  void open(std::size_t k);
  Duration sum_works(std::size_t resource, Duration window);
  [[nodiscard]] Duration instants(std::size_t resource, Duration others) const;
  [[nodiscard]] Duration next(Duration window);

  void explain_apart(SharedTerms &terms);
  void explain_together(SharedTerms &terms);

  const TaskSet &task_set_;
  std::vector<GlobalUnit> &units_;
  std::vector<Resource> resources_;  // the workers, then the devices
  std::optional<std::string> why_not_;
  Int128 scale_ = 1;                          // a multiple of every divisor
  std::vector<std::vector<Use>> uses_;        // by TaskId and resource
  std::vector<std::vector<Demand>> demands_;  // by position in TaskSet::units, and resource
  std::vector<Duration> elsewhere_;           // by position in TaskSet::units: waits without a device on one path
  std::vector<Duration> works_;               // of units[0 .. k) at one resource in the current window

  const Part *part_ = nullptr;  // what is left of the unit whose window is open; null: all
  // The unit whose window is open.
  std::size_t k_ = 0;
  std::uint32_t cap_ = 0;           // its max_active if it can bind, else 0
  std::vector<Duration> blocking_;  // by resource: less urgent work before one request
  Duration apart_ = 0;              // the most on its paths, each kind of time for itself
  Int128 together_ = 0;             // scaled: its heaviest path, and its other tasks
  bool is_apart_ = false;           // which of the two the last window was bounded by
};

}  // namespace redag::analysis::global
