// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A workload that keeps all rules, for executors that do not load the rules. validated() of redag/loader/validate.hpp
// makes it.
#pragma once

#include <utility>

#include "redag/base/result.hpp"
#include "redag/model/workload.hpp"

namespace redag {

class ValidWorkload {
 public:
  [[nodiscard]] const Workload &operator*() const { return workload_; }
  [[nodiscard]] const Workload *operator->() const { return &workload_; }

 private:
  friend Result<ValidWorkload> validated(Workload workload);
  explicit ValidWorkload(Workload workload) : workload_(std::move(workload)) {}

  Workload workload_;
};

}  // namespace redag
