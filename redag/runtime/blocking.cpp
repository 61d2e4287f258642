// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/blocking.hpp"

#include "redag/engine/running_job.hpp"

namespace redag {

Blocking::Blocking() : job_(runtime::RunningJob::current()) {
  if (job_ != nullptr && !job_->lend_worker()) job_ = nullptr;
}

Blocking::~Blocking() {
  if (job_ != nullptr) job_->take_worker();
}

}  // namespace redag
