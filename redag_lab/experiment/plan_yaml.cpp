// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/plan_yaml.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "redag/model/validate.hpp"

namespace redag::experiment {
namespace {

using yaml::find;

constexpr double kMillionth = 1e6;
constexpr std::array<std::string_view, 2> kExperiments = {"acceptance", "factorial"};

// Parses a number into millionths; numbers above 1000 are refused.
std::optional<std::uint32_t> millionths(std::string_view text) {
  double value = 0;
  const char *end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc() || stop != end || !(value > 0) || value > 1000) return std::nullopt;
  const auto scaled = static_cast<std::uint32_t>(std::llround(value * kMillionth));
  if (scaled == 0) return std::nullopt;
  return scaled;
}

std::optional<std::vector<std::uint32_t>> split(std::string_view text, char separator) {
  std::vector<std::uint32_t> values;
  while (true) {
    const std::size_t at = text.find(separator);
    const std::optional<std::uint32_t> value = millionths(text.substr(0, at));
    if (!value) return std::nullopt;
    values.push_back(*value);
    if (at == std::string_view::npos) return values;
    text.remove_prefix(at + 1);
  }
}

}  // namespace

bool PlanReader::is_plan(const Node &root, std::string_view kind, const std::vector<std::string_view> &keys) {
  if (root.kind == Node::Kind::Null) {
    error(Node{}, "the file has no plan", fmt::format("begin with 'experiment: {}', see docs/experiments.md", kind));
    return false;
  }
  if (!check_map(root, "a plan", keys)) return false;
  const Node *named = find(root, "experiment");
  if (named == nullptr) {
    error(root, "the key 'experiment' is missing", fmt::format("write 'experiment: {}'", kind));
  } else if (named->text != kind) {
    const bool is_other = std::find(kExperiments.begin(), kExperiments.end(), named->text) != kExperiments.end();
    error(*named, fmt::format("unknown experiment {}", describe(*named)),
          is_other ? fmt::format("this is a plan for 'redag experiment {}'", named->text)
                   : fmt::format("known: {}", kind));
  }
  return true;
}

void PlanReader::take_text(const Node &map, const char *key, std::string &out) {
  take(map, key, out, [this](const Node &node, std::string_view name) { return text(node, name); });
}
void PlanReader::take_number(const Node &map, const char *key, double &out) {
  take(map, key, out, [this](const Node &node, std::string_view name) -> std::optional<double> {
    double value = 0;
    const char *end = node.text.data() + node.text.size();
    const auto [stop, code] = std::from_chars(node.text.data(), end, value);
    if (node.kind == Node::Kind::Scalar && code == std::errc() && stop == end && std::isfinite(value)) return value;
    wrong_type(node, name, "a number");
    return std::nullopt;
  });
}
void PlanReader::take_flag(const Node &map, const char *key, bool &out) {
  take(map, key, out, [this](const Node &node, std::string_view name) -> std::optional<bool> {
    if (node.kind == Node::Kind::Scalar && node.text == "true") return true;
    if (node.kind == Node::Kind::Scalar && node.text == "false") return false;
    wrong_type(node, name, "true or false");
    return std::nullopt;
  });
}
void PlanReader::take_duration(const Node &map, const char *key, Duration &out) {
  take(map, key, out, [this](const Node &node, std::string_view name) { return positive_duration(node, name); });
}
void PlanReader::take_count(const Node &map, const char *key, std::uint32_t &out, std::uint32_t smallest) {
  take(map, key, out, [&](const Node &node, std::string_view name) {
    return integer<std::uint32_t>(node, name, smallest, kMaxBound);
  });
}
void PlanReader::take_seed(const Node &map, std::uint64_t &out) {
  take(map, "seed", out,
       [this](const Node &node, std::string_view name) { return integer<std::uint64_t>(node, name, 0); });
}
void PlanReader::take_counts(const Node &map, const char *key, std::vector<std::uint32_t> &out) {
  take_list(map, key, out, [this](const Node &node, std::string_view name) {
    return integer<std::uint32_t>(node, name, 1, kMaxBound);
  });
}

