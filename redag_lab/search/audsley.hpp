// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Priorities for whole units (tasks that are released together): Audsley's assignment from the least urgent one up, and
// what it needs of a test. A unit's tasks get one `priority`, so that they stay neighbours. Pure functions.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "redag/model/workload.hpp"
#include "redag_analysis/core/system.hpp"

namespace redag::analysis {

/// Units (positions in System::units), most urgent first.
using UnitOrder = std::vector<std::uint32_t>;

/// The workload under policy `fixed` with priorities that put the units of `system`, compiled from it, in this order.
[[nodiscard]] Workload with_order(const Workload &workload, const System &system, const UnitOrder &order);

/// As the policy of the system orders them, by their most urgent task.
[[nodiscard]] UnitOrder present_order(const System &system);

/// Shortest deadline first; of equal ones the shorter period. Optimal on one worker where D <= T, without jitter and
/// blocking (J. Leung, J. Whitehead, Performance Evaluation 2(4), 1982).
[[nodiscard]] UnitOrder deadline_order(const System &system);

/// Smallest D - k L first, k = (m - 1 + sqrt(5 m^2 - 6 m + 1)) / (2 m), L the longest path: a heuristic for several
/// workers. R. Davis, A. Burns, Improved priority assignment for global fixed priority pre-emptive scheduling in
/// multiprocessor real-time systems, Real-Time Systems 47(1), 2011 (DkC).
[[nodiscard]] UnitOrder dkc_order(const System &system);

/// A test that bounds the response of one unit given which units are more urgent, not in which order these are.
struct OrderFreeTest {
  std::string name;
  /// N. Audsley, On priority assignment in fixed priority scheduling, IPL 79(1), 2001; Davis and Burns 2011: the answer
  /// depends on the set of more urgent units and on that of less urgent ones, not on orders within them, and a unit
  /// that moves up is not worse off. Then what Audsley's assignment does not find, no order gives under this test.
  bool optimal = false;
  /// Response of `unit` if every more urgent unit keeps its deadline; nothing: no bound. `system` has static
  /// priorities.
  std::function<std::optional<Duration>(const System &system, std::uint32_t unit)> response;
};

/// The test for systems like this one under static priorities, or why there is none.
struct TestChoice {
  std::optional<OrderFreeTest> test;
  std::string reason;
};
[[nodiscard]] TestChoice order_free_test(const Workload &workload, const AnalysisPlatform &platform);

/// How much worse than its deadline a response is; smaller is better.
using Badness = std::function<double(Duration response, Duration due)>;

/// Fills priorities from the lowest up, each with the unit that is least late there (of equal ones the one with the
/// longest deadline): with an optimal test the largest lateness of all orders is smallest so. True `found`: every unit
/// keeps its deadline under the test. Nothing if `stop` ended it. O(n^2) tests.
struct AudsleyResult {
  UnitOrder order;
  bool found = false;
};
[[nodiscard]] std::optional<AudsleyResult> audsley(const Workload &workload, const AnalysisPlatform &platform,
                                                   const OrderFreeTest &test, const Badness &badness,
                                                   const std::function<bool()> &stop = {});

}  // namespace redag::analysis
