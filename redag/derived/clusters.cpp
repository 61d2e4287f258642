// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/derived/clusters.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "redag/base/check.hpp"
#include "redag/base/int128.hpp"

namespace redag {
std::optional<std::size_t> cluster_of(const Platform &platform, const Dag &dag) {
  const std::vector<Cluster> &clusters = platform.clusters;
  if (dag.cluster.empty() && clusters.size() == 1) return std::size_t{0};
  const auto found = std::find_if(clusters.begin(), clusters.end(),
                                  [&](const Cluster &cluster) { return cluster.name == dag.cluster; });
  if (found == clusters.end()) return std::nullopt;
  return static_cast<std::size_t>(found - clusters.begin());
}

Result<void> refuse_clusters(const Workload &workload, std::string_view who) {
  if (workload.platform.clusters.empty()) return {};
  return make_error(fmt::format("{} cannot use a workload with clusters", who),
                    "give it a workload of one cluster: that cluster's DAGs, and 'workers:' in place of 'clusters:'");
}

std::vector<ClusterPart> parts_of(const Workload &workload) {
  const Platform &platform = workload.platform;
  std::vector<ClusterPart> parts(std::max<std::size_t>(1, platform.clusters.size()));
  std::uint32_t next_worker = 0;
  for (std::size_t c = 0; c < parts.size(); ++c) {
    ClusterPart &part = parts[c];
    part.workload.name = workload.name;
    part.workload.platform = platform;
    part.workload.platform.clusters.clear();
    part.workload.policy = workload.policy;
    part.workload.ties = workload.ties;
    part.first_worker = next_worker;
    part.cpus = platform.cpus;
    if (platform.clusters.empty()) continue;
    part.name = platform.clusters[c].name;
    part.cpus = platform.clusters[c].cpus;
    part.workload.platform.workers = platform.clusters[c].workers;
    next_worker += platform.clusters[c].workers;
  }
  std::size_t next_task = 0;
  for (std::size_t d = 0; d < workload.dags.size(); ++d) {
    const Dag &dag = workload.dags[d];
    const std::optional<std::size_t> cluster =
        platform.clusters.empty() ? std::optional<std::size_t>(0) : cluster_of(platform, dag);
    REDAG_CHECK(cluster.has_value(), "each DAG of a valid workload has a cluster");
    ClusterPart &part = parts[*cluster];
    part.workload.dags.push_back(dag);
    part.workload.dags.back().cluster.clear();
    part.dags.emplace_back(d);
    for (const Task &task : dag.tasks) {
      part.tasks.emplace_back(next_task++);
      std::vector<Duration> longest(platform.devices.size(), 0);
      for (const Wait &wait : task.waits) {
        if (wait.device.valid()) longest[wait.device.value] = std::max(longest[wait.device.value], wait.longest);
      }
      // In a queue of requests, each job of another cluster can be ahead with one.
      for (std::size_t i = 0; i < parts.size() * longest.size(); ++i) {
        Duration &others = parts[i % parts.size()].workload.platform.devices[i / parts.size()].others;
        const Int128 more = i % parts.size() == *cluster ? 0 : Int128{longest[i / parts.size()]} * task.concurrency;
        others = static_cast<Duration>(std::min<Int128>(others + more, kMaxDuration));
      }
    }
  }
  return parts;
}

std::vector<TaskPlace> places_in(const std::vector<ClusterPart> &parts) {
  std::size_t count = 0;
  for (const ClusterPart &part : parts) count += part.tasks.size();
  std::vector<TaskPlace> places(count);
  for (std::size_t p = 0; p < parts.size(); ++p) {
    for (std::size_t t = 0; t < parts[p].tasks.size(); ++t) {
      places[parts[p].tasks[t].value] = TaskPlace{static_cast<std::uint32_t>(p), TaskId(t)};
    }
  }
  return places;
}

}  // namespace redag
