// The text form of a plan: docs/experiments.md.
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "redag/experiment/acceptance_plan.hpp"
#include "redag/model/workload_yaml_tree.hpp"
#include "redag/model/workload_yaml_values.hpp"
#include "redag/trace/output_file.hpp"

namespace redag::experiment {
namespace {

using yaml::find;
using yaml::Node;

constexpr std::array kPreemptions = {PreemptionMode::None, PreemptionMode::Os, PreemptionMode::Cooperative,
                                     PreemptionMode::Auto};
constexpr std::array kDeadlines = {DeadlineKind::Implicit, DeadlineKind::Constrained};
constexpr std::array kShapes = {DagShape::Layered, DagShape::ErdosRenyi, DagShape::ForkJoin, DagShape::Chain,
                                DagShape::Independent};
constexpr std::array kPeriods = {PeriodModel::LogUniform, PeriodModel::Harmonic, PeriodModel::Automotive,
                                 PeriodModel::Robot};
constexpr std::array kUtilizations = {UtilizationMethod::Drs, UtilizationMethod::UUniFastDiscard};
constexpr std::array kPolicies = {PolicyKind::RateMonotonic, PolicyKind::DeadlineMonotonic,
                                  PolicyKind::Fixed,         PolicyKind::Edf,
                                  PolicyKind::Fifo,          PolicyKind::ChainAware};

const std::vector<std::string_view> kTopKeys = {"experiment",  "name",    "seed",       "sets",
                                                "utilization", "dags",    "workers",    "deadlines",
                                                "preemption",  "methods", "simulation", "workload"};
const std::vector<std::string_view> kWorkloadKeys = {
    "tasks",      "shape",      "edge_probability",   "policy", "max_active",           "periods",
    "period_min", "period_max", "period_granularity", "jitter", "max_task_utilization", "utilization_method"};

class Reader : private yaml::ValueReader {
 public:
  Reader(const Node &root, std::string file) : ValueReader(std::move(file)), root_(root) {}

  Result<AcceptancePlan> run() {
    if (root_.kind == Node::Kind::Null) {
      error(Node{}, "there is no plan in it", "the smallest is 'experiment: acceptance': see docs/experiments.md");
    } else if (check_map(root_, "a plan", kTopKeys)) {
      read();
      if (diagnostics_.empty()) look_at_the_whole();
    }
    std::stable_sort(diagnostics_.begin(), diagnostics_.end(), [](const Diagnostic &a, const Diagnostic &b) {
      return std::tie(a.line, a.column) < std::tie(b.line, b.column);
    });
    if (!diagnostics_.empty()) return tl::unexpected<Diagnostics>(std::move(diagnostics_));
    return std::move(plan_);
  }

 private:
  template <class T, class Read>
  void take(const Node &map, const char *key, T &out, Read read) {
    const Node *node = find(map, key);
    if (node == nullptr) return;
    if (auto value = read(*node, key)) out = std::move(*value);
  }

  void take_number(const Node &map, const char *key, double &out) {
    take(map, key, out, [this](const Node &node, std::string_view name) -> std::optional<double> {
      double value = 0;
      const char *end = node.text.data() + node.text.size();
      const auto [stop, code] = std::from_chars(node.text.data(), end, value);
      if (node.kind == Node::Kind::Scalar && code == std::errc() && stop == end && std::isfinite(value)) return value;
      wrong_type(node, name, "a number");
      return std::nullopt;
    });
  }
  void take_duration(const Node &map, const char *key, Duration &out) {
    take(map, key, out, [this](const Node &node, std::string_view name) { return positive_duration(node, name); });
  }
  void take_count(const Node &map, const char *key, std::uint32_t &out, std::uint32_t smallest) {
    take(map, key, out,
         [&](const Node &node, std::string_view name) { return integer<std::uint32_t>(node, name, smallest); });
  }
  template <class Enum, std::size_t N>
  void take_enum(const Node &map, const char *key, Enum &out, const std::array<Enum, N> &values) {
    take(map, key, out,
         [&](const Node &node, std::string_view name) { return one_of(node, name, std::span<const Enum>(values)); });
  }

