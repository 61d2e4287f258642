// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Reads the text form of a plan, which docs/experiments.md describes, and makes its factors.
#include <algorithm>
#include <array>
#include <filesystem>
#include <iterator>

#include <fmt/format.h>

#include "redag/derived/clusters.hpp"
#include "redag/loader/validate.hpp"
#include "redag/loader/workload_yaml.hpp"
#include "redag_analysis/executors/executors.hpp"
#include "redag_lab/experiment/factorial.hpp"
#include "redag_lab/experiment/plan_reader.hpp"

namespace redag::experiment {
namespace {

using yaml::find;

constexpr std::array kWorlds = {World::Simulator, World::Threads, World::Ros2};
// The keys of the factors, by FactorPlace.
constexpr std::array kFactorKeys = {"workloads",    "policies",       "workers",    "utilization",
                                    "demand_scale", "deadline_scale", "max_active", "executors"};

std::string bounds_text(const std::vector<std::uint32_t> &bounds) {
  if (std::all_of(bounds.begin(), bounds.end(), [](std::uint32_t bound) { return bound == 0; })) return "unbounded";
  std::string text;
  for (const std::uint32_t bound : bounds) {
    text += (text.empty() ? "" : "+") + (bound == 0 ? std::string("inf") : std::to_string(bound));
  }
  return text;
}

// Returns the family of an executor: "redag" for "ros2/redag-none".
std::string_view family_of(std::string_view executor) {
  executor.remove_prefix(executor.find('/') + 1);  // npos + 1 is 0
  return executor.substr(0, executor.find('-'));
}

bool is_redag(std::string_view executor) { return family_of(executor) == "redag"; }

// True if this factor affects this executor.
bool applies(const FactorialPlan &plan, std::size_t factor, std::string_view executor) {
  if (factor == kPolicy || factor == kMaxActive) return is_redag(executor);
  if (factor != kWorkers) return true;
  const std::string_view family = family_of(executor);
  const executors::ExecutorKind *kind = executors::find_executor(family);
  const bool has_workers = family != kUnlimited && (kind == nullptr || !kind->single_worker);
  // With utilization per worker, the demand depends on the number of workers for every executor.
  return has_workers || !plan.utilization.empty();
}

class FactorialReader : private PlanReader {
 public:
  FactorialReader(const Node &root, std::string file, const ExecutorNames &executors)
      : PlanReader(root, std::move(file)), executors_(executors) {}

  Result<FactorialPlan> run() {
    std::vector<std::string_view> keys = {"experiment",  "name",     "world",   "seed",
                                          "repetitions", "duration", "warm_up", "overheads"};
    keys.insert(keys.end(), kFactorKeys.begin(), kFactorKeys.end());
    if (check_map(root_, "a plan", keys)) {
      read();
      if (diagnostics_.empty()) check();
    }
    if (Diagnostics found = take_diagnostics(); !found.empty()) return tl::unexpected<Diagnostics>(std::move(found));
    return std::move(plan_);
  }

 private:
  void read() {
    take(root_, "name", plan_.name);
    take(root_, "world", plan_.world, kWorlds);
    take(root_, "seed", plan_.seed);
    take(root_, "repetitions", plan_.repetitions);
    take(root_, "duration", plan_.duration);
    take(root_, "warm_up", plan_.warm_up);
    read_overheads();
    read_workloads();
    take_list("policies", plan_.policies,
              [this](const Node &node, std::string_view key) { return one_of<PolicyKind>(node, key); });
    take_list("workers", plan_.workers);
    take_range("utilization", plan_.utilization);
    take_range("demand_scale", plan_.demand_scale);
    take_range("deadline_scale", plan_.deadline_scale);
    read_max_active();
    take_list("executors", plan_.executors);
  }

  void read_overheads() {
    const Node *node = find(root_, "overheads");
    if (node == nullptr || !check_map(*node, "overheads", {"release", "dispatch", "preempt"})) return;
    take(*node, "release", plan_.overheads.release);
    take(*node, "dispatch", plan_.overheads.dispatch);
    take(*node, "preempt", plan_.overheads.preempt);
  }

  void read_workloads() {
    take_list("workloads", plan_.workloads,
              [this](const Node &node, std::string_view /*key*/) -> std::optional<WorkloadSource> {
                if (node.kind == Node::Kind::Scalar) return load(node, {});
                if (!check_map(node, "a workload", {"name", "file", "random"})) return std::nullopt;
                std::string name;
                take(node, "name", name);
                if (const Node *file = find(node, "file")) return load(*file, std::move(name));
                if (const Node *random = find(node, "random")) return read_random(*random, std::move(name));
                return error(node, "a workload is a file, or random",
                             "write, for example, {name: cart, file: cart.yaml}");
              });
  }

  std::optional<WorkloadSource> load(const Node &node, std::string name) {
    const std::optional<std::string> given = text(node, "file");
    if (!given) return std::nullopt;
    const std::filesystem::path path = std::filesystem::path(file_).parent_path() / *given;
    Result<LoadedWorkload> loaded = load_workload(path);
    if (!loaded) {
      error(node, fmt::format("the workload '{}' cannot be used", *given), "its mistakes are listed below");
      // Their places are in the workload's file. The reader's own error() would place them in the plan.
      std::copy(loaded.error().begin(), loaded.error().end(), std::back_inserter(diagnostics_));
      return std::nullopt;
    }
    if (name.empty()) name = path.stem().string();
    // The workers of a workload are a factor of the experiment.
    if (const Result<void> one = refuse_clusters(loaded->workload, "an experiment"); !one) {
      return error(node, one.error().front().message, one.error().front().hint);
    }
    return WorkloadSource{std::move(name), std::move(loaded->workload), std::nullopt};
  }

