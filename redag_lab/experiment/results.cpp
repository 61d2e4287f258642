// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/results.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "redag/base/check.hpp"
#include "redag/loader/provenance.hpp"

namespace redag::experiment {
namespace {

using Json = nlohmann::ordered_json;

std::string number(double value, std::string_view figure) {
  return figure.ends_with("_ns") ? fmt::format("{:.0f}", value) : fmt::format("{:.6g}", value);
}

Json row_json(const Results &results, const ResultRow &row) {
  Json at = Json::object();
  for (std::size_t f = 0; f < results.factors.size(); ++f) {
    if (row.point[f] != kNoLevel) at[results.factors[f].name] = results.factors[f].levels[row.point[f]];
  }
  Json values = Json::array();
  double confidence = 0;
  for (std::size_t i = 0; i < row.figures.size(); ++i) {
    const std::optional<Interval> &figure = row.figures[i];
    values.push_back(nullptr);
    if (!figure) continue;
    confidence = figure->confidence;
    values.back() = Json::array();
    for (const double value : {figure->value, figure->low, figure->high}) {
      values.back().push_back(Json::parse(number(value, results.figures[i])));
    }
  }
  return Json{{"at", std::move(at)},
              {"labels", row.labels},
              {"counts", row.counts},
              {"confidence", confidence},
              {"values", std::move(values)}};
}

}  // namespace

Interval median_of(std::vector<double> values) {
  REDAG_CHECK(!values.empty(), "a median needs values");
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  // The true median is outside the k-th values from either end with probability 2 P(B(n, 1/2) < k).
  constexpr double kMostOutside = 0.05;
  // P(B = k) is mantissa * 2^exponent, step by step: 0.5^n alone is 0 for more than 1,074 values.
  double mantissa = 1;
  int exponent = -static_cast<int>(n);
  double below = std::ldexp(mantissa, exponent);
  std::size_t k = 1;
  double outside = 2 * below;
  while (k < n / 2) {
    int shift = 0;
    mantissa = std::frexp(mantissa * (static_cast<double>(n - k + 1) / static_cast<double>(k)), &shift);
    exponent += shift;
    const double term = std::ldexp(mantissa, exponent);
    if (2 * (below + term) > kMostOutside) break;
    below += term;
    outside = 2 * below;
    ++k;
  }
  const double middle = n % 2 == 1 ? values[n / 2] : (values[n / 2 - 1] + values[n / 2]) / 2;
  return {middle, values[k - 1], values[n - k], std::max(0.0, 1 - outside)};
}

Interval proportion(std::uint64_t hits, std::uint64_t trials) {
  REDAG_CHECK(trials > 0 && hits <= trials, "a share of no trials");
  constexpr double kZ = 1.959963984540054;  // the 97.5 % quantile of the normal distribution
  const auto n = static_cast<double>(trials);
  const double p = static_cast<double>(hits) / n;
  const double scale = 1 + kZ * kZ / n;
  const double centre = (p + kZ * kZ / (2 * n)) / scale;
  const double half = kZ / scale * std::sqrt(p * (1 - p) / n + kZ * kZ / (4 * n * n));
  return {p, hits == 0 ? 0 : std::max(0.0, centre - half), hits == trials ? 1 : std::min(1.0, centre + half), 0.95};
}

bool Results::all_good() const {
  return std::all_of(remarks.begin(), remarks.end(), [](const Remark &remark) { return remark.good; });
}

std::string to_csv(const Results &results) {
  std::string text;
  const auto cell = [&text](std::string_view words) { text += fmt::format("{},", words); };
  for (const Factor &factor : results.factors) cell(factor.name);
  for (const std::string &label : results.labels) cell(label);
  for (const std::string &count : results.counts) cell(count);
  for (const std::string &figure : results.figures) text += fmt::format("{0},{0}_low,{0}_high,", figure);
  text += "confidence\n";
  for (const ResultRow &row : results.rows) {
    for (std::size_t f = 0; f < results.factors.size(); ++f) {
      cell(row.point[f] == kNoLevel ? std::string() : results.factors[f].levels[row.point[f]]);
    }
    for (const std::string &label : row.labels) cell(label);
    for (const std::uint64_t count : row.counts) cell(fmt::format("{}", count));
    std::string confidence;
    for (std::size_t i = 0; i < row.figures.size(); ++i) {
      const std::optional<Interval> &figure = row.figures[i];
      if (figure) confidence = fmt::format("{:.4g}", figure->confidence);
      for (const auto part : {&Interval::value, &Interval::low, &Interval::high}) {
        cell(figure ? number(*figure.*part, results.figures[i]) : std::string());
      }
    }
    text += confidence + "\n";
  }
  return text;
}

std::string to_json(const Results &results, std::string_view plan) {
  Json document = {
      {"format", "redag.experiment/1"}, {"provenance", Json::parse(provenance_to_json(current_provenance()))},
      {"name", results.name},           {"plan", plan},
      {"units_are", results.units_are}, {"units", results.units},
      {"done", results.done},           {"complete", results.done == results.units},
      {"remarks", Json::array()},       {"factors", Json::array()},
      {"labels", results.labels},       {"counts", results.counts},
      {"figures", results.figures},     {"rows", Json::array()}};
  for (const Remark &remark : results.remarks) {
    document["remarks"].push_back({{"good", remark.good}, {"text", remark.text}});
  }
  for (const Factor &factor : results.factors) {
    if (factor.levels.empty()) continue;
    document["factors"].push_back({{"name", factor.name}, {"numeric", factor.numeric}, {"levels", factor.levels}});
  }
  for (const ResultRow &row : results.rows) document["rows"].push_back(row_json(results, row));
  return document.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace redag::experiment