  // One value, or a list of them.
  template <class Value, class Read>
  void take_list(const char *key, std::vector<Value> &out, Read read) {
    const Node *node = find(root_, key);
    if (node == nullptr) return;
    out.clear();
    if (node->kind != Node::Kind::Sequence) {
      if (auto value = read(*node, key)) out.push_back(std::move(*value));
      return;
    }
    for (const Node &item : node->children) {
      if (auto value = read(item, key)) out.push_back(std::move(*value));
    }
  }
  void take_counts(const char *key, std::vector<std::uint32_t> &out) {
    take_list(key, out,
              [this](const Node &node, std::string_view name) { return integer<std::uint32_t>(node, name, 1); });
  }

  void read() {
    const Node *kind = find(root_, "experiment");
    if (kind == nullptr) {
      error(root_, "experiment is missing", "say 'experiment: acceptance'");
    } else if (kind->text != "acceptance") {
      error(*kind, fmt::format("unknown experiment {}", describe(*kind)), "known: acceptance");
    }
    take(root_, "name", plan_.name, [this](const Node &node, std::string_view key) { return text(node, key); });
    take(root_, "seed", plan_.seed,
         [this](const Node &node, std::string_view key) { return integer<std::uint64_t>(node, key, 0); });
    take_count(root_, "sets", plan_.sets, 1);
    read_utilization();
    take_counts("dags", plan_.dags);
    take_counts("workers", plan_.workers);
    take_list("deadlines", plan_.deadlines, [this](const Node &node, std::string_view key) {
      return one_of(node, key, std::span<const DeadlineKind>(kDeadlines));
    });
    take_list("preemption", plan_.preemption, [this](const Node &node, std::string_view key) {
      return one_of(node, key, std::span<const PreemptionMode>(kPreemptions));
    });
    take_list("methods", plan_.methods, [this](const Node &node, std::string_view key) { return text(node, key); });
    read_simulation();
    read_workload();
  }

  // As on the command line, or as YAML has it: {from: 0.05, to: 1, step: 0.05}, [0.2, 0.5].
  void read_utilization() {
    const Node *node = find(root_, "utilization");
    if (node == nullptr) return;
    std::string text = node->text;
    if (node->kind == Node::Kind::Map) {
      const std::vector<std::string_view> keys = {"from", "to", "step"};
      if (!check_map(*node, "utilization", keys)) return;
      for (const std::string_view key : keys) {
        const Node *part = find(*node, key);
        text += (key == "from" ? "" : ":") + (part == nullptr ? std::string() : part->text);
      }
    } else if (node->kind == Node::Kind::Sequence) {
      for (const Node &item : node->children) text += (text.empty() ? "" : ",") + item.text;
    }
    Result<std::vector<std::uint32_t>> values = parse_utilization(text);
    if (values) {
      plan_.utilization = std::move(*values);
    } else {
      error(*node, values.error().front().message, values.error().front().hint);
    }
  }

  void read_simulation() {
    const Node *node = find(root_, "simulation");
    if (node == nullptr || !check_map(*node, "simulation", {"offsets", "periods"})) return;
    take_count(*node, "offsets", plan_.simulation.offsets, 0);
    take_count(*node, "periods", plan_.simulation.periods, 1);
  }

  void read_workload() {
    const Node *node = find(root_, "workload");
    if (node == nullptr || !check_map(*node, "workload", kWorkloadKeys)) return;
    GenerateOptions &workload = plan_.workload;
    read_tasks(*node);
    take_enum(*node, "shape", workload.shape, kShapes);
    take_number(*node, "edge_probability", workload.edge_probability);
    take_enum(*node, "policy", workload.policy, kPolicies);
    take_count(*node, "max_active", workload.max_active_max, 0);
    workload.max_active_min = workload.max_active_max;
    take_enum(*node, "periods", workload.periods, kPeriods);
    take_duration(*node, "period_min", workload.period_min);
    take_duration(*node, "period_max", workload.period_max);
    take_duration(*node, "period_granularity", workload.period_granularity);
    take_number(*node, "jitter", workload.jitter);
    take_number(*node, "max_task_utilization", workload.max_task_utilization);
    take_enum(*node, "utilization_method", workload.method, kUtilizations);
  }

