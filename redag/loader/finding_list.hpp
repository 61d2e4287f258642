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

  /// Adds a finding that points at `at`. The rule examined this field and those of `involves`.
  Finding &error(Field at, FieldSet involves, std::string message, std::string hint = {}) {
    return add(Severity::Error, at, involves, std::move(message), std::move(hint));
  }
  Finding &warning(Field at, FieldSet involves, std::string message, std::string hint = {}) {
    return add(Severity::Warning, at, involves, std::move(message), std::move(hint));
  }

  [[nodiscard]] std::vector<Finding> take() { return std::move(findings_); }

 private:
  Finding &add(Severity severity, Field at, FieldSet involves, std::string message, std::string hint) {
    involves |= at;
    return findings_.emplace_back(
        Finding{severity, dag_, task_, at, Finding::kNone, involves, std::move(message), std::move(hint)});
  }

  DagId dag_;
  std::uint32_t task_ = Finding::kNone;
  std::vector<Finding> findings_;
};

}  // namespace redag
