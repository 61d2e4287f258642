// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/plan_reader.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include <fmt/format.h>

namespace redag::experiment {
namespace {

using yaml::find;
using yaml::Node;

constexpr std::uint64_t kMostCombinations = 1'000'000;
constexpr std::uint64_t kMostUnits = 100'000'000;
constexpr std::uint32_t kMostLevels = 10'000;  // of a range

}  // namespace

void PlanReader::take_range(const char *key, std::vector<std::uint32_t> &out) {
  const auto millionths = [this](const Node &node, std::string_view name) -> std::optional<std::uint32_t> {
    const std::optional<double> value = real(node, name);
    const double scaled = value.value_or(1) * kMillion;
    if (scaled < 0.5 || scaled > 1e9) error(node, fmt::format("{} must be above 0 and at most 1000", name));
    return value ? std::optional(static_cast<std::uint32_t>(std::llround(std::clamp(scaled, 1.0, 1e9)))) : std::nullopt;
  };
  const Node *node = find(root_, key);
  if (node == nullptr || node->kind != Node::Kind::Map) return take_list(key, out, millionths);
  std::uint32_t from = 0;
  std::uint32_t to = 0;
  std::uint32_t step = 0;
  if (!check_map(*node, key, {"from", "to", "step"})) return;
  take_with(*node, "from", from, millionths);
  take_with(*node, "to", to, millionths);
  take_with(*node, "step", step, millionths);
  if (from == 0 || step == 0 || from > to || (to - from) / step > kMostLevels) {
    error(*node, fmt::format("{} is not a range of at most {} values", key, kMostLevels),
          "write, for example, {from: 0.05, to: 1, step: 0.05}");
    return;
  }
  out.clear();
  for (std::uint64_t value = from; value <= to; value += step) out.push_back(static_cast<std::uint32_t>(value));
}

std::vector<std::string_view> PlanReader::generation_keys(std::vector<std::string_view> more) {
  more.insert(more.end(), {"tasks", "shape", "periods", "period_min", "period_max", "max_task_utilization"});
  return more;
}

void PlanReader::take_generation(const Node &map, lab::GenerateOptions &out) {
  const Node *tasks = find(map, "tasks");
  if (tasks == nullptr || tasks->kind != Node::Kind::Map) {
    take(map, "tasks", out.min_tasks);
    if (tasks != nullptr) out.max_tasks = out.min_tasks;
  } else if (check_map(*tasks, "tasks", {"min", "max"})) {
    take(*tasks, "min", out.min_tasks);
    take(*tasks, "max", out.max_tasks);
  }
  take(map, "shape", out.shape, lab::kDagShapes);
  take(map, "periods", out.periods, lab::kPeriodModels);
  take(map, "period_min", out.period_min);
  take(map, "period_max", out.period_max);
  take(map, "max_task_utilization", out.max_task_utilization);
}

void PlanReader::mistake(std::string_view key, std::string message, std::string hint) {
  const Node *node = find(root_, key);
  error(node != nullptr ? *node : root_, std::move(message), std::move(hint));
}

void PlanReader::check_name(std::string_view key, std::string_view name) {
  const bool good = std::all_of(name.begin(), name.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_';
  });
  if (name.empty() || !good) {
    mistake(key, fmt::format("'{}': a name consists of one or more letters, digits, - and _", name));
  }
}

void PlanReader::check_grid(const std::vector<Factor> &factors, std::uint32_t repetitions) {
  for (const Factor &factor : factors) {
    const std::set<std::string> distinct(factor.levels.begin(), factor.levels.end());
    if (distinct.size() < factor.levels.size()) {
      mistake(factor.name, fmt::format("{} lists a value twice", factor.name));
    }
  }
  const std::uint64_t count = count_combinations(factors, kMostCombinations);
  if (count > kMostCombinations || count * repetitions > kMostUnits) {
    mistake("experiment",
            fmt::format("the plan has more than {} combinations or {} units", kMostCombinations, kMostUnits),
            "every combination of the plan's lists is measured: shorten the lists, or split the plan");
  }
}

}  // namespace redag::experiment
