// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Chooses the clusters of DAGs that name none: bin packing in which a DAG fits if all bounds of the cluster hold. Pure
// functions, apart from the hook.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "redag/model/clusters.hpp"
#include "redag/model/workload.hpp"
#include "redag_analysis/core/task_set.hpp"

namespace redag::lab {

struct Placement {
  /// The input with a cluster for every DAG that was placed. Valid if no DAG is left over.
  Workload workload;
  std::vector<DagId> placed;     // named no cluster, and have one now
  std::vector<DagId> left_over;  // fit into no cluster together: the first ones that did not
  std::vector<bool> holds;       // by cluster: every deadline is shown to be met
  std::uint64_t analyses = 0;
  bool stopped = false;

  /// True if every DAG has a cluster, and every cluster meets every deadline.
  [[nodiscard]] bool is_schedulable() const;
};

/// Places DAGs by first fit, those of the largest utilization first. DAGs that share a group stay together, and with
/// those of them that name a cluster. DAGs that name one stay there. Ends at the first DAGs that fit nowhere. It is a
/// heuristic: another placement may pass. `stop` is asked before every analysis. Requires clusters and a workload that
/// is valid except for missing clusters. Error: of compile().
[[nodiscard]] Result<Placement> place(const Workload &workload, const analysis::AnalysisPlatform &platform,
                                      const std::function<bool()> &stop = {});

}  // namespace redag::lab
