// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/factorial_plan.hpp"

#include <algorithm>
#include <array>
#include <set>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "redag/base/nearest.hpp"
#include "redag_analysis/executors/executors.hpp"
#include "redag_lab/experiment/plan_yaml.hpp"

namespace redag::experiment {
namespace {

constexpr std::uint64_t kMostFactorialUnits = 10'000'000;
constexpr std::uint64_t kMostCombinations = 1'000'000;

template <class Values, class Text>
std::vector<std::string> texts(const Values &values, Text text) {
  std::vector<std::string> result;
  result.reserve(values.size());
  for (const auto &value : values) result.emplace_back(text(value));
  return result;
}

std::string bounds_text(const std::vector<std::uint32_t> &bounds) {
  if (std::all_of(bounds.begin(), bounds.end(), [](std::uint32_t bound) { return bound == 0; })) return "unbounded";
  std::string text;
  for (const std::uint32_t bound : bounds) {
    text += (text.empty() ? "" : "+") + (bound == 0 ? std::string("inf") : std::to_string(bound));
  }
  return text;
}

constexpr std::array kWorlds = {World::Simulator, World::Threads, World::Ros2};

// Returns the family of an executor: "redag" for "ros2/redag-none".
std::string_view family_of(std::string_view executor) {
  executor.remove_prefix(executor.find('/') + 1);  // npos + 1 is 0
  return executor.substr(0, executor.find('-'));
}

bool is_redag(std::string_view executor) { return family_of(executor) == "redag"; }

// True if this factor affects this executor.
bool applies(const FactorialPlan &plan, FactorKind kind, std::string_view executor) {
  const std::string_view family = family_of(executor);
  const executors::ExecutorKind *kind_of = executors::find_executor(family);
  const bool has_workers = family != kUnlimited && (kind_of == nullptr || !kind_of->single_worker);
  switch (kind) {
    case FactorKind::Policy:
    case FactorKind::MaxActive: return is_redag(executor);
    // With utilization per worker, the demand depends on the number of workers for every executor.
    case FactorKind::Workers: return has_workers || !plan.utilization.empty();
    default: return true;
  }
}

class FactorialChecker {
 public:
  FactorialChecker(const FactorialPlan &plan, const ExecutorNames &executors) : plan_(plan), executors_(executors) {}

  std::vector<PlanMistake> run() {
    if (!is_plan_name(plan_.name)) say("name", "a name consists of one or more letters, digits, - and _");
    if (plan_.repetitions == 0) say("repetitions", "repetitions must be at least 1");
    if (plan_.warm_up >= plan_.duration) say("warm_up", "the warm-up takes the whole duration");
    if (plan_.workloads.empty()) say("workloads", "no workload is given", "name files, as in workloads: [cart.yaml]");
    if (plan_.executors.empty())
      say("executors", "no executor is given", "name executors, as in executors: [ideal, redag, mte]");
    check_executors();
    for (const Factor &factor : factors_of(plan_)) {
      const std::set<std::string> distinct(factor.levels.begin(), factor.levels.end());
      if (distinct.size() == factor.levels.size()) continue;
      say(key_of(factor.kind), fmt::format("{} lists a value twice", key_of(factor.kind)));
    }
    check_workloads();
    if (mistakes_.empty() && has_too_many_combinations()) {
      say("executors", fmt::format("the plan has more than {} combinations", kMostCombinations),
          "shorten the plan's lists, or split the plan");
    }
    if (mistakes_.empty() && points_of(plan_).size() > kMostFactorialUnits / plan_.repetitions) {
      say("repetitions", fmt::format("{} combinations with {} repetitions are more than {} runs",
                                     points_of(plan_).size(), plan_.repetitions, kMostFactorialUnits));
    }
    return std::move(mistakes_);
  }

 private:
  // Counts combinations before creating them: the lists of a small file can have more combinations than fit in memory.
  [[nodiscard]] bool has_too_many_combinations() const {
    std::uint64_t combinations = 1;
    for (const Factor &factor : factors_of(plan_)) {
      const std::uint64_t levels = std::max<std::size_t>(1, factor.levels.size());
      if (levels > kMostCombinations / combinations) return true;
      combinations *= levels;
    }
    return false;
  }

  void say(std::string key, std::string message, std::string hint = {}) {
    mistakes_.push_back(PlanMistake{std::move(key), std::move(message), std::move(hint)});
  }

  static std::string key_of(FactorKind kind) {
    switch (kind) {
      case FactorKind::Workload: return "workloads";
      case FactorKind::Policy: return "policies";
      case FactorKind::Executor: return "executors";
      default: return to_string(kind);
    }
  }

  void check_executors() {
    for (const std::string &written : plan_.executors) check_executor(written);
    const bool any_bounded = std::any_of(plan_.executors.begin(), plan_.executors.end(),
                                         [](const std::string &name) { return is_redag(name); });
    for (const auto &[key, given] : {std::pair<const char *, bool>{"policies", !plan_.policies.empty()},
                                     {"max_active", !plan_.max_active.empty()}}) {
      if (given && !any_bounded) say(key, fmt::format("{} have no meaning for the executors of this plan", key));
    }
  }

