#include "redag/analysis/fixed_point.hpp"

#include <cstddef>

namespace redag::analysis::global {
namespace {

constexpr int kMaxRounds = 1000;  // of all values; ordinary systems need about ten

}  // namespace

std::string_view agree(std::span<Duration *const> values, std::string_view exceeds,
                       const std::function<bool(std::size_t)> &evaluate) {
  bool changed = true;
  for (int round = 0; changed; ++round) {
    if (round == kMaxRounds) return "gave up: the responses did not agree in a thousand rounds";
    changed = false;
    for (std::size_t k = 0; k < values.size(); ++k) {
      const Duration before = *values[k];
      if (!evaluate(k)) return exceeds;
      changed = changed || *values[k] != before;
    }
  }
  return {};
}

Bound all_that_agree(const System &system, std::vector<GlobalUnit> &units, std::string_view exceeds,
                     const std::function<bool(std::size_t)> &respond,
                     const std::function<ResponseBound(std::size_t)> &explain) {
  std::vector<Duration *> values;
  values.reserve(units.size());
  for (GlobalUnit &unit : units) values.push_back(&unit.response);
  const std::string_view absent =
      is_any_hopeless(units, system.platform.workers) ? exceeds : agree(values, exceeds, respond);
  std::vector<ResponseBound> responses(system.units.size());
  for (std::size_t k = 0; k < units.size(); ++k) {
    ResponseBound &response = responses[units[k].unit];
    if (absent.empty()) {
      response = explain(k);
    } else {
      response.absent = absent;
    }
  }
  return from_units(system, std::move(responses));
}

}  // namespace redag::analysis::global
