// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Clusters: what files and validation refuse, and the parts into which they divide a workload.
#include "redag/derived/clusters.hpp"

#include <algorithm>
#include <ostream>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "redag/loader/validate.hpp"
#include "redag/loader/workload_yaml.hpp"
#include "tests/testing/builders.hpp"

namespace redag {
namespace {

constexpr const char *kTwo =
    "platform: {clusters: [{name: left, workers: 2, cpus: 0-1}, {name: right, workers: 1, cpus: [3, 5-6]}]}\n";

/// DAGs with these keys besides the name and a task. The first one is in line 3.
std::string dags(const std::vector<std::string> &keys) {
  std::string text = "dags:\n";
  for (std::size_t d = 0; d < keys.size(); ++d) {
    text += fmt::format("  - {{name: d{}{}, tasks: [{{name: t, wcet: 1ms, period: 10ms}}]}}\n", d, keys[d]);
  }
  return text;
}

std::string one_cluster(const char *keys) {
  return fmt::format("platform: {{clusters: [{{{}}}]}}\n", keys) + dags({""});
}

Workload two_clusters() {
  return parse_workload(kTwo + dags({", cluster: right", ", cluster: left", ", cluster: right"}), "w.yaml")
      .value()
      .workload;
}

TEST(Clusters, AreReadWithTheirWorkersAndProcessors) {
  const Workload workload = two_clusters();
  ASSERT_EQ(workload.platform.clusters.size(), 2U);
  EXPECT_EQ(workload.platform.clusters[0], (Cluster{"left", 2, {0, 1}}));
  EXPECT_EQ(workload.platform.clusters[1], (Cluster{"right", 1, {3, 5, 6}}));
  EXPECT_EQ(workload.platform.workers, 3U);
  EXPECT_EQ(workload.dags[0].cluster, "right");
}

TEST(Clusters, HaveAWorkerForEachProcessorByDefault) {
  const Result<LoadedWorkload> loaded = parse_workload(one_cluster("name: all, cpus: 4-6"), "w.yaml");
  ASSERT_TRUE(loaded) << to_string(loaded.error());
  EXPECT_EQ(loaded->workload.platform.clusters[0], (Cluster{"all", 3, {4, 5, 6}}));
  EXPECT_EQ(loaded->workload.platform.workers, 3U);
  const Result<LoadedWorkload> more = parse_workload(one_cluster("name: all, workers: 2, cpus: 4"), "w.yaml");
  ASSERT_TRUE(more) << to_string(more.error());
  EXPECT_NE(to_string(more->warnings).find("1:23: warning: cluster 'all' has 2 workers, but 1 processor ("),
            std::string::npos)
      << to_string(more->warnings);
}

TEST(Clusters, TheOnlyClusterNeedsNoName) {
  const Result<LoadedWorkload> only = parse_workload(one_cluster("name: all, workers: 4"), "w.yaml");
  ASSERT_TRUE(only) << to_string(only.error());
  EXPECT_EQ(cluster_of(only->workload.platform, only->workload.dags[0]), 0U);
}

struct Refused {
  std::string text;
  const char *expected;  // part of the only error

