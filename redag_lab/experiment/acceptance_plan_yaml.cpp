// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Reads and writes the text form of a plan, which docs/experiments.md describes.
#include <array>
#include <utility>

#include <fmt/format.h>

#include "redag/model/workload_yaml.hpp"
#include "redag/trace/output_file.hpp"
#include "redag_lab/experiment/acceptance_plan.hpp"
#include "redag_lab/experiment/plan_yaml.hpp"

namespace redag::experiment {
namespace {

using yaml::find;
using yaml::Node;

constexpr std::array kPreemptions = {PreemptionMode::None, PreemptionMode::Os, PreemptionMode::Cooperative,
                                     PreemptionMode::Auto};
constexpr std::array kDeadlines = {DeadlineKind::Implicit, DeadlineKind::Constrained};

const std::vector<std::string_view> kTopKeys = {"experiment",  "name",    "seed",       "sets",
                                                "utilization", "dags",    "workers",    "deadlines",
                                                "preemption",  "methods", "simulation", "workload"};

class Reader : private PlanReader {
 public:
  Reader(const Node &root, std::string file) : PlanReader(std::move(file)), root_(root) {}

  Result<AcceptancePlan> run() {
    return read_plan(
        root_, "acceptance", kTopKeys, plan_, [this] { read(); }, [this] { return find_mistakes(plan_); });
  }

 private:
  void read() {
    take_text(root_, "name", plan_.name);
    take_seed(root_, plan_.seed);
    take_count(root_, "sets", plan_.sets, 1);
    take_range(root_, "utilization", plan_.utilization);
    take_counts(root_, "dags", plan_.dags);
    take_counts(root_, "workers", plan_.workers);
    take_list(root_, "deadlines", plan_.deadlines, [this](const Node &node, std::string_view key) {
      return one_of(node, key, std::span<const DeadlineKind>(kDeadlines));
    });
    take_list(root_, "preemption", plan_.preemption, [this](const Node &node, std::string_view key) {
      return one_of(node, key, std::span<const PreemptionMode>(kPreemptions));
    });
    take_list(root_, "methods", plan_.methods,
              [this](const Node &node, std::string_view key) { return text(node, key); });
    read_simulation();
    const Node *workload = find(root_, "workload");
    if (workload != nullptr && check_map(*workload, "workload", generation_keys())) {
      take_generation(*workload, plan_.workload);
    }
  }

  void read_simulation() {
    const Node *node = find(root_, "simulation");
    if (node == nullptr || !check_map(*node, "simulation", {"offsets", "periods"})) return;
    take_count(*node, "offsets", plan_.simulation.offsets, 0);
    take_count(*node, "periods", plan_.simulation.periods, 1);
  }

  const Node &root_;
  AcceptancePlan plan_;
};

}  // namespace

Result<AcceptancePlan> parse_acceptance_plan(std::string_view text, const std::string &file) {
  const Result<Node> root = yaml::parse(text, file);
  if (!root) return tl::unexpected<Diagnostics>(root.error());
  return Reader(*root, file).run();
}

Result<AcceptancePlan> load_acceptance_plan(const std::string &path) {
  const Result<std::string> text = trace::read_file(path, kMaxWorkloadBytes);
  if (!text) return tl::unexpected<Diagnostics>(text.error());
  return parse_acceptance_plan(*text, path);
}

std::string to_yaml(const AcceptancePlan &plan) {
  const auto number = [](auto value) { return fmt::format("{}", value); };
  const auto share = [](std::uint32_t value) { return fmt::format("{}", value / static_cast<double>(kMillion)); };
  const auto name = [](auto value) { return to_string(value); };
  std::string text = "experiment: acceptance\n";
  const auto line = [&text](std::string_view key, const std::string &value) {
    text += fmt::format("{}: {}\n", key, value);
  };
  line("name", plan.name);
  line("seed", number(plan.seed));
  line("sets", number(plan.sets));
  line("utilization", yaml_list(plan.utilization, share));
  line("dags", yaml_list(plan.dags, number));
  line("workers", yaml_list(plan.workers, number));
  line("deadlines", yaml_list(plan.deadlines, name));
  line("preemption", yaml_list(plan.preemption, name));
  line("methods", yaml_list(plan.methods, [](const std::string &method) { return method; }));
  line("simulation", fmt::format("{{offsets: {}, periods: {}}}", plan.simulation.offsets, plan.simulation.periods));
  text += "workload:\n" + generation_yaml(plan.workload, "  ");
  return text;
}

}  // namespace redag::experiment