  void read_tasks(const Node &workload) {
    const Node *node = find(workload, "tasks");
    if (node == nullptr) return;
    if (node->kind == Node::Kind::Map) {
      if (!check_map(*node, "tasks", {"min", "max"})) return;
      take_count(*node, "min", plan_.workload.min_tasks, 1);
      take_count(*node, "max", plan_.workload.max_tasks, 1);
    } else {
      take_count(workload, "tasks", plan_.workload.min_tasks, 1);
      plan_.workload.max_tasks = plan_.workload.min_tasks;
    }
  }

  void look_at_the_whole() {
    for (const PlanMistake &mistake : find_mistakes(plan_)) {
      const Node *node = find(root_, mistake.key);
      error(node != nullptr ? *node : root_, mistake.message, mistake.hint);
    }
  }

  const Node &root_;
  AcceptancePlan plan_;
};

template <class Values, class Text>
std::string list(const Values &values, Text text) {
  std::string joined;
  for (const auto &value : values) joined += (joined.empty() ? "" : ", ") + std::string(text(value));
  return "[" + joined + "]";
}

}  // namespace

Result<AcceptancePlan> parse_acceptance_plan(std::string_view text, const std::string &file) {
  const Result<Node> root = yaml::parse(text, file);
  if (!root) return tl::unexpected<Diagnostics>(root.error());
  return Reader(*root, file).run();
}

Result<AcceptancePlan> load_acceptance_plan(const std::string &path) {
  const Result<std::string> text = trace::read_file(path);
  if (!text) return tl::unexpected<Diagnostics>(text.error());
  return parse_acceptance_plan(*text, path);
}

std::string to_yaml(const AcceptancePlan &plan) {
  const auto number = [](auto value) { return fmt::format("{}", value); };
  const auto share = [](std::uint32_t value) { return fmt::format("{}", value / static_cast<double>(kMillion)); };
  const auto name = [](auto value) { return to_string(value); };
  const GenerateOptions &w = plan.workload;
  std::string text = "experiment: acceptance\n";
  const auto line = [&text](std::string_view key, const std::string &value) {
    text += fmt::format("{}: {}\n", key, value);
  };
  line("name", plan.name);
  line("seed", number(plan.seed));
  line("sets", number(plan.sets));
  line("utilization", list(plan.utilization, share));
  line("dags", list(plan.dags, number));
  line("workers", list(plan.workers, number));
  line("deadlines", list(plan.deadlines, name));
  line("preemption", list(plan.preemption, name));
  line("methods", list(plan.methods, [](const std::string &method) { return method; }));
  line("simulation", fmt::format("{{offsets: {}, periods: {}}}", plan.simulation.offsets, plan.simulation.periods));
  text += "workload:\n";
  line("  tasks", fmt::format("{{min: {}, max: {}}}", w.min_tasks, w.max_tasks));
  line("  shape", to_string(w.shape));
  line("  edge_probability", number(w.edge_probability));
  line("  policy", to_string(w.policy));
  line("  max_active", number(w.max_active_max));
  line("  periods", to_string(w.periods));
  line("  period_min", format_duration(w.period_min));
  line("  period_max", format_duration(w.period_max));
  line("  period_granularity", format_duration(w.period_granularity));
  line("  jitter", number(w.jitter));
  line("  max_task_utilization", number(w.max_task_utilization));
  line("  utilization_method", to_string(w.method));
  return text;
}

}  // namespace redag::experiment