void PlanReader::take_range(const Node &map, const char *key, std::vector<std::uint32_t> &out) {
  const Node *node = find(map, key);
  if (node == nullptr) return;
  std::string text = node->text;
  if (node->kind == Node::Kind::Map) {
    const std::vector<std::string_view> keys = {"from", "to", "step"};
    if (!check_map(*node, key, keys)) return;
    for (const std::string_view part_key : keys) {
      const Node *part = find(*node, part_key);
      text += (part_key == "from" ? "" : ":") + (part == nullptr ? std::string() : part->text);
    }
  } else if (node->kind == Node::Kind::Sequence) {
    for (const Node &item : node->children) text += (text.empty() ? "" : ",") + item.text;
  }
  Result<std::vector<std::uint32_t>> values = parse_range(text);
  if (values) {
    out = std::move(*values);
  } else {
    error(*node, fmt::format("{}: {}", key, values.error().front().message), values.error().front().hint);
  }
}

const std::vector<std::string_view> &PlanReader::generation_keys() {
  static const std::vector<std::string_view> kKeys = {
      "tasks",      "shape",      "edge_probability",   "policy", "max_active",           "periods",
      "period_min", "period_max", "period_granularity", "jitter", "max_task_utilization", "utilization_method"};
  return kKeys;
}

void PlanReader::take_generation(const Node &map, lab::GenerateOptions &out) {
  take_tasks(map, out);
  take_enum(map, "shape", out.shape, lab::kDagShapes);
  take_number(map, "edge_probability", out.edge_probability);
  take_enum(map, "policy", out.policy, kPolicies);
  take_count(map, "max_active", out.max_active_max, 0);
  out.max_active_min = out.max_active_max;
  take_enum(map, "periods", out.periods, lab::kPeriodModels);
  take_duration(map, "period_min", out.period_min);
  take_duration(map, "period_max", out.period_max);
  take_duration(map, "period_granularity", out.period_granularity);
  take_number(map, "jitter", out.jitter);
  take_number(map, "max_task_utilization", out.max_task_utilization);
  take_enum(map, "utilization_method", out.method, lab::kUtilizationMethods);
}

void PlanReader::take_tasks(const Node &map, lab::GenerateOptions &out) {
  const Node *node = find(map, "tasks");
  if (node == nullptr) return;
  if (node->kind == Node::Kind::Map) {
    if (!check_map(*node, "tasks", {"min", "max"})) return;
    take_count(*node, "min", out.min_tasks, 1);
    take_count(*node, "max", out.max_tasks, 1);
  } else {
    take_count(map, "tasks", out.min_tasks, 1);
    out.max_tasks = out.min_tasks;
  }
}

Result<std::vector<std::uint32_t>> parse_range(std::string_view text) {
  constexpr const char *kHint = "write from:to:step or a list, each value above 0, as in 0.05:1:0.05 or 0.2,0.5,0.8";
  const bool is_range = text.find(':') != std::string_view::npos;
  const std::optional<std::vector<std::uint32_t>> values = split(text, is_range ? ':' : ',');
  if (!values || (is_range && values->size() != 3)) {
    return make_error(fmt::format("'{}' is neither a range nor a list of values", text), kHint);
  }
  if (!is_range) return *values;
  const auto [from, to, step] = std::tuple((*values)[0], (*values)[1], (*values)[2]);
  if (from > to || (to - from) / step > 10'000) {
    return make_error(fmt::format("'{}' is not a range of at most 10000 values", text), kHint);
  }
  std::vector<std::uint32_t> range;
  for (std::uint64_t u = from; u <= to; u += step) range.push_back(static_cast<std::uint32_t>(u));
  return range;
}

std::string generation_yaml(const lab::GenerateOptions &options, std::string_view indentation) {
  std::string text;
  const auto line = [&](std::string_view key, const std::string &value) {
    text += fmt::format("{}{}: {}\n", indentation, key, value);
  };
  const auto number = [](auto value) { return fmt::format("{}", value); };
  line("tasks", fmt::format("{{min: {}, max: {}}}", options.min_tasks, options.max_tasks));
  line("shape", to_string(options.shape));
  line("edge_probability", number(options.edge_probability));
  line("policy", to_string(options.policy));
  line("max_active", number(options.max_active_max));
  line("periods", to_string(options.periods));
  line("period_min", format_duration(options.period_min));
  line("period_max", format_duration(options.period_max));
  line("period_granularity", format_duration(options.period_granularity));
  line("jitter", number(options.jitter));
  line("max_task_utilization", number(options.max_task_utilization));
  line("utilization_method", to_string(options.method));
  return text;
}

bool is_plan_name(std::string_view name) {
  const bool printable = std::all_of(name.begin(), name.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_';
  });
  return !name.empty() && printable;
}

}  // namespace redag::experiment