  void check_executor(const std::string &written) {
    const auto [world, name] = place_of(plan_, written);
    const std::vector<std::string> of_world = executors_(world);
    std::vector<std::string_view> known(of_world.begin(), of_world.end());
    if (name == written) known.insert(known.begin(), {kIdeal, kUnlimited});
    if (std::find(known.begin(), known.end(), name) == known.end()) {
      const std::string_view near = nearest(name, known);
      say("executors", fmt::format("there is no executor '{}'", written),
          near.empty() ? fmt::format("known: {}", fmt::join(known, ", ")) : fmt::format("did you mean '{}'?", near));
    } else if (world == World::Simulator && name.ends_with("-fifo")) {
      say("executors", fmt::format("the simulator has no threads to make real-time: '{}' is the same as '{}' there",
                                   name, name.substr(0, name.find('-'))));
    }
  }

  void check_workloads() {
    for (const WorkloadSource &source : plan_.workloads) {
      if (!is_plan_name(source.name)) {
        say("workloads", fmt::format("'{}': the name of a workload consists of letters, digits, - and _", source.name));
      }
      if (source.random && plan_.utilization.empty()) {
        say("workloads", fmt::format("'{}': random workloads need a utilization", source.name));
      }
      const std::size_t dags = source.random ? source.random->dags : source.workload.dags.size();
      for (const std::vector<std::uint32_t> &bounds : plan_.max_active) {
        if (bounds.size() <= 1 || bounds.size() == dags) continue;
        say("max_active", fmt::format("{} bounds are given, but '{}' has {} DAGs", bounds.size(), source.name, dags));
        break;
      }
    }
  }

  const FactorialPlan &plan_;
  const ExecutorNames &executors_;
  std::vector<PlanMistake> mistakes_;
};

}  // namespace

const char *to_string(World world) {
  switch (world) {
    case World::Simulator: return "simulator";
    case World::Threads: return "threads";
    case World::Ros2: return "ros2";
  }
  return "?";
}

ExecutorPlace place_of(const FactorialPlan &plan, const std::string &executor) {
  const std::size_t slash = executor.find('/');
  for (const World world : kWorlds) {
    if (slash != std::string::npos && executor.substr(0, slash) == to_string(world)) {
      return {world, executor.substr(slash + 1)};
    }
  }
  return {plan.world, executor};
}

bool needs_machine(const FactorialPlan &plan) {
  return std::any_of(plan.executors.begin(), plan.executors.end(), [&](const std::string &executor) {
    const auto [world, name] = place_of(plan, executor);
    return world != World::Simulator && name != kIdeal && name != kUnlimited;
  });
}

const char *to_string(FactorKind kind) {
  switch (kind) {
    case FactorKind::Workload: return "workload";
    case FactorKind::Policy: return "policy";
    case FactorKind::Workers: return "workers";
    case FactorKind::Utilization: return "utilization";
    case FactorKind::DemandScale: return "demand_scale";
    case FactorKind::DeadlineScale: return "deadline_scale";
    case FactorKind::MaxActive: return "max_active";
    case FactorKind::Executor: return "executor";
  }
  return "?";
}

std::vector<Factor> factors_of(const FactorialPlan &plan) {
  const auto share = [](std::uint32_t value) { return fmt::format("{}", value / static_cast<double>(kMillion)); };
  const auto number = [](std::uint32_t value) { return std::to_string(value); };
  return {
      {FactorKind::Workload, texts(plan.workloads, [](const WorkloadSource &source) { return source.name; }), false},
      {FactorKind::Policy, texts(plan.policies, [](PolicyKind policy) { return to_string(policy); }), false},
      {FactorKind::Workers, texts(plan.workers, number), true},
      {FactorKind::Utilization, texts(plan.utilization, share), true},
      {FactorKind::DemandScale, texts(plan.demand_scale, share), true},
      {FactorKind::DeadlineScale, texts(plan.deadline_scale, share), true},
      {FactorKind::MaxActive, texts(plan.max_active, bounds_text), false},
      {FactorKind::Executor, plan.executors, false},
  };
}

std::vector<FactorialPoint> points_of(const FactorialPlan &plan) {
  const std::vector<Factor> factors = factors_of(plan);
  std::vector<FactorialPoint> points;
  FactorialPoint point{std::vector<std::uint32_t>(kFactorCount, kNoLevel)};
  for (std::size_t f = 0; f < kFactorCount; ++f) {
    if (!factors[f].levels.empty()) point.level[f] = 0;
  }
  while (true) {
    // Combinations that differ only in factors without effect on the executor are equal; the first one represents them.
    FactorialPoint clean = point;
    bool is_first = true;
    for (std::size_t f = 0; f < kFactorCount; ++f) {
      if (clean.level[f] == kNoLevel || applies(plan, factors[f].kind, plan.executors[point.level.back()])) continue;
      is_first = is_first && clean.level[f] == 0;
      clean.level[f] = kNoLevel;
    }
    if (is_first) points.push_back(std::move(clean));
    std::size_t f = kFactorCount;  // advances to the next combination; the last factor changes fastest
    while (f > 0) {
      --f;
      if (point.level[f] == kNoLevel) continue;
      if (++point.level[f] < factors[f].levels.size()) break;
      point.level[f] = 0;
      if (f == 0) return points;
    }
  }
}

std::string describe(const FactorialPlan &plan, const FactorialPoint &point) {
  const std::vector<Factor> factors = factors_of(plan);
  std::string text;
  for (const Factor &factor : factors) {
    const std::uint32_t level = point.of(factor.kind);
    if (level == kNoLevel) continue;
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", to_string(factor.kind), factor.levels[level]);
  }
  return text;
}

std::vector<PlanMistake> find_mistakes(const FactorialPlan &plan, const ExecutorNames &executors) {
  return FactorialChecker(plan, executors).run();
}

}  // namespace redag::experiment
