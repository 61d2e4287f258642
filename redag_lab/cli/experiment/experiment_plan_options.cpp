// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/experiment/experiment_plan_options.hpp"

#include <charconv>
#include <utility>

#include <fmt/format.h>

#include "redag/model/validate.hpp"
#include "redag_lab/cli/terminal/options.hpp"

namespace redag::cli {
namespace {

using experiment::AcceptancePlan;
using experiment::DeadlineKind;

constexpr std::uint32_t kMaxSets = 1'000'000;  // random workloads at a point, runs of one workload, or periods of a run

std::vector<std::string> split(const std::string &text) {
  std::vector<std::string> items(1);
  for (const char c : text) {
    if (c == ',') {
      items.emplace_back();
    } else {
      items.back() += c;
    }
  }
  return items;
}

template <class Value>
Value choice_of(const std::string &name, const std::string &text, const Choices<Value> &choices) {
  std::vector<std::string> names;
  for (const auto &[known, value] : choices) {
    if (known == text) return value;
    names.push_back(known);
  }
  reject(name, in_quotes(text) + " is not a valid choice", suggestion(text, names));
}

auto count_within(Range<std::uint32_t> range) {
  return [range](const std::string &name, const std::string &item) { return parse_count(name, item, range); };
}

// Adds an option with a list "a,b,c", whose items `read(name, item)` parses.
template <class Value, class Read>
CLI::Option *add_list(CLI::App &app, const std::string &name, std::vector<Value> &target, const std::string &help,
                      const std::string &shown, Read read) {
  const auto set = [&target, name, read](const std::string &text) {
    target.clear();
    for (const std::string &item : split(text)) target.push_back(read(name, item));
  };
  return app.add_option_function<std::string>(name, set, help)->type_name("LIST")->default_str(shown);
}

}  // namespace

PlanOptions::PlanOptions(CLI::App &app) {
  app.add_option("PLAN", file_, "Plan (YAML, see docs/experiments.md); options override it")->type_name("PLAN");
  add_points(app);
  add_workloads(app);
}

void PlanOptions::on(CLI::Option *option, const std::string &group, Edit edit) {
  option->group(group);
  edits_.emplace_back(option, std::move(edit));
}

void PlanOptions::add_points(CLI::App &app) {
  const std::string group = "Points";
  on(app.add_option("--name", given_.name, "Name of the experiment")->type_name("NAME")->capture_default_str(), group,
     [this](AcceptancePlan &plan) { plan.name = given_.name; });
  on(add_seed(app, given_.seed, "Seed of all random draws"), group,
     [this](AcceptancePlan &plan) { plan.seed = given_.seed; });
  on(add_count(app, "--sets", given_.sets, {1, kMaxSets}, "Random workloads for each point"), group,
     [this](AcceptancePlan &plan) { plan.sets = given_.sets; });
  const auto set_utilization = [this](const std::string &text) {
    Result<std::vector<std::uint32_t>> values = experiment::parse_utilization(text);
    if (!values) reject("--utilization", values.error().front().message, values.error().front().hint);
    given_.utilization = std::move(*values);
  };
  on(app.add_option_function<std::string>("--utilization", set_utilization,
                                          "Utilization per worker: FROM:TO:STEP, or values separated by commas")
         ->type_name("RANGE")
         ->default_str("0.05:1:0.05"),
     group, [this](AcceptancePlan &plan) { plan.utilization = given_.utilization; });
  on(add_list(app, "--dags", given_.dags, "Numbers of DAGs; by default each DAG has one task", "10",
              count_within({1, lab::kMaxTasks})),
     group, [this](AcceptancePlan &plan) { plan.dags = given_.dags; });
  on(add_list(app, "--workers", given_.workers, "Numbers of workers", "4", count_within({1, kMaxWorkers})), group,
     [this](AcceptancePlan &plan) { plan.workers = given_.workers; });
  on(add_list(app, "--deadlines", given_.deadlines, "implicit (D = T) or constrained (D / T from 0.5 to 1)", "implicit",
              [](const std::string &name, const std::string &item) {
                return choice_of(name, item, choices_of(std::array{DeadlineKind::Implicit, DeadlineKind::Constrained}));
              }),
     group, [this](AcceptancePlan &plan) { plan.deadlines = given_.deadlines; });
  on(add_list(
         app, "--preemption", given_.preemption, "none, or os (full preemption)", "none,os",
         [](const std::string &name, const std::string &item) { return choice_of(name, item, preemption_choices()); }),
     group, [this](AcceptancePlan &plan) { plan.preemption = given_.preemption; });
  on(add_list(app, "--methods", given_.methods,
              "Methods ('redag analyze --methods' lists them); any: all sound ones together; simulation: no miss in "
              "simulation",
              "any,simulation", [](const std::string & /*name*/, const std::string &item) { return item; }),
     group, [this](AcceptancePlan &plan) { plan.methods = given_.methods; });
  on(add_count(app, "--simulation-offsets", given_.simulation.offsets, {0, kMaxSets},
               "Simulations with random offsets, in addition to the synchronous one"),
     group, [this](AcceptancePlan &plan) { plan.simulation.offsets = given_.simulation.offsets; });
  on(add_count(app, "--simulation-periods", given_.simulation.periods, {1, kMaxSets},
               "Length of a simulation, in periods of the slowest task"),
     group, [this](AcceptancePlan &plan) { plan.simulation.periods = given_.simulation.periods; });
}

void PlanOptions::add_workloads(CLI::App &app) {
  const std::string group = "Workloads";
  lab::GenerateOptions &w = given_.workload;
  on(add_count(app, "--min-tasks", w.min_tasks, {1, lab::kMaxTasks}, "Fewest tasks of a DAG"), group,
     [&w](AcceptancePlan &plan) { plan.workload.min_tasks = w.min_tasks; });
  on(add_count(app, "--max-tasks", w.max_tasks, {1, lab::kMaxTasks}, "Most tasks of a DAG"), group,
     [&w](AcceptancePlan &plan) { plan.workload.max_tasks = w.max_tasks; });
  on(add_choice(app, "--shape", w.shape, choices_of(lab::kDagShapes), "Structure of the edges")
         ->default_str(to_string(w.shape)),
     group, [&w](AcceptancePlan &plan) { plan.workload.shape = w.shape; });
  on(add_number(app, "--edge-probability", w.edge_probability, {0, 1},
                "Probability of each further edge (layered, erdos_renyi)"),
     group, [&w](AcceptancePlan &plan) { plan.workload.edge_probability = w.edge_probability; });
  on(add_choice(app, "--policy", w.policy, policy_choices(), "Scheduling policy")->default_str(to_string(w.policy)),
     group, [&w](AcceptancePlan &plan) { plan.workload.policy = w.policy; });
  on(add_count(app, "--max-active", w.max_active_max, {0, kMaxBound}, "max_active of every DAG; 0: no bound"), group,
     [&w](AcceptancePlan &plan) {
       plan.workload.max_active_min = w.max_active_max;
       plan.workload.max_active_max = w.max_active_max;
     });
  on(add_choice(app, "--periods", w.periods, choices_of(lab::kPeriodModels), "Distribution of periods")
         ->default_str(to_string(w.periods)),
     group, [&w](AcceptancePlan &plan) { plan.workload.periods = w.periods; });
  on(add_duration(app, "--period-min", w.period_min, "Shortest period (log_uniform, harmonic)"), group,
     [&w](AcceptancePlan &plan) { plan.workload.period_min = w.period_min; });
  on(add_duration(app, "--period-max", w.period_max, "Longest period (log_uniform, harmonic)"), group,
     [&w](AcceptancePlan &plan) { plan.workload.period_max = w.period_max; });
  on(add_duration(app, "--period-granularity", w.period_granularity,
                  "Unit of which periods are multiples (log_uniform)"),
     group, [&w](AcceptancePlan &plan) { plan.workload.period_granularity = w.period_granularity; });
  on(add_number(app, "--jitter", w.jitter, {0, 1}, "Release jitter / period of timer tasks"), group,
     [&w](AcceptancePlan &plan) { plan.workload.jitter = w.jitter; });
  on(add_number(app, "--max-task-utilization", w.max_task_utilization, {1e-9, 1}, "Largest utilization of one task"),
     group, [&w](AcceptancePlan &plan) { plan.workload.max_task_utilization = w.max_task_utilization; });
  on(add_choice(app, "--utilization-method", w.method, choices_of(lab::kUtilizationMethods),
                "How the utilization is divided among tasks")
         ->default_str(to_string(w.method)),
     group, [&w](AcceptancePlan &plan) { plan.workload.method = w.method; });
}

std::optional<AcceptancePlan> PlanOptions::plan(Console &console) const {
  AcceptancePlan plan;
  if (!file_.empty()) {
    Result<AcceptancePlan> loaded = experiment::load_acceptance_plan(file_);
    if (!loaded) {
      console.note(loaded.error());
      return std::nullopt;
    }
    plan = std::move(*loaded);
  }
  for (const auto &[option, edit] : edits_) {
    if (option->count() > 0) edit(plan);
  }
  const std::vector<experiment::PlanMistake> mistakes = experiment::find_mistakes(plan);
  for (const experiment::PlanMistake &mistake : mistakes) console.error(mistake.message, mistake.hint);
  if (!mistakes.empty()) return std::nullopt;
  return plan;
}

}  // namespace redag::cli
