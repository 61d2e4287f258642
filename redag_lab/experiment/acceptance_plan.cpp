// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/acceptance_plan.hpp"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "redag/base/nearest.hpp"
#include "redag_analysis/core/bound.hpp"
#include "redag_lab/experiment/acceptance.hpp"
#include "redag_lab/experiment/plan_yaml.hpp"

namespace redag::experiment {
namespace {

constexpr std::uint64_t kMostUnits = 100'000'000;
constexpr std::uint64_t kMostPoints = 100'000;
constexpr std::uint64_t kMostTasks = 100'000;  // of one workload

template <class Value>
bool has_twice(std::vector<Value> values) {
  std::sort(values.begin(), values.end());
  return std::adjacent_find(values.begin(), values.end()) != values.end();
}

std::vector<std::string_view> method_names() {
  std::vector<std::string_view> names = {kAnyMethod, kSimulationMethod};
  for (const analysis::Method &method : analysis::methods()) names.push_back(method.name);
  return names;
}

class Checker {
 public:
  explicit Checker(const AcceptancePlan &plan) : plan_(plan) {}

  std::vector<PlanMistake> run() {
    check_name();
    check_list("utilization", plan_.utilization);
    check_list("dags", plan_.dags);
    check_list("workers", plan_.workers);
    check_list("deadlines", plan_.deadlines);
    check_list("preemption", plan_.preemption);
    check_list("methods", plan_.methods);
    check_methods();
    if (plan_.sets == 0) say("sets", "sets must be at least 1");
    if (plan_.simulation.periods == 0) say("simulation", "simulation: periods must be at least 1");
    for (const PreemptionMode mode : plan_.preemption) {
      if (mode == PreemptionMode::None || mode == PreemptionMode::Os) continue;
      say("preemption", fmt::format("preemption '{}' has no meaning here", to_string(mode)),
          mode == PreemptionMode::Auto ? "choose none or os"
                                       : "generated tasks have no preemption points: choose none or os");
    }
    if (mistakes_.empty()) check_points();
    return std::move(mistakes_);
  }

 private:
  void say(std::string key, std::string message, std::string hint = {}) {
    mistakes_.push_back(PlanMistake{std::move(key), std::move(message), std::move(hint)});
  }

  void check_name() {
    if (!is_plan_name(plan_.name)) say("name", "a name consists of one or more letters, digits, - and _");
  }

  template <class Value>
  void check_list(const char *key, const std::vector<Value> &values) {
    if (values.empty()) say(key, fmt::format("{} has no values", key));
    if (has_twice(values)) say(key, fmt::format("{} lists a value twice", key));
  }

  void check_methods() {
    const std::vector<std::string_view> known = method_names();
    for (const std::string &name : plan_.methods) {
      if (std::find(known.begin(), known.end(), name) != known.end()) continue;
      const std::string_view near = nearest(name, known);
      say("methods", fmt::format("unknown method '{}'", name),
          near.empty() ? "'redag analyze --methods' lists methods; 'any' and 'simulation' are also known"
                       : fmt::format("did you mean '{}'?", near));
    }
  }

  // Counts the points without creating them, up to kMostPoints + 1.
  [[nodiscard]] std::uint64_t count_points() const {
    std::uint64_t points = 1;
    for (const std::size_t choices : {plan_.dags.size(), plan_.workers.size(), plan_.deadlines.size(),
                                      plan_.preemption.size(), plan_.utilization.size()}) {
      if (choices > kMostPoints / points) return kMostPoints + 1;
      points *= choices;
    }
    return points;
  }

  // Only the generator knows which workloads it can make. It checks its options at every point, and draws trial
  // workloads as long as they take little time.
  void check_points() {
    const std::uint64_t count = count_points();
    if (count > kMostPoints) {
      say("experiment", fmt::format("the plan has more than {} points", kMostPoints),
          "every combination of the plan's lists is a point: shorten the lists, or split the plan");
      return;
    }
    if (count > kMostUnits / plan_.sets) {
      say("sets", fmt::format("{} points with {} sets each are more than {} workloads", count, plan_.sets, kMostUnits));
      return;
    }
    std::uint64_t to_draw = 100'000;  // tasks, about a third of a second of drawing
    for (const AcceptancePoint &point : points_of(plan_)) {
      const lab::GenerateOptions options = generate_options(plan_, point);
      Diagnostics mistakes = lab::find_mistakes(options);
      const std::uint64_t tasks = std::uint64_t{options.dags} * options.max_tasks;
      if (mistakes.empty() && tasks > kMostTasks) {
        say("dags", fmt::format("{}: workloads have up to {} tasks; at most {} are allowed", describe(point), tasks,
                                kMostTasks));
        return;
      }
      if (mistakes.empty() && tasks <= to_draw) {
        to_draw -= tasks;
        const Result<Workload> workload = draw_workload(plan_, point, 0);
        if (!workload) mistakes = workload.error();
      }
      if (mistakes.empty()) continue;
      say("workload", fmt::format("{}: {}", describe(point), mistakes.front().message), mistakes.front().hint);
      return;
    }
  }

  const AcceptancePlan &plan_;
  std::vector<PlanMistake> mistakes_;
};

}  // namespace

AcceptancePlan::AcceptancePlan() {
  for (std::uint32_t u = 50'000; u <= kMillion; u += 50'000) utilization.push_back(u);
  workload.min_tasks = 1;
  workload.max_tasks = 1;
}

std::vector<AcceptancePoint> points_of(const AcceptancePlan &plan) {
  std::vector<AcceptancePoint> points;
  for (const std::uint32_t dags : plan.dags) {
    for (const std::uint32_t workers : plan.workers) {
      for (const DeadlineKind deadlines : plan.deadlines) {
        for (const PreemptionMode preemption : plan.preemption) {
          for (const std::uint32_t utilization : plan.utilization) {
            points.push_back(AcceptancePoint{dags, workers, deadlines, preemption, utilization});
          }
        }
      }
    }
  }
  return points;
}

std::vector<PlanMistake> find_mistakes(const AcceptancePlan &plan) { return Checker(plan).run(); }

Result<std::vector<std::uint32_t>> parse_utilization(std::string_view text) { return parse_range(text); }

const char *to_string(DeadlineKind value) { return value == DeadlineKind::Implicit ? "implicit" : "constrained"; }

}  // namespace redag::experiment
