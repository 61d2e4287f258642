// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/runtime/stats.hpp"

#include <algorithm>

#include "redag/runtime/distribution_content.hpp"

namespace redag::runtime {

std::uint64_t Distribution::count() const { return content_ ? content_->counts.total() : 0; }
Duration Distribution::longest() const { return content_ ? content_->counts.longest() : 0; }
Duration Distribution::percentile(double share) const { return content_ ? content_->counts.percentile(share) : 0; }

bool DagStats::met_every_deadline() const {
  return std::all_of(tasks.begin(), tasks.end(), [](const TaskStats &task) { return task.misses() == 0; }) &&
         std::all_of(sinks.begin(), sinks.end(), [](const SinkStats &sink) { return sink.late == 0; });
}

}  // namespace redag::runtime
