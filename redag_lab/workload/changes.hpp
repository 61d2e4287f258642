// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Lists the differences between two workloads, value by value. Pure functions.
#pragma once

#include <string>
#include <vector>

#include "redag/model/workload.hpp"

namespace redag::lab {

struct Change {
  enum class Kind : std::uint8_t {
    Setting,  // how the work is scheduled: platform, policy, bounds, order, overload rules
    Demand,   // the work itself: periods, deadlines, execution times, edges, DAGs and tasks that only one workload has
  };
  Kind kind = Kind::Setting;
  std::string what;  // "max_active of nav", "priority of nav.plan", "wcet of nav.plan"
  std::string before;
  std::string after;

  /// "max_active of nav: none -> 2"
  [[nodiscard]] std::string text() const { return what + ": " + before + " -> " + after; }
};

/// DAGs and tasks are matched by name. Their order and the workloads' own names do not count.
[[nodiscard]] std::vector<Change> changes_between(const Workload &before, const Workload &after);

/// Returns the bound as text, "none" for 0.
[[nodiscard]] std::string bound_text(std::uint32_t bound);

}  // namespace redag::lab
