// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/analyze/placement_report.hpp"

#include <fmt/format.h>

#include <vector>

#include "redag_analysis/text/table.hpp"
#include "redag_analysis/text/tint.hpp"

namespace redag::cli {
namespace {

using lab::Placement;

// The DAGs of each cluster.
std::vector<Workload> dags_of(const Workload &workload) {
  std::vector<Workload> all(workload.platform.clusters.size());
  for (const Dag &dag : workload.dags) {
    if (const auto cluster = cluster_of(workload.platform, dag)) all[*cluster].dags.push_back(dag);
  }
  return all;
}

std::vector<std::string> names_of(const Workload &workload) {
  std::vector<std::string> names;
  for (const Dag &dag : workload.dags) names.push_back(dag.name);
  return names;
}

std::string names_of(const Workload &workload, const std::vector<DagId> &dags) {
  std::string names;
  for (const DagId dag : dags) names += (names.empty() ? "" : ", ") + workload.dags[dag.value].name;
  return names;
}

std::string verdict_of(const Placement &placement) {
  if (placement.stopped) return "stopped before every cluster was analysed";
  if (!placement.left_over.empty()) {
    return fmt::format(
        "no cluster can take {}: with {}, no cluster is shown to meet every deadline; another placement may pass",
        names_of(placement.workload, placement.left_over), placement.left_over.size() == 1 ? "it" : "them");
  }
  if (placement.is_schedulable()) return "schedulable: every deadline is met in every cluster";
  return "not shown schedulable: some DAGs that name their cluster may miss a deadline there; see 'redag analyze'";
}

}  // namespace

std::string describe(const Placement &placement, const StreamTraits &terminal) {
  const Workload &workload = placement.workload;
  Table table({{.title = "cluster", .importance = 3},
               {.title = "workers", .number = true, .importance = 1},
               {.title = "utilization", .number = true, .importance = 1},
               {.title = "deadlines", .importance = 2},
               {.title = "DAGs", .importance = 2, .prose = true}});
  const std::vector<Workload> served = dags_of(workload);
  for (std::size_t c = 0; c < served.size(); ++c) {
    const Cluster &cluster = workload.platform.clusters[c];
    const bool holds = placement.holds[c];
    table.add({{cluster.name, Tint::Plain},
               {fmt::format("{}", cluster.workers), Tint::Plain},
               {fmt::format("{:.3f}", served[c].utilization()), Tint::Plain},
               {holds ? "met" : "not shown", holds ? Tint::Good : Tint::Bad},
               {fmt::format("{}", fmt::join(names_of(served[c]), ", ")), Tint::Plain}});
  }
  std::string text = fmt::format("{}: clusters by first fit, the DAG of the largest utilization first; {} analyses\n\n",
                                 workload.name, placement.analyses);
  text += table.render(terminal.width, terminal.colour) + "\n";
  for (const DagId dag : placement.placed) {
    text += tinted("change ", Tint::Strong, terminal.colour) +
            fmt::format("cluster of {}: {}\n", workload.dags[dag.value].name, workload.dags[dag.value].cluster);
  }
  return text + tinted(verdict_of(placement), placement.is_schedulable() ? Tint::Good : Tint::Bad, terminal.colour) +
         "\n";
}

Json to_json(const Placement &placement) {
  const Workload &workload = placement.workload;
  const auto names = [&](const std::vector<DagId> &dags) {
    Json list = Json::array();
    for (const DagId dag : dags) list.push_back(workload.dags[dag.value].name);
    return list;
  };
  Json document = {
      {"format", "redag.placement/1"}, {"workload", workload.name},         {"schedulable", placement.is_schedulable()},
      {"text", verdict_of(placement)}, {"placed", names(placement.placed)}, {"left_over", names(placement.left_over)},
      {"stopped", placement.stopped},  {"analyses", placement.analyses},    {"clusters", Json::array()}};
  const std::vector<Workload> served = dags_of(workload);
  for (std::size_t c = 0; c < served.size(); ++c) {
    const Cluster &cluster = workload.platform.clusters[c];
    document["clusters"].push_back(Json{{"name", cluster.name},
                                        {"workers", cluster.workers},
                                        {"utilization", served[c].utilization()},
                                        {"schedulable", static_cast<bool>(placement.holds[c])},
                                        {"dags", names_of(served[c])}});
  }
  return document;
}

}  // namespace redag::cli
