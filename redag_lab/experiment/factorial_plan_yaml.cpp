// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Reads and writes the text form of a plan, which docs/experiments.md describes.
#include <array>
#include <filesystem>
#include <iterator>
#include <utility>

#include <fmt/format.h>

#include "redag/base/lines.hpp"
#include "redag/model/clusters.hpp"
#include "redag/model/validate.hpp"
#include "redag/model/workload_yaml.hpp"
#include "redag/trace/output_file.hpp"
#include "redag_lab/experiment/factorial_plan.hpp"
#include "redag_lab/experiment/plan_yaml.hpp"

namespace redag::experiment {
namespace {

using yaml::find;
using yaml::Node;

constexpr std::array kFactorialWorlds = {World::Simulator, World::Threads, World::Ros2};

const std::vector<std::string_view> kFactorialKeys = {
    "experiment", "name",        "world",         "seed",           "repetitions", "duration",
    "warm_up",    "overheads",   "paper_startup", "quantiles",      "workloads",   "policies",
    "workers",    "utilization", "demand_scale",  "deadline_scale", "max_active",  "executors"};

class FactorialReader : private PlanReader {
 public:
  FactorialReader(const Node &root, std::string file, const ExecutorNames &executors)
      : PlanReader(std::move(file)), root_(root), executors_(executors) {}

  Result<FactorialPlan> run() {
    return read_plan(
        root_, "factorial", kFactorialKeys, plan_, [this] { read(); },
        [this] { return find_mistakes(plan_, executors_); });
  }

 private:
  void read() {
    take_text(root_, "name", plan_.name);
    take_enum(root_, "world", plan_.world, kFactorialWorlds);
    take_seed(root_, plan_.seed);
    take_count(root_, "repetitions", plan_.repetitions, 1);
    take_duration(root_, "duration", plan_.duration);
    take(root_, "warm_up", plan_.warm_up,
         [this](const Node &node, std::string_view key) { return duration(node, key); });
    take(root_, "paper_startup", plan_.paper_startup,
         [this](const Node &node, std::string_view key) { return duration(node, key); });
    take_flag(root_, "quantiles", plan_.quantiles);
    read_overheads();
    read_workloads();
    take_list(root_, "policies", plan_.policies, [this](const Node &node, std::string_view key) {
      return one_of(node, key, std::span<const PolicyKind>(kPolicies));
    });
    take_counts(root_, "workers", plan_.workers);
    take_range(root_, "utilization", plan_.utilization);
    take_range(root_, "demand_scale", plan_.demand_scale);
    take_range(root_, "deadline_scale", plan_.deadline_scale);
    read_max_active();
    take_list(root_, "executors", plan_.executors,
              [this](const Node &node, std::string_view key) { return text(node, key); });
  }

  void read_overheads() {
    const Node *node = find(root_, "overheads");
    if (node == nullptr || !check_map(*node, "overheads", {"release", "dispatch", "preempt"})) return;
    const auto read = [&](const char *key, Duration &out) {
      take(*node, key, out, [this](const Node &value, std::string_view name) { return duration(value, name); });
    };
    read("release", plan_.overheads.release);
    read("dispatch", plan_.overheads.dispatch);
    read("preempt", plan_.overheads.preempt);
  }

