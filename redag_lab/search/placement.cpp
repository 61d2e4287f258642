// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/search/placement.hpp"

#include <algorithm>
#include <map>
#include <numeric>
#include <optional>
#include <utility>

#include "redag_analysis/analyze/analyze.hpp"

namespace redag::lab {
namespace {

// DAGs that have to be in one cluster.
struct Bundle {
  std::vector<std::size_t> dags;
  std::optional<std::size_t> cluster;  // that one of them names
  double utilization = 0;
};

// Joins DAGs that share a group, also through other DAGs.
std::vector<Bundle> bundles_of(const Workload &workload) {
  std::vector<std::size_t> first(workload.dags.size());  // a DAG of the same bundle, up to the bundle's first
  std::iota(first.begin(), first.end(), std::size_t{0});
  const auto root = [&](std::size_t d) {
    while (first[d] != d) d = first[d] = first[first[d]];
    return d;
  };
  std::map<std::string_view, std::size_t> users;  // group -> DAG
  for (std::size_t d = 0; d < workload.dags.size(); ++d) {
    for (const Task &task : workload.dags[d].tasks) {
      if (task.group.empty()) continue;
      const std::size_t other = root(users.emplace(task.group, d).first->second);
      const std::size_t own = root(d);
      first[std::max(own, other)] = std::min(own, other);
    }
  }
  std::vector<Bundle> bundles;
  std::vector<std::size_t> position(workload.dags.size());
  for (std::size_t d = 0; d < workload.dags.size(); ++d) {
    if (root(d) == d) {
      position[d] = bundles.size();
      bundles.emplace_back();
    }
    const Dag &dag = workload.dags[d];
    Bundle &bundle = bundles[position[root(d)]];
    bundle.dags.push_back(d);
    if (const auto cluster = cluster_of(workload.platform, dag)) bundle.cluster = cluster;
    bundle.utilization += dag.utilization();
  }
  return bundles;
}

class Packer {
 public:
  Packer(const Workload &workload, const analysis::AnalysisPlatform &platform, const std::function<bool()> &stop)
      : platform_(platform), stop_(stop) {
    result_.workload = workload;
    result_.holds.resize(workload.platform.clusters.size(), true);
  }

  Result<Placement> run() {
    std::vector<Bundle> bundles = bundles_of(result_.workload);
    std::vector<const Bundle *> open;
    for (const Bundle &bundle : bundles) {
      if (bundle.cluster) {
        put(bundle, *bundle.cluster);
      } else {
        open.push_back(&bundle);
      }
    }
    std::stable_sort(open.begin(), open.end(),
                     [](const Bundle *a, const Bundle *b) { return a->utilization > b->utilization; });
    for (std::size_t c = 0; c < result_.holds.size(); ++c) result_.holds[c] = holds(c);
    for (const Bundle *bundle : open) {
      if (error_.empty() && !result_.stopped && fit(*bundle)) continue;
      for (const std::size_t d : bundle->dags) result_.left_over.emplace_back(d);
      break;
    }
    if (!error_.empty()) return tl::unexpected<Diagnostics>(std::move(error_));
    return std::move(result_);
  }

 private:
  bool fit(const Bundle &bundle) {
    for (std::size_t c = 0; c < result_.holds.size(); ++c) {
      if (!result_.holds[c]) continue;
      put(bundle, c);
      if (holds(c)) {
        for (const std::size_t d : bundle.dags) result_.placed.emplace_back(d);
        return true;
      }
    }
    for (const std::size_t d : bundle.dags) result_.workload.dags[d].cluster.clear();
    return false;
  }

  void put(const Bundle &bundle, std::size_t cluster) {
    for (const std::size_t d : bundle.dags) {
      result_.workload.dags[d].cluster = result_.workload.platform.clusters[cluster].name;
    }
  }

  // Analyses the cluster with the DAGs that it has now.
  bool holds(std::size_t cluster) {
    Workload placed = result_.workload;
    std::erase_if(placed.dags, [&](const Dag &dag) { return cluster_of(placed.platform, dag) != cluster; });
    if (placed.dags.empty()) return true;
    result_.stopped = result_.stopped || (stop_ && stop_());
    if (result_.stopped) return false;
    ++result_.analyses;
    const ClusterPart part = std::move(parts_of(placed)[cluster]);
    const Result<analysis::TaskSet> task_set = analysis::compile(part.workload, analysis::platform_of(platform_, part));
    if (!task_set) {
      error_ = task_set.error();
      return false;
    }
    return analysis::analyze(*task_set).verdict == analysis::Verdict::Schedulable;
  }

  const analysis::AnalysisPlatform &platform_;
  const std::function<bool()> &stop_;
  Placement result_;
  Diagnostics error_;
};

}  // namespace

bool Placement::is_schedulable() const {
  return left_over.empty() && !stopped && std::find(holds.begin(), holds.end(), false) == holds.end();
}

Result<Placement> place(const Workload &workload, const analysis::AnalysisPlatform &platform,
                        const std::function<bool()> &stop) {
  return Packer(workload, platform, stop).run();
}

}  // namespace redag::lab
