// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Priorities for whole units (tasks that are released together). Audsley's assignment fills them from the least urgent
// one up; its requirements on a test are stated here. A unit's tasks get one `priority` and stay neighbours. Pure
// functions.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "redag/model/workload.hpp"
#include "redag_analysis/core/task_set.hpp"

namespace redag::lab {

/// Units (positions in TaskSet::units), most urgent first.
using UnitOrder = std::vector<std::uint32_t>;

/// Returns the workload under policy `fixed` with priorities that put its units in this order. `task_set` must be
/// compiled from `workload`.
[[nodiscard]] Workload with_order(const Workload &workload, const analysis::TaskSet &task_set, const UnitOrder &order);

/// Returns the units as the task set's policy orders them, by their most urgent task.
[[nodiscard]] UnitOrder present_order(const analysis::TaskSet &task_set);

/// Orders units by deadline, shortest first, and equal ones by period. Optimal on one worker where D <= T, without
/// jitter and blocking (J. Leung, J. Whitehead, Performance Evaluation 2(4), 1982).
[[nodiscard]] UnitOrder deadline_order(const analysis::TaskSet &task_set);

/// Orders units by D - k L, smallest first, with k = (m - 1 + sqrt(5 m^2 - 6 m + 1)) / (2 m). L is the longest path.
/// This is a heuristic for several workers: R. Davis, A. Burns, Improved priority assignment for global fixed priority
/// pre-emptive scheduling in multiprocessor real-time systems, Real-Time Systems 47(1), 2011 (DkC).
[[nodiscard]] UnitOrder dkc_order(const analysis::TaskSet &task_set);

/// A test that bounds one unit's response, given the set of more urgent units but not their order.
struct OrderFreeTest {
  std::string name;
  /// N. Audsley, On priority assignment in fixed priority scheduling, IPL 79(1), 2001; Davis and Burns 2011. The result
  /// depends on the sets of more and of less urgent units, not on orders within them. Moving up does not make a unit
  /// worse. If Audsley's assignment then finds no order, no order passes this test.
  bool optimal = false;
  /// Returns the response of `unit` if every more urgent unit keeps its deadline; nothing if there is no bound.
  /// `task_set` has static priorities.
  std::function<std::optional<Duration>(const analysis::TaskSet &task_set, std::uint32_t unit)> response;
};

/// The test for task sets like this one under static priorities, or the reason why there is none.
struct TestChoice {
  std::optional<OrderFreeTest> test;
  std::string reason;
};
[[nodiscard]] TestChoice order_free_test(const Workload &workload, const analysis::AnalysisPlatform &platform);

/// Rates a response against its deadline; smaller is better.
using Badness = std::function<double(Duration response, Duration due)>;

/// Fills priorities from the lowest up. Each place goes to the unit that is least late there; among equals, to the one
/// with the longest deadline. With an optimal test, the result has the smallest largest lateness of all orders. Returns
/// nothing if `stop` ended it. O(n^2) tests.
[[nodiscard]] std::optional<UnitOrder> audsley(const Workload &workload, const analysis::AnalysisPlatform &platform,
                                               const OrderFreeTest &test, const Badness &badness,
                                               const std::function<bool()> &stop = {});

}  // namespace redag::lab
