#include "redag/analysis/fixed_point.hpp"

#include <algorithm>
#include <cstddef>

#include "redag/analysis/arithmetic.hpp"

namespace redag::analysis::global {
namespace {

// Rounds of all values; ordinary systems need about ten.
constexpr int kMaxRounds = 1000;
// Rounds after which a guess is given up if values still grow.
constexpr int kMaxRoundsOfGuess = 8;
constexpr Duration kFarthestGuess = Duration{1} << 40;  // times the growth seen

constexpr std::string_view kGaveUp = "gave up: no responses that agree were found in a thousand rounds";

class Agree {
 public:
  Agree(std::span<const Reliant> values, std::string_view exceeds, const std::function<bool(std::size_t)> &evaluate)
      : values_(values), exceeds_(exceeds), evaluate_(evaluate) {}

  std::string_view run() {
    std::vector<Duration> midway;
    for (int round = 0; round < kMaxRounds; ++round) {
      if (round == kMaxRounds / 2) midway = now();
      const Change change = evaluate_all();
      if (change == Change::Exceeds) return exceeds_;
      if (change == Change::None) return {};
    }
    return guess(midway, now());
  }

 private:
  enum class Change : std::uint8_t { None, Falls, Rises, Exceeds };

  // Each value from the newest of the others. If none rises, all agree from then on: those evaluated first relied on
  // values that have only fallen since.
  Change evaluate_all() {
    Change change = Change::None;
    for (std::size_t k = 0; k < values_.size(); ++k) {
      const Duration before = *values_[k].value;
      if (!evaluate_(k)) return Change::Exceeds;
      if (*values_[k].value > before) {
        change = Change::Rises;
      } else if (*values_[k].value < before && change == Change::None) {
        change = Change::Falls;
      }
    }
    return change;
  }

  // Farther and farther ahead in the direction in which they grew, until they fall: then down again. Any that agree
  // hold, and these are within twice the distance, or so, of the least.
  std::string_view guess(const std::vector<Duration> &before, const std::vector<Duration> &after) {
    for (Duration stretch = 1; stretch <= kFarthestGuess; stretch *= 2) {
      for (std::size_t k = 0; k < values_.size(); ++k) {
        const Duration ahead = multiply(after[k] - before[k], stretch);
        *values_[k].value = std::min(values_[k].limit, add(after[k], ahead));
      }
      Change change = Change::Rises;
      for (int round = 0; change == Change::Rises && round < kMaxRoundsOfGuess; ++round) change = evaluate_all();
      if (change == Change::Exceeds) return kGaveUp;
      if (change == Change::Rises) continue;
      for (int round = 0; change == Change::Falls && round < kMaxRounds; ++round) change = evaluate_all();
      return {};
    }
    return kGaveUp;
  }

  [[nodiscard]] std::vector<Duration> now() const {
    std::vector<Duration> result;
    result.reserve(values_.size());
    for (const Reliant &value : values_) result.push_back(*value.value);
    return result;
  }

  std::span<const Reliant> values_;
  std::string_view exceeds_;
  const std::function<bool(std::size_t)> &evaluate_;
};

}  // namespace

std::string_view agree(std::span<const Reliant> values, std::string_view exceeds,
                       const std::function<bool(std::size_t)> &evaluate) {
  return Agree(values, exceeds, evaluate).run();
}

Bound all_that_agree(const System &system, std::vector<GlobalUnit> &units, std::string_view exceeds,
                     const std::function<bool(std::size_t)> &respond,
                     const std::function<ResponseBound(std::size_t)> &explain) {
  std::vector<Reliant> values;
  values.reserve(units.size());
  for (GlobalUnit &unit : units) values.push_back({&unit.response, unit.limit});
  const std::string_view absent = agree(values, exceeds, respond);
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
