// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/load.hpp"

#include <utility>

#include <fmt/format.h>

#include "redag/loader/text_file.hpp"
#include "redag/loader/workload_yaml.hpp"
#include "redag/loader/workload_yaml_values.hpp"
#include "redag/version.hpp"
#include "redag_lab/experiment/acceptance.hpp"
#include "redag_lab/experiment/unit_store.hpp"

namespace redag::experiment {
namespace {

using yaml::Node;

// Returns the same text for plans that differ in comments and layout only.
std::string canonical(const Node &node) {
  std::string text = fmt::format("{}:{}(", node.text.size(), node.text);
  for (const Node &child : node.children) text += canonical(child);
  return text + ")";
}

std::string subject_of(const std::string &plan) {
  return fmt::format("redag {} plan {:016x}", kVersion, checksum(plan));
}

}  // namespace

Result<LoadedExperiment> load_experiment(const std::string &path, const ExecutorNames &executors, Drive drive) {
  const Result<std::string> text = read_file(path, kMaxWorkloadBytes);
  if (!text) return tl::unexpected<Diagnostics>(text.error());
  const Result<Node> root = yaml::parse(*text, path);
  if (!root) return tl::unexpected<Diagnostics>(root.error());
  const Node *kind = root->kind == Node::Kind::Map ? yaml::find(*root, "experiment") : nullptr;
  LoadedExperiment loaded{*text, {}, nullptr};
  std::string identity = canonical(*root);
  if (kind != nullptr && kind->text == "acceptance") {
    Result<AcceptancePlan> plan = read_acceptance_plan(*root, path);
    if (!plan) return tl::unexpected<Diagnostics>(plan.error());
    loaded.experiment = std::make_unique<Acceptance>(std::move(*plan));
  } else if (kind != nullptr && kind->text == "factorial") {
    Result<FactorialPlan> plan = read_factorial_plan(*root, path, executors);
    if (!plan) return tl::unexpected<Diagnostics>(plan.error());
    for (const WorkloadSource &source : plan->workloads) identity += to_yaml(source.workload);
    loaded.experiment = std::make_unique<Factorial>(std::move(*plan), std::move(drive));
  } else {
    return file_error(path, kind == nullptr ? 1 : kind->line, "this is no plan of an experiment",
                      "write 'experiment: acceptance' or 'experiment: factorial', see docs/experiments.md");
  }
  loaded.subject = subject_of(identity);
  return loaded;
}

}  // namespace redag::experiment
