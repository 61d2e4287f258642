// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/effects.hpp"

#include <algorithm>
#include <numeric>

#include "redag/base/check.hpp"

namespace redag::experiment {
namespace {

double mean_of(const std::vector<double> &values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

// Returns for each group of cells (by `group_of`) the mean of the cells' means.
template <class GroupOf>
std::vector<double> group_means(std::size_t groups, const std::vector<EffectCell> &cells,
                                const std::vector<double> &means, GroupOf group_of) {
  std::vector<double> sum(groups, 0);
  std::vector<double> count(groups, 0);
  for (std::size_t c = 0; c < cells.size(); ++c) {
    const std::size_t group = group_of(cells[c]);
    sum[group] += means[c];
    count[group] += 1;
  }
  for (std::size_t g = 0; g < groups; ++g) sum[g] /= count[g];
  return sum;
}

}  // namespace

Effects effects_of(const std::vector<std::uint32_t> &counts, const std::vector<EffectCell> &cells) {
  const std::size_t expected = std::accumulate(counts.begin(), counts.end(), std::size_t{1},
                                               [](std::size_t a, std::uint32_t b) { return a * b; });
  REDAG_CHECK(cells.size() == expected, "a full factorial has every combination once");
  const std::size_t runs = cells.front().results.size();
  std::vector<double> means;
  for (const EffectCell &cell : cells) {
    REDAG_CHECK(!cell.results.empty() && cell.results.size() == runs, "all combinations ran equally often");
    means.push_back(mean_of(cell.results));
  }

  Effects effects;
  effects.mean = mean_of(means);
  const auto all = static_cast<double>(cells.size());
  double total = 0;  // sums of squares over all runs
  double noise = 0;
  double between = 0;
  for (std::size_t c = 0; c < cells.size(); ++c) {
    for (const double result : cells[c].results) {
      total += (result - effects.mean) * (result - effects.mean) / static_cast<double>(runs);
      noise += (result - means[c]) * (result - means[c]) / static_cast<double>(runs);
    }
    between += (means[c] - effects.mean) * (means[c] - effects.mean);
  }
  effects.variance = total / all;
  const auto share = [total](double part) { return total > 0 ? std::max(0.0, part / total) : 0.0; };

  std::vector<double> main_parts;
  for (std::size_t f = 0; f < counts.size(); ++f) {
    effects.levels.push_back(
        group_means(counts[f], cells, means, [f](const EffectCell &cell) { return cell.level[f]; }));
    double part = 0;
    for (const double level : effects.levels[f]) part += (level - effects.mean) * (level - effects.mean);
    main_parts.push_back(part * all / counts[f]);
    effects.terms.push_back({{f}, share(main_parts.back())});
  }
  double explained = std::accumulate(main_parts.begin(), main_parts.end(), 0.0);
  for (std::size_t a = 0; a < counts.size(); ++a) {
    for (std::size_t b = a + 1; b < counts.size(); ++b) {
      const std::size_t groups = std::size_t{counts[a]} * counts[b];
      const std::vector<double> pair = group_means(groups, cells, means, [&](const EffectCell &cell) {
        return std::size_t{cell.level[a]} * counts[b] + cell.level[b];
      });
      double part = 0;
      for (const double mean : pair) part += (mean - effects.mean) * (mean - effects.mean);
      const double alone = part * all / static_cast<double>(groups) - main_parts[a] - main_parts[b];
      explained += alone;
      effects.terms.push_back({{a, b}, share(alone)});
    }
  }
  effects.higher = share(between - explained);
  effects.noise = share(noise);
  return effects;
}

}  // namespace redag::experiment
