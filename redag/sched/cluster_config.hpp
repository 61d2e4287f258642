// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The configuration of one cluster's scheduler. Pure.
#pragma once

#include "redag/model/clusters.hpp"
#include "redag/sched/config.hpp"

namespace redag::sched {

/// `whole` is the configuration of the platform. Only the number of workers differs; `levels` and `max_started` are
/// those of each cluster.
[[nodiscard]] inline Config config_of(Config whole, const ClusterPart &part) {
  if (part.is_cluster()) whole.workers = part.workload.platform.workers;
  return whole;
}

}  // namespace redag::sched
