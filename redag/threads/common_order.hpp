// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// One order for all executors of a machine that take part: a map from rate to SCHED_FIFO priority. Each executor
// computes it from what all of them state. It depends on nothing else, so executors that have read the same statements
// have the same map. Pure.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "redag/base/time.hpp"
#include "redag/live/order_page.hpp"
#include "redag/model/workload.hpp"

namespace redag::runtime {

class CommonOrder {
 public:
  CommonOrder() = default;
  /// The priorities are those that every executor may use. Rates that share a level if there are too few are chosen by
  /// sched::assign_priorities().
  explicit CommonOrder(std::span<const live::OrderStatement> statements);

  /// Never increases with the period. A period that no executor has stated gets the priority of the next shorter one,
  /// or of the shortest of all. Requires a statement.
  [[nodiscard]] int priority_of(Duration period) const;

  friend bool operator==(const CommonOrder &, const CommonOrder &) = default;

 private:
  struct Step {
    Duration first = 0;  // the shortest stated period with this priority
    int priority = 0;

    friend bool operator==(const Step &, const Step &) = default;
  };
  int top_job_ = 0;
  std::vector<Step> steps_;  // most urgent first
};

/// Returns what tasks of an executor with this policy are ordered by in the common order. Empty: the policy does not
/// order by a time.
[[nodiscard]] std::optional<Duration> rate_of(PolicyKind policy, Duration period, Duration deadline);

/// Sorts `rates`, removes repetitions, and thins them out evenly to what a page holds.
void make_statable(std::vector<Duration> &rates);

/// What an executor does after it has read the pages of all.
struct OrderLook {
  bool must_publish = false;  // its own page is not there, or states something else
  CommonOrder order;
};

/// `own`: what the executor states. `pages`: those that it read, with or without its own.
[[nodiscard]] OrderLook look_at(const live::OrderPage &own, std::span<const live::OrderPage> pages);

}  // namespace redag::runtime
