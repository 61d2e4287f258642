// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/loader/workload_yaml_values.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "redag/base/check.hpp"
#include "redag/base/nearest.hpp"
#include "redag/loader/cpu_list.hpp"
#include "redag/loader/validate.hpp"

namespace redag::yaml {

const Node *find(const Node &map, std::string_view key) {
  if (map.kind != Node::Kind::Map) return nullptr;
  for (std::size_t i = 0; i + 1 < map.children.size(); i += 2) {
    if (map.children[i].text == key) return &map.children[i + 1];
  }
  return nullptr;
}

std::nullopt_t ValueReader::error(const Node &at, std::string message, std::string hint) {
  diagnostics_.push_back(Diagnostic{Severity::Error, file_, at.line, at.column, std::move(message), std::move(hint)});
  return std::nullopt;
}

std::nullopt_t ValueReader::wrong_type(const Node &at, std::string_view key, std::string_view expected) {
  return error(at, fmt::format("{} must be {}, not {}", key, expected, describe(at)));
}

std::nullopt_t ValueReader::wrong_number(const Node &at, std::string_view key, std::string_view expected) {
  wrong_type(at, key, expected);
  const bool is_number = !at.text.empty() && at.text.find_first_not_of("0123456789.-") == std::string::npos;
  if (at.kind != Node::Kind::Scalar || !at.quoted || !is_number) return std::nullopt;
  diagnostics_.back().message += " in quotes, which make it a text";
  diagnostics_.back().hint = fmt::format("write '{}: {}'", key, at.text);
  return std::nullopt;
}

std::string ValueReader::did_you_mean(std::string_view name, const std::vector<std::string_view> &candidates,
                                      std::string_view else_say) {
  if (candidates.size() > comparisons_left_) return std::string(else_say);
  comparisons_left_ -= candidates.size();
  const std::string_view best = nearest(name, candidates);
  return best.empty() ? std::string(else_say) : fmt::format("did you mean '{}'?", best);
}

bool ValueReader::check_map(const Node &node, std::string_view what, const std::vector<std::string_view> &keys) {
  if (node.kind != Node::Kind::Map) {
    wrong_type(node, what, fmt::format("a map of {}", fmt::join(keys, ", ")));
    return false;
  }
  REDAG_CHECK(keys.size() <= 64, "one bit for each key");
  std::uint64_t seen = 0;
  for (std::size_t i = 0; i + 1 < node.children.size(); i += 2) {
    const Node &key = node.children[i];
    if (key.kind != Node::Kind::Scalar) {
      error(key, fmt::format("a key must be a name, not {}", describe(key)));
      continue;
    }
    const auto known = std::find(keys.begin(), keys.end(), key.text);
    const std::uint64_t bit = known == keys.end() ? 0 : std::uint64_t{1} << (known - keys.begin());
    if (bit == 0) {
      error(key, fmt::format("unknown key {} in {}", describe(key), what),
            did_you_mean(key.text, keys, fmt::format("known: {}", fmt::join(keys, ", "))));
    } else if ((seen & bit) != 0) {
      error(key, fmt::format("key '{}' is given twice", key.text));
    }
    seen |= bit;
  }
  return true;
}

Diagnostics ValueReader::take_diagnostics() {
  constexpr std::size_t kMostReported = 1000;
  std::stable_sort(diagnostics_.begin(), diagnostics_.end(), [](const Diagnostic &a, const Diagnostic &b) {
    return std::tie(a.line, a.column) < std::tie(b.line, b.column);
  });
  if (diagnostics_.size() > kMostReported) {
    const auto rest = diagnostics_.begin() + kMostReported;
    const bool errors =
        std::any_of(rest, diagnostics_.end(), [](const Diagnostic &each) { return each.severity == Severity::Error; });
    Diagnostic more{errors ? Severity::Error : Severity::Warning, file_, rest->line, rest->column, {}, {}};
    more.message = fmt::format("{} more mistakes are not shown", diagnostics_.size() - kMostReported);
    diagnostics_.erase(rest, diagnostics_.end());
    diagnostics_.push_back(std::move(more));
  }
  return std::move(diagnostics_);
}

std::optional<Duration> ValueReader::duration(const Node &node, std::string_view key) {
  if (node.kind != Node::Kind::Scalar) return wrong_type(node, key, "a duration such as 5ms");
  Result<Duration> value = parse_duration(node.text);
  if (value) return *value;
  for (const Diagnostic &why : value.error()) error(node, fmt::format("{}: {}", key, why.message), why.hint);
  return std::nullopt;
}

std::optional<Duration> ValueReader::rate(const Node &node, std::string_view key) {
  if (node.kind != Node::Kind::Scalar) return wrong_type(node, key, "a rate such as 30Hz");
  Result<Duration> period = parse_rate(node.text);
  if (period) return *period;
  const bool is_duration = parse_duration(node.text).has_value();
  for (const Diagnostic &why : period.error()) {
    error(node, fmt::format("{}: {}", key, why.message),
          is_duration ? fmt::format("write 'period: {}'", node.text) : why.hint);
  }
  return std::nullopt;
}

std::optional<Duration> ValueReader::positive_duration(const Node &node, std::string_view key) {
  const std::optional<Duration> value = duration(node, key);
  if (!value || *value > 0) return value;
  return error(node, fmt::format("{} must be greater than zero, not {}", key, describe(node)));
}

std::optional<Duration> ValueReader::duration_from_zero(const Node &node, std::string_view key) {
  const std::optional<Duration> value = duration(node, key);
  if (!value || *value >= 0) return value;
  return error(node, fmt::format("{} must not be negative, not {}", key, describe(node)));
}

std::optional<std::string> ValueReader::text(const Node &node, std::string_view key) {
  if (node.kind != Node::Kind::Scalar || node.text.empty()) return wrong_type(node, key, "a non-empty string");
  if (const std::string why = name_mistake(node.text); !why.empty()) {
    return error(node, fmt::format("{} {} {}", key, describe(node), why));
  }
  return node.text;
}

std::optional<double> ValueReader::real(const Node &node, std::string_view key) {
  double value = 0;
  if (node.kind == Node::Kind::Scalar && !node.quoted) {
    const char *end = node.text.data() + node.text.size();
    const auto [used, code] = std::from_chars(node.text.data(), end, value);
    if (code == std::errc() && used == end && std::isfinite(value)) return value;
  }
  return wrong_number(node, key, "a number such as 2.5");
}

std::nullopt_t ValueReader::unknown_choice(const Node &node, std::string_view key,
                                           const std::vector<std::string_view> &names) {
  wrong_type(node, key, fmt::format("one of {}", fmt::join(names, ", ")));
  if (node.kind == Node::Kind::Scalar) diagnostics_.back().hint = did_you_mean(node.text, names, "");
  return std::nullopt;
}

std::optional<std::vector<int>> ValueReader::cpus(const Node &node, std::string_view key) {
  std::string list = node.text;
  if (node.kind == Node::Kind::Sequence) {
    for (const Node &item : node.children) list += (list.empty() ? "" : ",") + item.text;
  }
  std::optional<std::vector<int>> cpus = parse_cpu_list(list);
  if (!cpus) wrong_type(node, key, "a list of processors such as 0-3 or [0, 2-5]");
  return cpus;
}

std::optional<ExecutionTime> ValueReader::execution(const Node &node) {
  using Kind = ExecutionTime::Kind;
  if (node.is("constant")) return ExecutionTime{};
  if (node.is("uniform")) return ExecutionTime{Kind::Uniform, 0, 0, {}};
  if (node.kind != Node::Kind::Map) {
    return unknown_choice(node, "execution",
                          {"constant", "uniform", "{normal: {mean, stddev}}", "{empirical: [durations]}"});
  }
  check_map(node, "execution", {"normal", "empirical"});
  const Node *normal = find(node, "normal");
  const Node *empirical = find(node, "empirical");
  if ((normal == nullptr) == (empirical == nullptr))
    return error(node, "execution must have either 'normal' or 'empirical'");
  return normal != nullptr ? normal_execution(*normal) : empirical_execution(*empirical);
}

std::optional<ExecutionTime> ValueReader::normal_execution(const Node &node) {
  if (!check_map(node, "normal", {"mean", "stddev"})) return std::nullopt;
  const std::size_t mistakes = diagnostics_.size();
  ExecutionTime model{ExecutionTime::Kind::Normal, 0, 0, {}};
  for (const auto &[key, member] : {std::pair{"mean", &ExecutionTime::mean}, {"stddev", &ExecutionTime::stddev}}) {
    if (find(node, key) == nullptr) error(node, fmt::format("normal has no {}", key));
    take(node, key, model.*member, 0);
  }
  if (diagnostics_.size() > mistakes) return std::nullopt;
  return model;
}

std::optional<ExecutionTime> ValueReader::empirical_execution(const Node &node) {
  if (node.kind != Node::Kind::Sequence) return wrong_type(node, "empirical", "a list of durations");
  ExecutionTime model{ExecutionTime::Kind::Empirical, 0, 0, {}};
  for (const Node &item : node.children) {
    if (const auto sample = duration(item, "empirical")) model.samples.push_back(*sample);
  }
  if (model.samples.size() != node.children.size()) return std::nullopt;
  return model;
}

std::optional<Degrade> ValueReader::degrade(const Node &node) {
  if (node.is("stop")) return Degrade{};
  if (node.kind != Node::Kind::Map) {
    return unknown_choice(node, "degrade", {"stop", "{skip: N}", "{stretch: FACTOR}"});
  }
  check_map(node, "degrade", {"skip", "stretch"});
  const Node *skip = find(node, "skip");
  const Node *stretch = find(node, "stretch");
  if ((skip == nullptr) == (stretch == nullptr)) {
    error(node, "degrade must have either 'skip' or 'stretch'", "write {skip: 3} or {stretch: 2.5}");
  } else if (skip != nullptr) {
    const auto count = integer<std::uint32_t>(*skip, "skip", 1, kMaxDegrade);
    if (count) return Degrade{.kind = Degrade::Kind::Skip, .skip = *count};
  } else if (const auto factor = real(*stretch, "stretch")) {
    return Degrade{.kind = Degrade::Kind::Stretch, .stretch = *factor};
  }
  return std::nullopt;
}

}  // namespace redag::yaml
