// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The clusters of a workload: which one serves a DAG, and each one's part as a workload of its own. A cluster has one
// scheduler, and no job leaves it. A workload without clusters is one part. Pure functions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "redag/base/ids.hpp"
#include "redag/base/result.hpp"
#include "redag/model/workload.hpp"

namespace redag {

/// Returns the index of the cluster that serves the DAG; nothing if there is none.
[[nodiscard]] std::optional<std::size_t> cluster_of(const Platform &platform, const Dag &dag);

/// For what knows one scheduler only: an error that names it if the workload has clusters.
[[nodiscard]] Result<void> refuse_clusters(const Workload &workload, std::string_view who);

/// What one cluster runs. Its ids and workers count from 0; the whole workload has other numbers for them.
struct ClusterPart {
  std::string name;                // of the cluster; empty: the workload has no clusters
  Workload workload;               // its DAGs and workers, without clusters
  std::vector<int> cpus;           // of its workers; empty: any
  std::uint32_t first_worker = 0;  // number of its worker 0 in the whole platform
  std::vector<DagId> dags;         // by DagId of `workload`: the DAG in the whole
  std::vector<TaskId> tasks;       // by TaskId of `workload`: the task in the whole

  [[nodiscard]] bool is_cluster() const { return !name.empty(); }
};

/// Returns the parts in the order of the clusters. A part can be without DAGs. Requires a valid workload.
[[nodiscard]] std::vector<ClusterPart> parts_of(const Workload &workload);

/// Where a task stands among the parts.
struct TaskPlace {
  std::uint32_t part = 0;
  TaskId task;  // in ClusterPart::workload
};

/// Returns the place of each task of the whole, by TaskId.
[[nodiscard]] std::vector<TaskPlace> places_in(const std::vector<ClusterPart> &parts);

}  // namespace redag