  std::optional<WorkloadSource> read_random(const Node &node, std::string name) {
    if (!check_map(node, "random", generation_keys({"dags", "workers", "bcet", "deadline"}))) return std::nullopt;
    WorkloadSource source{std::move(name), {}, lab::GenerateOptions{}};
    take(node, "dags", source.random->dags);
    take(node, "workers", source.random->workers);
    take(node, "bcet", source.random->bcet_min);
    source.random->bcet_max = source.random->bcet_min;
    take(node, "deadline", source.random->deadline_min);
    take_generation(node, *source.random);
    return source;
  }

  // Reads unbounded, 3 (all DAGs), or [2, 3] (by DAG).
  void read_max_active() {
    const Node *node = find(root_, "max_active");
    if (node == nullptr) return;
    if (node->kind != Node::Kind::Sequence) {
      wrong_type(*node, "max_active", "a list of bounds, such as unbounded, 3 or [2, 3]");
      return;
    }
    for (const Node &item : node->children) {
      if (item.kind == Node::Kind::Sequence) {
        std::vector<std::uint32_t> bounds;
        for (const Node &part : item.children) {
          if (const auto bound = integer<std::uint32_t>(part, "max_active", 0, kMaxBound)) bounds.push_back(*bound);
        }
        plan_.max_active.push_back(std::move(bounds));
      } else if (item.text == "unbounded") {
        plan_.max_active.push_back({0});
      } else if (const auto bound = integer<std::uint32_t>(item, "max_active", 1, kMaxBound)) {
        plan_.max_active.push_back({*bound});
      }
    }
  }

  void check() {
    check_name("name", plan_.name);
    if (plan_.warm_up >= plan_.duration) mistake("warm_up", "the warm-up takes the whole duration");
    if (plan_.workloads.empty()) {
      mistake("workloads", "no workload is given", "name files, as in workloads: [cart.yaml]");
    }
    if (plan_.executors.empty()) {
      mistake("executors", "no executor is given", "name executors, as in executors: [ideal, redag, mte]");
    }
    check_executors();
    check_workloads();
    std::vector<Factor> factors = factors_of(plan_);
    for (std::size_t f = 0; f < factors.size(); ++f) factors[f].name = kFactorKeys[f];
    check_grid(factors, plan_.repetitions);
  }

  void check_executors() {
    for (const std::string &written : plan_.executors) check_executor(written);
  }

  void check_executor(const std::string &written) {
    const auto [world, name] = place_of(plan_, written);
    const std::vector<std::string> of_world = executors_(world);
    std::vector<std::string_view> known(of_world.begin(), of_world.end());
    if (name == written) known.insert(known.begin(), {kIdeal, kUnlimited});
    if (std::find(known.begin(), known.end(), name) == known.end()) {
      mistake("executors", fmt::format("there is no executor '{}'", written),
              did_you_mean(name, known, fmt::format("known: {}", fmt::join(known, ", "))));
    } else if (world == World::Simulator && name.ends_with("-fifo")) {
      mistake("executors", fmt::format("the simulator has no threads to make real-time: '{}' is the same as '{}' there",
                                       name, name.substr(0, name.find('-'))));
    }
  }

  void check_workloads() {
    for (const WorkloadSource &source : plan_.workloads) {
      check_name("workloads", source.name);
      if (source.random && plan_.utilization.empty()) {
        mistake("workloads", fmt::format("'{}': random workloads need a utilization", source.name));
      }
      const std::size_t dags = source.random ? source.random->dags : source.workload.dags.size();
      for (const std::vector<std::uint32_t> &bounds : plan_.max_active) {
        if (bounds.size() <= 1 || bounds.size() == dags) continue;
        mistake("max_active",
                fmt::format("{} bounds are given, but '{}' has {} DAGs", bounds.size(), source.name, dags));
        break;
      }
    }
  }

  const ExecutorNames &executors_;
  FactorialPlan plan_;
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

std::vector<Factor> factors_of(const FactorialPlan &plan) {
  const auto fraction = [](std::uint32_t value) { return fmt::format("{}", share(value)); };
  const auto number = [](std::uint32_t value) { return std::to_string(value); };
  return {
      {"workload", texts(plan.workloads, [](const WorkloadSource &source) { return source.name; }), false},
      {"policy", texts(plan.policies, [](PolicyKind policy) { return to_string(policy); }), false},
      {"workers", texts(plan.workers, number), true},
      {"utilization", texts(plan.utilization, fraction), true},
      {"demand_scale", texts(plan.demand_scale, fraction), true},
      {"deadline_scale", texts(plan.deadline_scale, fraction), true},
      {"max_active", texts(plan.max_active, bounds_text), false},
      {"executor", plan.executors, false},
  };
}

std::vector<Point> points_of(const FactorialPlan &plan) {
  return points_of(factors_of(plan), [&plan](std::size_t factor, const Point &point) {
    return applies(plan, factor, plan.executors[point[kExecutor]]);
  });
}

Result<FactorialPlan> read_factorial_plan(const yaml::Node &root, const std::string &file,
                                          const ExecutorNames &executors) {
  return FactorialReader(root, file, executors).run();
}

}  // namespace redag::experiment
