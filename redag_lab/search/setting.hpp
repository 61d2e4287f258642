// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The settings that `tune` may change, as one point of a search: workers, max_active of each DAG, and the order of DAGs
// whose tasks share a priority. Pure functions.
#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "redag/model/workload.hpp"
#include "redag_lab/search/coordinate_search.hpp"

namespace redag::lab {

struct Freedom {
  bool workers = true;
  bool caps = true;
  bool ties = true;
  std::uint32_t most_workers = 0;  // 0: the workload's number
  /// Replaces cap_choices() for every DAG, whatever its present value.
  std::optional<std::pair<std::uint32_t, std::uint32_t>> cap_range;
};

/// Maps points to settings. A point holds the workers, the max_active of each DAG, and a Lehmer code of the ties. For
/// each DAG that shares a priority with an earlier one, the code is the number of these that it precedes. Every order
/// of the DAGs is one point.
class SettingSpace {
 public:
  SettingSpace(const Workload &workload, const Freedom &freedom);

  /// The first start is the present workload.
  [[nodiscard]] const SearchSpace &space() const { return space_; }

  [[nodiscard]] Workload apply(const Point &point) const;
  [[nodiscard]] std::uint32_t workers(const Point &point) const { return point.front(); }
  [[nodiscard]] Point caps(const Point &point) const;
  /// Returns the positions of the DAGs that tie with others, in the order of precedence.
  [[nodiscard]] std::vector<std::uint32_t> tie_order(const Point &point) const;
  /// Returns the number of coordinates that differ from the present workload.
  [[nodiscard]] std::size_t changes(const Point &point) const;

 private:
  const Workload &workload_;
  std::vector<std::uint32_t> tied_;  // DAGs with a choice, in order of position
  SearchSpace space_;
};

}  // namespace redag::lab
