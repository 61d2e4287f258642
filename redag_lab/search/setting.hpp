// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// What `tune` may change of a workload, as one point of a search: workers, max_active of each DAG, and which DAG goes
// first where tasks of several have the same priority. Pure functions.
#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "redag/model/workload.hpp"
#include "redag_lab/search/coordinate_search.hpp"

namespace redag::tune {

struct Freedom {
  bool workers = true;
  bool caps = true;
  bool ties = true;
  std::uint32_t most_workers = 0;  // 0: as many as the workload has
  /// Instead of those of analysis::cap_choices(): for every DAG, whatever it has now.
  std::optional<std::pair<std::uint32_t, std::uint32_t>> cap_range;
};

/// A point is: workers; max_active by DAG; and for each DAG that shares a priority with an earlier one how many of
/// these it goes before (a Lehmer code: every order of the DAGs is one point).
class SettingSpace {
 public:
  SettingSpace(const Workload &workload, const Freedom &freedom);

  /// The first start is the workload as it is.
  [[nodiscard]] const analysis::SearchSpace &space() const { return space_; }

  [[nodiscard]] Workload apply(const analysis::Point &point) const;
  [[nodiscard]] std::uint32_t workers(const analysis::Point &point) const { return point.front(); }
  [[nodiscard]] analysis::Point caps(const analysis::Point &point) const;
  /// DAGs (positions) that tie with others, in the order in which they go first.
  [[nodiscard]] std::vector<std::uint32_t> tie_order(const analysis::Point &point) const;
  /// In how many coordinates it differs from the workload as it is.
  [[nodiscard]] std::size_t changes(const analysis::Point &point) const;

 private:
  const Workload &workload_;
  std::vector<std::uint32_t> tied_;  // DAGs with a choice, in order of position
  analysis::SearchSpace space_;
};

}  // namespace redag::tune