  friend std::ostream &operator<<(std::ostream &out, const Refused &mistake) { return out << mistake.text; }
};

class ClustersRefuse : public ::testing::TestWithParam<Refused> {};

TEST_P(ClustersRefuse, AtThePlace) {
  const Result<LoadedWorkload> loaded = parse_workload(GetParam().text, "w.yaml");
  ASSERT_FALSE(loaded);
  const auto errors = std::count_if(loaded.error().begin(), loaded.error().end(),
                                    [](const Diagnostic &found) { return found.severity == Severity::Error; });
  ASSERT_EQ(errors, 1) << to_string(loaded.error());
  EXPECT_NE(to_string(loaded.error()).find(GetParam().expected), std::string::npos) << to_string(loaded.error());
}

INSTANTIATE_TEST_SUITE_P(
    Files, ClustersRefuse,
    ::testing::Values(
        Refused{"platform: {workers: 2, clusters: [{name: a}]}\n" + dags({""}),
                "w.yaml:1:21: error: platform has both 'workers' and 'clusters' (each cluster has workers of its own"},
        Refused{"platform: {cpus: 0-3, clusters: [{name: a}]}\n" + dags({""}),
                "w.yaml:1:18: error: platform has both 'cpus' and 'clusters' (each cluster has cpus of its own"},
        Refused{"platform: {clusters: []}\n" + dags({""}), "1:22: error: clusters is an empty list"},
        Refused{"platform: {clusters: left}\n" + dags({", cluster: left"}), "1:22: error: clusters must be a list"},
        Refused{"platform: {clusters: [left]}\n" + dags({", cluster: left"}),
                "1:23: error: a cluster must be a map of name"},
        Refused{one_cluster("workers: 2"), "1:23: error: a cluster has no name"},
        Refused{one_cluster("name: a, workers: 0"), "1:42: error: workers must be a whole number from 1 to 4096"},
        Refused{one_cluster("name: a, cpus: all"), "1:39: error: cpus must be a list of processors such as 0-3"},
        Refused{one_cluster("name: a, cpus: []"), "1:39: error: cpus must be a list of processors"},
        Refused{one_cluster("name: a, cpus: 4-2"), "1:39: error: cpus must be a list of processors"},
        Refused{"platform: {clusters: [{name: a}, {name: a}]}\n" + dags({", cluster: a"}),
                "1:34: error: the name 'a' is used by another cluster"},
        Refused{"platform: {clusters: [{name: a, cpus: 0-3}, {name: b, cpus: 3-4}]}\n" +
                    dags({", cluster: a", ", cluster: b"}),
                "1:45: error: processor 3 of cluster 'b' is also one of cluster 'a' (clusters share no processors)"},
        Refused{
            "platform: {clusters: [{name: a, workers: 4096}, {name: b}]}\n" + dags({", cluster: a", ", cluster: b"}),
            "1:22: error: the clusters have 4097 workers; together at most 4096 are allowed"},
        Refused{kTwo + dags({", cluster: left", ", cluster: right", ""}),
                "w.yaml:5:5: error: DAG 'd2' has no cluster (add 'cluster:' with one of left, right)"},
        Refused{kTwo + dags({", cluster: left", ", cluster: rigth", ", cluster: right"}),
                "w.yaml:4:25: error: there is no cluster 'rigth', which DAG 'd1' names (choose one of left, right)"},
        Refused{dags({", cluster: left"}),
                "w.yaml:2:25: error: DAG 'd0' names a cluster, but the platform has no clusters"},
        Refused{
            std::string(kTwo) +
                "dags:\n"
                "  - {name: a, cluster: left, period: 1s, tasks: [{name: t, wcet: 1ms, group: bus}]}\n"
                "  - {name: b, cluster: right, period: 1s, tasks: [{name: t, wcet: 1ms, group: bus}]}\n",
            "w.yaml:4:79: error: group 'bus' spans two clusters: DAG 'a' is in 'left', and DAG 'b' is in 'right'"}));

TEST(Clusters, RefusesWhatOnlyCppCanBuild) {
  Workload workload = two_clusters();
  workload.platform.workers = 4;
  EXPECT_NE(to_string(validate(workload)).find("the platform has 4 workers, but its clusters have 3"),
            std::string::npos);
  workload = two_clusters();
  workload.platform.clusters[1].workers = 0;
  EXPECT_NE(to_string(validate(workload)).find("workers of cluster 'right' must be from 1"), std::string::npos);
  workload = two_clusters();
  workload.platform.clusters[1].cpus = {7, 7};
  EXPECT_NE(to_string(validate(workload)).find("processor 7 of cluster 'right' is listed twice"), std::string::npos);
  workload.platform.clusters[1].cpus = {-1};
  EXPECT_NE(to_string(validate(workload)).find("has processor -1, which is not from 0"), std::string::npos);
  workload = two_clusters();
  workload.platform.clusters.resize(kMaxClusters + 1, Cluster{"x", 1, {}});
  EXPECT_NE(to_string(validate(workload)).find("there are 65 clusters; at most 64"), std::string::npos);
}

TEST(Clusters, WarnOfLoadAndOfNoDags) {
  const std::string text = std::string(kTwo) +
                           "dags:\n  - {name: d, cluster: right, tasks: [{name: t, wcet: 9ms, period: 6ms, "
                           "deadline: 9ms}]}\n";
  const std::string warnings = to_string(parse_workload(text, "w.yaml").value().warnings);
  EXPECT_NE(warnings.find("w.yaml:1:60: warning: utilization 1.5 of cluster 'right' exceeds the capacity of 1 worker"),
            std::string::npos)
      << warnings;
  EXPECT_NE(warnings.find("w.yaml:1:23: warning: no DAG is in cluster 'left'"), std::string::npos) << warnings;
}

TEST(Clusters, DivideAWorkloadIntoParts) {
  const Workload workload = two_clusters();
  const std::vector<ClusterPart> parts = parts_of(workload);
  ASSERT_EQ(parts.size(), 2U);
  EXPECT_EQ(parts[0].name, "left");
  EXPECT_EQ(parts[0].workload.platform, (Platform{2, PreemptionMode::Auto}));
  EXPECT_EQ(parts[0].first_worker, 0U);
  EXPECT_EQ(parts[1].workload.platform.workers, 1U);
  EXPECT_EQ(parts[1].first_worker, 2U);
  EXPECT_EQ(parts[1].cpus, (std::vector{3, 5, 6}));
  EXPECT_EQ(parts[1].dags, (std::vector{DagId(0), DagId(2)}));
  EXPECT_EQ(parts[1].tasks, (std::vector{TaskId(0), TaskId(2)}));
  for (const ClusterPart &part : parts) EXPECT_EQ(to_string(validate(part.workload)), "");
  const std::vector<TaskPlace> places = places_in(parts);
  ASSERT_EQ(places.size(), 3U);
  EXPECT_EQ(places[1].part, 0U);
  EXPECT_EQ(places[2].part, 1U);
  EXPECT_EQ(places[2].task, TaskId(1));
}

TEST(Clusters, AWorkloadWithoutThemIsOnePart) {
  const Workload workload =
      testing::make_workload({testing::make_dag("d", {{"a", 10}}), testing::make_dag("e", {{"b", 9}})}, 3);
  const std::vector<ClusterPart> parts = parts_of(workload);
  ASSERT_EQ(parts.size(), 1U);
  EXPECT_EQ(parts[0].workload, workload);
  EXPECT_EQ(parts[0].tasks, (std::vector{TaskId(0), TaskId(1)}));
}

}  // namespace
}  // namespace redag
