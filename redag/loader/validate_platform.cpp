// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <unordered_set>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "redag/base/text.hpp"
#include "redag/derived/clusters.hpp"
#include "redag/loader/cpu_list.hpp"
#include "redag/loader/validate_parts.hpp"

namespace redag {
namespace {

/// Checks that the processors of clusters, or of the platform if it has none, exist and are listed once.
class CpuChecker {
 public:
  CpuChecker(const std::vector<Cluster> &clusters, FindingList &findings) : clusters_(clusters), findings_(findings) {}

  /// Checks those of cluster `c`; npos: of the platform.
  void check(const std::vector<int> &cpus, std::uint32_t workers, std::size_t c) {
    const bool is_cluster = c < clusters_.size();
    const Field at = is_cluster ? Field::Clusters : Field::Cpus;
    const std::size_t item = is_cluster ? c : Finding::kNone;
    const std::string owned = is_cluster ? fmt::format("cluster '{}'", clusters_[c].name) : "the platform";
    for (const int cpu : cpus) {
      std::string mistake;
      std::string hint;
      const auto [owner, is_first] = owners_.emplace(cpu, c);
      if (cpu < 0 || cpu > kMaxCpu) {
        mistake = fmt::format("{} has processor {}, which is not from 0 to {}", owned, cpu, kMaxCpu);
      } else if (is_first) {
        continue;
      } else if (owner->second == c) {
        mistake = fmt::format("processor {} of {} is listed twice", cpu, owned);
        hint = "list each one once";
      } else {
        mistake =
            fmt::format("processor {} of {} is also one of cluster '{}'", cpu, owned, clusters_[owner->second].name);
        hint = "clusters share no processors";
      }
      findings_.error(at, Field::Cpus, std::move(mistake), std::move(hint), item);
      return;
    }
    if (cpus.empty() || workers <= cpus.size()) return;
    findings_.warning(
        at, Field::Cpus | Field::Workers,
        fmt::format("{} has {} workers, but {} processor{}", owned, workers, cpus.size(), cpus.size() == 1 ? "" : "s"),
        fmt::format("list more processors, or write 'workers: {}': bounds and simulations assume a "
                    "processor for each worker",
                    cpus.size()),
        item);
  }

