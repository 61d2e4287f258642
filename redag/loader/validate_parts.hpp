// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The rules for parts of a workload, of which validate.cpp makes one list.
#pragma once

#include <cstdint>
#include <string>
#include <type_traits>
#include <utility>

#include <fmt/format.h>

#include "redag/base/text.hpp"
#include "redag/loader/fields.hpp"
#include "redag/loader/finding_list.hpp"

namespace redag {

/// Checks workers, processors, clusters and devices, at the place of the workload.
void check_platform(const Platform &platform, FindingList &findings);

/// Checks that the DAG names a cluster that exists, at the place of the DAG.
void check_cluster_of(const Platform &platform, const Dag &dag, FindingList &findings);

/// Warns about more work than the workers can do, and about clusters without a DAG, at the place of the workload.
void check_load(const Workload &workload, FindingList &findings);

/// Checks the waits of a task, at the place that is set. With `allowed` false, any wait is an error.
void check_waits(const Workload &workload, const Task &task, bool allowed, FindingList &findings);

/// Checks the predecessors of a task, at the place that is set. True if they exist, differ from each other and from the
/// task, and a data task has one.
bool check_edges(const Dag &dag, std::uint32_t task, FindingList &findings);

/// Checks the DAG as a whole: cycles and, if all edges are sound, inherited periods.
void check_graph(const Dag &dag, DagId id, bool sound_edges, FindingList &findings);

/// Says what is wrong with a number of `whose` ("of task 't'"). Empty: it is within its range.
template <class Member, class Owner>
std::string number_mistake(const fields::Row<Member> &row, const Owner &owner, const std::string &whose) {
  const auto value = owner.*row.member;
  const auto absent = Owner{}.*row.member;
  if ((value == absent && !row.rule.is_needed) || (value >= row.rule.least && value <= row.rule.most)) return {};
  if constexpr (!std::is_same_v<decltype(absent), const Duration>) {
    return fmt::format("{}{} must be from {} to {}, not {}", row.key, whose, row.rule.least, row.rule.most, value);
  } else if (value > row.rule.most) {
    return fmt::format("{}{} is too large; at most {} is allowed", row.key, whose, kMaxDurationText);
  } else {
    return fmt::format("{}{} must {}, not {}", row.key, whose,
                       row.rule.is_needed ? "be greater than zero" : "not be negative", format_duration(value));
  }
}

/// Calls `report` with each field whose number is a mistake, and with what to say about it.
template <class Owner, class Rows, class Report>
void check_numbers(const Owner &owner, const Rows &rows, const std::string &whose, const Report &report) {
  fields::for_each(rows, [&](const auto &row) {
    if constexpr (fields::kHasNumber<decltype(row.member)>) {
      if (std::string mistake = number_mistake(row, owner, whose); !mistake.empty())
        report(row.field, std::move(mistake));
    }
  });
}

}  // namespace redag