  void read_workloads() {
    take_list(root_, "workloads", plan_.workloads,
              [this](const Node &node, std::string_view /*key*/) -> std::optional<WorkloadSource> {
                if (node.kind == Node::Kind::Scalar) return load(node, {});
                if (!check_map(node, "a workload", {"name", "file", "text", "random"})) return std::nullopt;
                std::string name;
                take_text(node, "name", name);
                if (const Node *file = find(node, "file")) return load(*file, std::move(name));
                if (const Node *text = find(node, "text")) return parse(*text, std::move(name));
                if (const Node *random = find(node, "random")) return read_random(*random, std::move(name));
                error(node, "a workload is a file, a text, or random",
                      "write, for example, {name: cart, file: cart.yaml}");
                return std::nullopt;
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
    return source_of(node, std::move(name), std::move(loaded->workload));
  }

  std::optional<WorkloadSource> parse(const Node &node, std::string name) {
    if (node.kind != Node::Kind::Scalar || node.text.empty()) {
      wrong_type(node, "text", "a workload");
      return std::nullopt;
    }
    Result<LoadedWorkload> parsed = parse_workload(node.text, fmt::format("{} (text of line {})", file_, node.line));
    if (!parsed) {
      std::copy(parsed.error().begin(), parsed.error().end(), std::back_inserter(diagnostics_));
      return std::nullopt;
    }
    if (name.empty()) name = parsed->workload.name;
    return source_of(node, std::move(name), std::move(parsed->workload));
  }

  // The workers of a workload are a factor of the experiment.
  std::optional<WorkloadSource> source_of(const Node &node, std::string name, Workload workload) {
    if (const Result<void> one = refuse_clusters(workload, "an experiment"); !one) {
      error(node, one.error().front().message, one.error().front().hint);
      return std::nullopt;
    }
    return WorkloadSource{std::move(name), std::move(workload), std::nullopt};
  }

  std::optional<WorkloadSource> read_random(const Node &node, std::string name) {
    std::vector<std::string_view> keys = generation_keys();
    keys.insert(keys.begin(), {"dags", "workers", "bcet", "deadline"});
    if (!check_map(node, "random", keys)) return std::nullopt;
    WorkloadSource source{std::move(name), {}, lab::GenerateOptions{}};
    take_count(node, "dags", source.random->dags, 1);
    take_count(node, "workers", source.random->workers, 1);
    take_number(node, "bcet", source.random->bcet_min);
    source.random->bcet_max = source.random->bcet_min;
    take_number(node, "deadline", source.random->deadline_min);
    take_generation(node, *source.random);
    return source;
  }

  // Reads unbounded, 3 (all DAGs), [2, 3] (by DAG), or {from: 2, to: 5} (all pairs of two DAGs).
  void read_max_active() {
    const Node *node = find(root_, "max_active");
    if (node == nullptr) return;
    if (node->kind != Node::Kind::Sequence) {
      wrong_type(*node, "max_active", "a list of bounds, such as unbounded, 3, [2, 3] or {from: 2, to: 5}");
      return;
    }
    for (const Node &item : node->children) {
      if (item.kind == Node::Kind::Map) {
        read_pairs(item);
      } else if (item.kind == Node::Kind::Sequence) {
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

  void read_pairs(const Node &item) {
    if (!check_map(item, "max_active", {"from", "to"})) return;
    std::uint32_t from = 0;
    std::uint32_t to = 0;
    take_count(item, "from", from, 1);
    take_count(item, "to", to, 1);
    if (from == 0 || to < from || to - from > 100) {
      error(item, "max_active: 'from' and 'to' must be a range of at most 100 bounds",
            "write, for example, {from: 2, to: 5}");
      return;
    }
    for (std::uint32_t a = from; a <= to; ++a) {
      for (std::uint32_t b = from; b <= to; ++b) plan_.max_active.push_back({a, b});
    }
  }

  const Node &root_;
  const ExecutorNames &executors_;
  FactorialPlan plan_;
};

// Returns a block scalar, which keeps the text unchanged.
std::string block(std::string_view text, std::string_view indentation) {
  std::string indented;
  while (!text.empty()) {
    const std::string_view line = next_line(text);
    indented += fmt::format("{}{}\n", line.empty() ? "" : indentation, line);
  }
  return indented;
}

}  // namespace

Result<FactorialPlan> parse_factorial_plan(std::string_view text, const std::string &file,
                                           const ExecutorNames &executors) {
  const Result<Node> root = yaml::parse(text, file);
  if (!root) return tl::unexpected<Diagnostics>(root.error());
  return FactorialReader(*root, file, executors).run();
}

Result<FactorialPlan> load_factorial_plan(const std::string &path, const ExecutorNames &executors) {
  const Result<std::string> text = trace::read_file(path, kMaxWorkloadBytes);
  if (!text) return tl::unexpected<Diagnostics>(text.error());
  return parse_factorial_plan(*text, path, executors);
}

std::string to_yaml(const FactorialPlan &plan) {
  std::string text = "experiment: factorial\n";
  const auto line = [&text](std::string_view key, const std::string &value) {
    text += fmt::format("{}: {}\n", key, value);
  };
  const auto number = [](auto value) { return fmt::format("{}", value); };
  line("name", plan.name);
  line("world", to_string(plan.world));
  line("seed", number(plan.seed));
  line("repetitions", number(plan.repetitions));
  line("duration", format_duration(plan.duration));
  line("warm_up", format_duration(plan.warm_up));
  line("overheads", fmt::format("{{release: {}, dispatch: {}, preempt: {}}}", format_duration(plan.overheads.release),
                                format_duration(plan.overheads.dispatch), format_duration(plan.overheads.preempt)));
  line("paper_startup", format_duration(plan.paper_startup));
  line("quantiles", plan.quantiles ? "true" : "false");
  for (const Factor &factor : factors_of(plan)) {
    if (factor.levels.empty() || factor.kind == FactorKind::Workload || factor.kind == FactorKind::MaxActive) continue;
    const std::string key = factor.kind == FactorKind::Executor ? "executors"
                            : factor.kind == FactorKind::Policy ? "policies"
                                                                : to_string(factor.kind);
    line(key, yaml_list(factor.levels, [](const std::string &level) { return level; }));
  }
  if (!plan.max_active.empty()) {
    line("max_active", yaml_list(plan.max_active,
                                 [&](const std::vector<std::uint32_t> &bounds) { return yaml_list(bounds, number); }));
  }
  text += "workloads:\n";
  for (const WorkloadSource &source : plan.workloads) {
    text += fmt::format("  - name: {}\n", source.name);
    if (source.random) {
      text += fmt::format("    random:\n      dags: {}\n      workers: {}\n      bcet: {}\n      deadline: {}\n{}",
                          source.random->dags, source.random->workers, source.random->bcet_min,
                          source.random->deadline_min, generation_yaml(*source.random, "      "));
    } else {
      text += "    text: |\n" + block(redag::to_yaml(source.workload), "      ");
    }
  }
  return text;
}

}  // namespace redag::experiment