 private:
  const std::vector<Cluster> &clusters_;
  FindingList &findings_;
  std::unordered_map<int, std::size_t> owners_;
};

void check_clusters(const Platform &platform, FindingList &findings) {
  const std::vector<Cluster> &clusters = platform.clusters;
  if (!platform.cpus.empty()) {
    findings.error(Field::Cpus, Field::Clusters, "the platform has both 'cpus' and 'clusters'",
                   "each cluster has cpus of its own");
  }
  if (clusters.size() > kMaxClusters) {
    findings.error(Field::Clusters, {},
                   fmt::format("there are {} clusters; at most {} are allowed", clusters.size(), kMaxClusters));
  }
  std::unordered_set<std::string_view> names;
  CpuChecker cpus(clusters, findings);
  std::uint64_t workers = 0;
  for (std::size_t c = 0; c < clusters.size(); ++c) {
    const Cluster &cluster = clusters[c];
    const auto refuse = [&](Field field, std::string message, const char *hint = "") {
      findings.error(Field::Clusters, field, std::move(message), hint, c);
    };
    if (cluster.name.empty()) {
      refuse(Field::Name, "a cluster has no name", "add 'name:'");
    } else if (const std::string why = name_mistake(cluster.name); !why.empty()) {
      refuse(Field::Name, fmt::format("the name {} of a cluster {}", in_quotes(cluster.name), why));
    } else if (!names.insert(cluster.name).second) {
      refuse(Field::Name, fmt::format("the name '{}' is used by another cluster", cluster.name),
             "choose a unique name for each cluster");
    }
    check_numbers(cluster, fields::kCluster, fmt::format(" of cluster '{}'", cluster.name), refuse);
    workers += cluster.workers;
    cpus.check(cluster.cpus, cluster.workers, c);
  }
  std::string mistake;
  if (workers > kMaxWorkers) {
    mistake = fmt::format("the clusters have {} workers; together at most {} are allowed", workers, kMaxWorkers);
  } else if (platform.workers != workers) {
    mistake = fmt::format("the platform has {} workers, but its clusters have {}", platform.workers, workers);
  }
  if (!mistake.empty()) findings.error(Field::Clusters, Field::Workers, std::move(mistake));
}

void check_devices(const Platform &platform, FindingList &findings) {
  const std::vector<Device> &devices = platform.devices;
  if (devices.size() > kMaxDevices) {
    findings.error(Field::Devices, {},
                   fmt::format("there are {} devices; at most {} are allowed", devices.size(), kMaxDevices));
  }
  std::unordered_set<std::string_view> names;
  for (std::size_t d = 0; d < devices.size(); ++d) {
    const Device &device = devices[d];
    const auto refuse = [&](Field field, std::string message, const char *hint = "") {
      findings.error(Field::Devices, field, std::move(message), hint, d);
    };
    if (const std::string why = name_mistake(device.name); !why.empty()) {
      refuse(Field::Devices, fmt::format("the name {} of a device {}", in_quotes(device.name), why));
    } else if (!names.insert(device.name).second) {
      refuse(Field::Devices, fmt::format("the name '{}' is used by another device", device.name),
             "choose a unique name for each device");
    }
    if (!platform.clusters.empty() && device.queue == Device::Queue::Priority) {
      refuse(Field::Clusters,
             fmt::format("device '{}' needs 'queue: fifo': no order of jobs spans two clusters", device.name));
    }
    check_numbers(device, fields::kDevice, fmt::format(" of device '{}'", device.name), refuse);
  }
}

// Many DAGs can have this hint, which is therefore short.
std::string names_of(const std::vector<Cluster> &clusters) {
  constexpr std::size_t kMostBytes = 200;
  std::string names;
  for (const Cluster &cluster : clusters) {
    names += (names.empty() ? "" : ", ") + cluster.name;
    if (names.size() > kMostBytes) return "a cluster of the platform";
  }
  return clusters.size() == 1 ? names : "one of " + names;
}

void check_load(double utilization, std::uint32_t workers, const std::string &whose, std::uint32_t cluster,
                FindingList &findings) {
  constexpr double kRounding = 1e-9;
  if (utilization <= static_cast<double>(workers) * (1 + kRounding)) return;
  findings.warning(cluster == Finding::kNone ? Field::Workers : Field::Clusters,
                   Field::Workers | Field::Wcet | Field::Period | Field::Cluster,
                   fmt::format("utilization {:.4g}{} exceeds the capacity of {} worker{}", utilization, whose, workers,
                               workers == 1 ? "" : "s"),
                   "no schedule meets every deadline if jobs execute for their wcet", cluster);
}

}  // namespace

std::string device_mistake(const std::vector<Device> &devices) {
  Platform platform;
  platform.devices = devices;
  FindingList findings;
  check_devices(platform, findings);
  const std::vector<Finding> found = findings.take();
  return found.empty() ? std::string() : found.front().message;
}

void check_platform(const Platform &platform, FindingList &findings) {
  if (platform.clusters.empty()) {
    check_numbers(platform, fields::kPlatform, "",
                  [&](Field field, std::string mistake) { findings.error(field, {}, std::move(mistake)); });
    CpuChecker(platform.clusters, findings).check(platform.cpus, platform.workers, std::string::npos);
  } else {
    check_clusters(platform, findings);
  }
  check_devices(platform, findings);
}

void check_cluster_of(const Platform &platform, const Dag &dag, FindingList &findings) {
  if (cluster_of(platform, dag) || (dag.cluster.empty() && platform.clusters.empty())) return;
  std::string mistake = fmt::format("there is no cluster {}, which DAG '{}' names", in_quotes(dag.cluster), dag.name);
  std::string hint = "choose " + names_of(platform.clusters);
  if (dag.cluster.empty()) {
    mistake = fmt::format("DAG '{}' has no cluster", dag.name);
    hint = "add 'cluster:' with " + names_of(platform.clusters);
  } else if (platform.clusters.empty()) {
    mistake = fmt::format("DAG '{}' names a cluster, but the platform has no clusters", dag.name);
    hint = "add 'clusters:' to the platform, or remove 'cluster:'";
  }
  findings.error(Field::Cluster, Field::Clusters, std::move(mistake), std::move(hint));
}

void check_load(const Workload &workload, FindingList &findings) {
  const Platform &platform = workload.platform;
  if (platform.clusters.empty()) {
    return check_load(workload.utilization(), platform.workers, "", Finding::kNone, findings);
  }
  std::vector<double> loads(platform.clusters.size(), 0);
  std::vector<bool> serves(platform.clusters.size(), false);
  for (const Dag &dag : workload.dags) {
    const std::optional<std::size_t> cluster = cluster_of(platform, dag);
    if (!cluster) continue;
    loads[*cluster] += dag.utilization();
    serves[*cluster] = true;
  }
  for (std::uint32_t c = 0; c < platform.clusters.size(); ++c) {
    const Cluster &cluster = platform.clusters[c];
    check_load(loads[c], cluster.workers, fmt::format(" of cluster '{}'", cluster.name), c, findings);
    if (serves[c]) continue;
    findings.warning(Field::Clusters, FieldSet(Field::Cluster) | Field::Dags | Field::Name,
                     fmt::format("no DAG is in cluster '{}'", cluster.name), "", c);
  }
}

}  // namespace redag
