// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/stats.hpp"

#include <algorithm>
#include <stdexcept>

#include <fmt/format.h>

#include "redag/runtime/distribution_content.hpp"

namespace redag::runtime {

std::uint64_t Distribution::count() const { return content_ ? content_->counts.total() : 0; }
Duration Distribution::longest() const { return content_ ? content_->counts.longest() : 0; }

Duration Distribution::quantile(double share) const {
  if (!(share >= 0 && share <= 1)) {
    throw std::invalid_argument(
        fmt::format("quantile({}): a share is from 0 to 1; the 99th percentile is quantile(0.99)", share));
  }
  return content_ ? content_->counts.quantile(share) : 0;
}

bool DagStats::met_every_deadline() const {
  return std::all_of(tasks.begin(), tasks.end(), [](const TaskStats &task) { return task.misses() == 0; }) &&
         std::all_of(sinks.begin(), sinks.end(), [](const SinkStats &sink) { return sink.late == 0; });
}

}  // namespace redag::runtime
