// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Reads the text form of a plan, which docs/experiments.md describes.
#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "redag_analysis/core/bound.hpp"
#include "redag_lab/experiment/acceptance.hpp"
#include "redag_lab/experiment/plan_reader.hpp"

namespace redag::experiment {
namespace {

constexpr std::array kPreemptions = {PreemptionMode::None, PreemptionMode::Os};
constexpr std::uint64_t kMostTasks = 100'000;  // of one workload

class AcceptanceReader : private PlanReader {
 public:
  AcceptanceReader(const Node &root, std::string file) : PlanReader(root, std::move(file)) {}

  Result<AcceptancePlan> run() {
    if (check_map(root_, "a plan",
                  {"experiment", "name", "seed", "sets", "utilization", "dags", "workers", "preemption", "methods",
                   "simulation", "workload"})) {
      read();
      if (diagnostics_.empty()) check();
    }
    if (Diagnostics found = take_diagnostics(); !found.empty()) return tl::unexpected<Diagnostics>(std::move(found));
    return std::move(plan_);
  }

 private:
  void read() {
    take(root_, "name", plan_.name);
    take(root_, "seed", plan_.seed);
    take(root_, "sets", plan_.sets);
    take_range("utilization", plan_.utilization);
    take_list("dags", plan_.dags);
    take_list("workers", plan_.workers);
    take_list("preemption", plan_.preemption, kPreemptions);
    take_list("methods", plan_.methods);
    const Node *simulation = yaml::find(root_, "simulation");
    if (simulation != nullptr && check_map(*simulation, "simulation", {"offsets", "periods"})) {
      take(*simulation, "offsets", plan_.simulation.offsets, 0);
      take(*simulation, "periods", plan_.simulation.periods);
    }
    const Node *workload = yaml::find(root_, "workload");
    if (workload != nullptr && check_map(*workload, "workload", generation_keys())) {
      take_generation(*workload, plan_.workload);
    }
  }

  void check() {
    check_name("name", plan_.name);
    std::vector<std::string_view> known = {kAnyMethod, kSimulationMethod};
    for (const analysis::Method &method : analysis::methods()) known.push_back(method.name);
    for (const std::string &name : plan_.methods) {
      if (std::find(known.begin(), known.end(), name) != known.end()) continue;
      mistake(
          "methods", fmt::format("unknown method '{}'", name),
          did_you_mean(name, known, "'redag analyze --methods' lists methods; 'any' and 'simulation' are also known"));
    }
    std::vector<Factor> factors = factors_of(plan_);
    factors.push_back({"methods", plan_.methods, false});
    for (const Factor &factor : factors) {
      if (factor.levels.empty()) mistake(factor.name, fmt::format("{} has no values", factor.name));
    }
    check_grid(factors, plan_.sets);
    factors.pop_back();
    if (diagnostics_.empty()) check_points(factors);
  }

  // Only the generator knows which workloads it can make.
  void check_points(const std::vector<Factor> &factors) {
    for (const Point &point : points_of(factors, [](std::size_t, const Point &) { return true; })) {
      const lab::GenerateOptions options = generate_options(plan_, point);
      const Diagnostics mistakes = lab::find_mistakes(options);
      if (!mistakes.empty()) {
        return mistake("workload", fmt::format("{}: {}", describe(factors, point), mistakes.front().message),
                       mistakes.front().hint);
      }
      if (std::uint64_t{options.dags} * options.max_tasks > kMostTasks) {
        return mistake("dags",
                       fmt::format("{}: a workload has more than {} tasks", describe(factors, point), kMostTasks));
      }
    }
  }

  AcceptancePlan plan_;
};

}  // namespace

AcceptancePlan::AcceptancePlan() {
  for (std::uint32_t u = 50'000; u <= kMillion; u += 50'000) utilization.push_back(u);
  workload.min_tasks = 1;
  workload.max_tasks = 1;
}

Result<AcceptancePlan> read_acceptance_plan(const yaml::Node &root, const std::string &file) {
  return AcceptanceReader(root, file).run();
}

}  // namespace redag::experiment
