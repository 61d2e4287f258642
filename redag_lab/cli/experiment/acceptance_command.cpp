// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <memory>
#include <optional>
#include <utility>

#include "redag_lab/cli/experiment/experiment_plan_options.hpp"
#include "redag_lab/cli/experiment/experiment_report.hpp"
#include "redag_lab/cli/experiment/experiment_run.hpp"
#include "redag_lab/cli/experiment/experiment_studies.hpp"
#include "redag_lab/experiment/acceptance_results.hpp"

namespace redag::cli {
namespace {

using experiment::AcceptancePlan;

class AcceptanceStudy final : public Study {
 public:
  explicit AcceptanceStudy(AcceptancePlan plan) : acceptance_(std::move(plan)), counter_(acceptance_) {}

  [[nodiscard]] const char *command() const override { return "acceptance"; }
  [[nodiscard]] const char *units_are() const override { return "workloads"; }
  [[nodiscard]] std::string plan() const override { return to_yaml(acceptance_.plan()); }
  [[nodiscard]] std::uint64_t unit_count() const override { return counter_.results().units; }
  [[nodiscard]] Result<std::string> evaluate(std::uint64_t unit) const override { return acceptance_.evaluate(unit); }
  [[nodiscard]] Result<void> add(std::uint64_t unit, const std::string &result) override {
    return counter_.add(unit, result);
  }
  [[nodiscard]] std::uint64_t done() const override { return counter_.results().done; }
  [[nodiscard]] Result<void> write(const std::string &folder) const override {
    return write_results(folder, acceptance_, counter_.results());
  }
  [[nodiscard]] std::string json(const std::vector<std::string> &runs) const override {
    return to_json(acceptance_, counter_.results(), runs);
  }
  [[nodiscard]] std::string describe(const StreamTraits &traits) const override {
    return cli::describe(acceptance_, counter_.results(), traits);
  }
  [[nodiscard]] std::string files(const std::string &folder) const override {
    return fmt::format(
        "  {0}/acceptance.svg   the plot\n"
        "  {0}/acceptance.csv, acceptance.json\n"
        "      the figures, with confidence intervals\n",
        folder);
  }

  [[nodiscard]] int judge(const std::string &folder, Console &console) const override {
    const std::vector<experiment::Violation> &violations = counter_.results().violations;
    for (const experiment::Violation &violation : violations) {
      const std::string place = folder.empty() ? std::string("run it again with --out DIR to get a file to replay")
                                               : fmt::format("replay: {}/violation-{}.yaml", folder, violation.unit);
      console.error(
          fmt::format("unit {} ({}) misses a deadline in simulation, although it is accepted by {}", violation.unit,
                      experiment::describe(acceptance_.point_of(violation.unit)), fmt::join(violation.methods, ", ")),
          place);
    }
    return violations.empty() ? kExitOk : kExitNo;
  }

 private:
  experiment::Acceptance acceptance_;
  experiment::AcceptanceCounter counter_;
};

}  // namespace

Action add_acceptance(CLI::App &app) {
  const auto plan = std::make_shared<PlanOptions>(app);
  const auto settings = std::make_shared<StudySettings>();
  add_study_settings(app, *settings);
  app.footer(
      "Examples:\n"
      "  redag experiment acceptance --dags 10 --workers 4 --methods guan,any\n"
      "  redag experiment acceptance experiments/acceptance_tasks.yaml --out results\n"
      "  redag experiment acceptance experiments/acceptance_dags.yaml --shard 1/3\n");
  return [plan, settings](Console &console) {
    std::optional<AcceptancePlan> read = plan->plan(console);
    if (!read) return kExitBad;
    AcceptanceStudy study(std::move(*read));
    return run_study(study, *settings, console);
  };
}

std::unique_ptr<Study> make_acceptance(const std::string &plan, const std::string &file, Console &console) {
  Result<AcceptancePlan> read = experiment::parse_acceptance_plan(plan, file);
  if (read) return std::make_unique<AcceptanceStudy>(std::move(*read));
  console.note(read.error());
  return nullptr;
}

}  // namespace redag::cli
