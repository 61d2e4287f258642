// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The settings that `tune` may change, as one point of a search: workers, priorities, and max_active of each DAG. Pure
// functions.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "redag/model/workload.hpp"
#include "redag_analysis/core/task_set.hpp"
#include "redag_lab/search/coordinate_search.hpp"

namespace redag::lab {

struct Freedom {
  bool workers = true;
  bool caps = true;
  bool priorities = false;
  std::uint32_t most_workers = 0;  // 0: the workload's number
  /// Replaces the usual values for every DAG, whatever its present one.
  std::optional<std::pair<std::uint32_t, std::uint32_t>> cap_range;
};

/// An order of priorities to try: the workload, apart from its max_active and workers.
struct NamedOrder {
  std::string name;  // "present", "rate_monotonic", "deadline_monotonic"
  Workload workload;
};

/// Returns the orders worth trying, the present one first: by rates, and by deadlines. Only the present one where the
/// policy has no static priorities and the workload is schedulable. Requires a valid workload.
[[nodiscard]] std::vector<NamedOrder> orders_to_try(const Workload &workload,
                                                    const analysis::AnalysisPlatform &platform);

/// Maps points to settings. A point holds the workers, the position of the order, and the max_active of each DAG.
class SettingSpace {
 public:
  static constexpr std::size_t kOrder = 1;  // positions within a point; the workers come first
  static constexpr std::size_t kCaps = 2;

  /// `orders`: of orders_to_try(); the first is the workload itself.
  SettingSpace(const Workload &workload, const Freedom &freedom, std::vector<NamedOrder> orders);

  /// The first start is the present workload.
  [[nodiscard]] const SearchSpace &space() const { return space_; }

  [[nodiscard]] Workload apply(const Point &point) const;
  [[nodiscard]] const std::vector<NamedOrder> &orders() const { return orders_; }
  /// Returns the number of coordinates that differ from the present workload.
  [[nodiscard]] std::size_t changes(const Point &point) const;

 private:
  std::vector<NamedOrder> orders_;
  SearchSpace space_;
};

}  // namespace redag::lab
