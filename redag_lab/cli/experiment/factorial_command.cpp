// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <utility>

#include "redag/base/check.hpp"
#include "redag_lab/cli/experiment/experiment_run.hpp"
#include "redag_lab/cli/experiment/experiment_studies.hpp"
#include "redag_lab/cli/experiment/factorial_report.hpp"
#include "redag_lab/cli/terminal/signals.hpp"
#include "redag_lab/experiment/factorial_results.hpp"
#include "redag_lab/run/ros2_run.hpp"
#include "redag_lab/run/session.hpp"
#include "redag_lab/run/variant.hpp"

namespace redag::cli {
namespace {

using experiment::FactorialPlan;
using experiment::FinishedRun;
using experiment::PlannedRun;
using experiment::World;

/// Executes a run in any world; `program` is the one for ROS 2.
Result<FinishedRun> drive(const PlannedRun &planned, const std::string &program) {
  if (planned.world == World::Ros2) return lab::run_in_ros2(planned, program, InterruptGuard::flag());
  const Result<lab::Variant> variant = lab::parse_variant(planned.executor);
  REDAG_CHECK(variant.has_value(), "the plan was checked");
  lab::SessionOptions options;
  options.driver = planned.world == World::Simulator ? trace::Driver::Simulator : trace::Driver::Threads;
  options.duration = planned.duration;
  options.warm_up = planned.warm_up;
  options.seed = planned.seed;
  options.overheads = planned.overheads;
  options.stop = &InterruptGuard::flag();
  Result<lab::Session> session = lab::run_session(planned.workload, *variant, options);
  if (!session) return tl::unexpected<Diagnostics>(std::move(session.error()));
  if (session->stopped) return make_error("interrupted");
  if (session->cut_at) {
    return make_error(fmt::format("a run has more than {} events, which cannot be checked", options.max_events),
                      "make 'duration' shorter");
  }
  return FinishedRun{std::move(session->trace), std::move(session->summary), std::move(session->check)};
}

class FactorialStudy final : public Study {
 public:
  explicit FactorialStudy(FactorialPlan plan, const std::string &ros2_program = {})
      : factorial_(std::move(plan), [ros2_program](const PlannedRun &run) { return drive(run, ros2_program); }),
        counter_(factorial_) {}

  [[nodiscard]] const char *command() const override { return "factorial"; }
  [[nodiscard]] const char *units_are() const override { return "runs"; }
  [[nodiscard]] std::string plan() const override { return to_yaml(factorial_.plan()); }
  [[nodiscard]] std::uint64_t unit_count() const override { return factorial_.unit_count(); }
  [[nodiscard]] bool takes_turns() const override { return needs_machine(factorial_.plan()); }

  /// Rotates the executors of a real machine: no executor always runs first, when the machine is coldest or quietest.
  void arrange(std::vector<std::uint64_t> &units) const override {
    if (!takes_turns()) return;
    const std::uint64_t points = factorial_.points().size();
    const auto turn = [&](std::uint64_t unit) {
      const std::uint64_t repetition = factorial_.repetition_of(unit);
      return repetition * points + (factorial_.point_of(unit) + points - repetition % points) % points;
    };
    std::sort(units.begin(), units.end(), [&](std::uint64_t a, std::uint64_t b) { return turn(a) < turn(b); });
  }

  [[nodiscard]] Result<std::string> evaluate(std::uint64_t unit) const override { return factorial_.evaluate(unit); }
  [[nodiscard]] Result<void> add(std::uint64_t unit, const std::string &result) override {
    return counter_.add(unit, result);
  }
  [[nodiscard]] std::uint64_t done() const override { return counter_.results().done; }
  [[nodiscard]] Result<void> write(const std::string &folder) const override {
    return write_results(folder, factorial_, counter_.results());
  }
  [[nodiscard]] std::string json(const std::vector<std::string> &runs) const override {
    return to_json(factorial_, counter_.results(), runs);
  }
  [[nodiscard]] std::string describe(const StreamTraits &traits) const override {
    return cli::describe(factorial_, counter_.results(), traits);
  }
  [[nodiscard]] std::string files(const std::string &folder) const override {
    return fmt::format(
        "  {0}/factorial.svg   the plot: effects of each factor\n"
        "  {0}/factorial.csv, factorial.json\n"
        "      medians with confidence intervals, by combination and DAG\n"
        "  {0}/observations.csv   every run\n",
        folder);
  }

  [[nodiscard]] int judge(const std::string & /*folder*/, Console &console) const override {
    const experiment::FactorialResults &results = counter_.results();
    if (results.violations > 0) {
      console.error(fmt::format("the trace checker found {} violations of the model", results.violations),
                    "observations.csv shows in which runs");
    }
    return results.violations > 0 || results.unenforced > 0 ? kExitNo : kExitOk;
  }

 private:
  experiment::Factorial factorial_;
  experiment::FactorialCounter counter_;
};

}  // namespace

Action add_factorial(CLI::App &app) {
  const auto file = std::make_shared<std::string>();
  const auto settings = std::make_shared<StudySettings>();
  app.add_option("PLAN", *file, "Plan (YAML, see docs/experiments.md)")->type_name("PLAN")->required();
  const auto program = std::make_shared<std::string>();
  app.add_option("--run-workload", *program,
                 "Program run_workload of redag_rclcpp_lab, for 'world: ros2' (default: 'ros2 run redag_rclcpp_lab "
                 "run_workload')")
      ->type_name("PROGRAM");
  add_study_settings(app, *settings);
  app.footer(
      "Examples:\n"
      "  redag experiment factorial experiments/paper/factorial.yaml --out results\n"
      "  redag experiment factorial experiments/paper/utilization.yaml --shard 1/2\n");
  return [file, program, settings](Console &console) {
    Result<FactorialPlan> plan = experiment::load_factorial_plan(*file, executors_of);
    if (!plan) {
      console.note(plan.error());
      return kExitBad;
    }
    if (needs_machine(*plan)) {
      if (settings->shard.count > 1) {
        console.error("--shard: runs on threads or under ROS 2 depend on one machine",
                      "give each machine a plan and a folder of its own");
        return kExitBad;
      }
      if (const auto busy = lab::busy_machine_warning()) console.warn(*busy);
    }
    FactorialStudy study(std::move(*plan), *program);
    return run_study(study, *settings, console);
  };
}

std::vector<std::string> executors_of(World world) {
  return world == World::Ros2 ? lab::ros2_executors() : lab::variant_names();
}

std::unique_ptr<Study> make_factorial(const std::string &plan, const std::string &file, Console &console) {
  Result<FactorialPlan> read = experiment::parse_factorial_plan(plan, file, executors_of);
  if (read) return std::make_unique<FactorialStudy>(std::move(*read));
  console.note(read.error());
  return nullptr;
}

}  // namespace redag::cli
