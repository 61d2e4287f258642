// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The findings about one workload, while its validation walks through it. For validate.cpp and validate_edges.cpp.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "redag/loader/validate.hpp"

namespace redag {

class FindingList {
 public:
  /// Sets the place of the findings that follow: a task, a DAG, or the workload.
  void at(DagId dag, std::uint32_t task = Finding::kNone) {
    dag_ = dag;
    task_ = task;
  }

  /// Adds a finding that points at `at`, or at an item of it. The rule examined this field and those of `involves`.
  void error(Field at, FieldSet involves, std::string message, std::string hint = {}, std::size_t item = kNone) {
    add(Severity::Error, at, involves, std::move(message), std::move(hint), item);
  }
  void warning(Field at, FieldSet involves, std::string message, std::string hint = {}, std::size_t item = kNone) {
    add(Severity::Warning, at, involves, std::move(message), std::move(hint), item);
  }

  [[nodiscard]] std::vector<Finding> take() { return std::move(findings_); }

 private:
  static constexpr std::uint32_t kNone = Finding::kNone;

  void add(Severity severity, Field at, FieldSet involves, std::string message, std::string hint, std::size_t item) {
    findings_.emplace_back(Finding{severity, dag_, task_, at, static_cast<std::uint32_t>(item), involves | at,
                                   std::move(message), std::move(hint)});
  }

  DagId dag_;
  std::uint32_t task_ = kNone;
  std::vector<Finding> findings_;
};

}  // namespace redag
