// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/run/block_bootstrap.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "redag/base/rng.hpp"
#include "redag_analysis/metrics/distribution.hpp"

namespace redag::lab {
namespace {

constexpr std::array<double, 3> kPercents = {50, 95, 99};
constexpr std::size_t kGrid = 2048;

std::vector<Duration> pooled(const BlockedRuns &runs) {
  std::vector<Duration> all;
  for (const std::vector<Block> &run : runs) {
    for (const Block &block : run) all.insert(all.end(), block.responses.begin(), block.responses.end());
  }
  return all;
}

std::size_t block_count(const BlockedRuns &runs) {
  std::size_t count = 0;
  for (const std::vector<Block> &run : runs) count += run.size();
  return count;
}

// Returns the values at which the distributions are compared. These are all values if there are few; otherwise ranks of
// both sides pooled, half of them in the upper tenth.
std::vector<Duration> grid_of(std::vector<Duration> values) {
  std::sort(values.begin(), values.end());
  std::vector<Duration> distinct = values;
  distinct.erase(std::unique(distinct.begin(), distinct.end()), distinct.end());
  if (distinct.size() <= kGrid) return distinct;
  std::vector<Duration> grid;
  const auto at = [&](double share) {
    return values[std::min(values.size() - 1, static_cast<std::size_t>(share * static_cast<double>(values.size())))];
  };
  for (std::size_t i = 0; i < kGrid / 2; ++i) {
    const double share = (static_cast<double>(i) + 0.5) / (kGrid / 2.0);
    grid.push_back(at(0.9 * share));
    grid.push_back(at(0.9 + 0.1 * share));
  }
  grid.push_back(values.back());
  std::sort(grid.begin(), grid.end());
  grid.erase(std::unique(grid.begin(), grid.end()), grid.end());
  return grid;
}

// One side, counted once. A replicate then only adds counts, and only those that a binary search visits.
class Side {
 public:
  Side(const BlockedRuns &runs, const std::vector<Duration> &grid) : grid_(grid) {
    for (const std::vector<Block> &run : runs) {
      std::vector<Counted> counted;
      counted.reserve(run.size());
      for (const Block &block : run) counted.push_back(count(block));
      if (!counted.empty()) runs_.push_back(std::move(counted));
    }
  }

  struct Drawn {
    double miss_ratio = 0;
    std::array<double, 3> percentiles{};
  };

  Drawn draw(Rng &rng) {
    drawn_.clear();
    std::uint64_t released = 0;
    std::uint64_t missed = 0;
    std::uint64_t finished = 0;
    const auto pick = [&rng](const auto &from) -> const auto & {
      return from[static_cast<std::size_t>(rng.uniform(0, static_cast<std::int64_t>(from.size()) - 1))];
    };
    // Draws one fewer than there are. Drawing as many would make the spread too small, by half where there are two
    // runs.
    for (std::size_t r = 0; r < std::max<std::size_t>(1, runs_.size() - 1); ++r) {
      const std::vector<Counted> &run = pick(runs_);
      for (std::size_t i = 0; i < std::max<std::size_t>(1, run.size() - 1); ++i) {
        const Counted &block = pick(run);
        released += block.released;
        missed += block.missed;
        finished += block.finished;
        drawn_.push_back(&block);
      }
    }
    Drawn drawn;
    drawn.miss_ratio = released == 0 ? 0 : static_cast<double>(missed) / static_cast<double>(released);
    read_percentiles(finished, drawn.percentiles);
    return drawn;
  }

 private:
  struct Counted {
    std::uint64_t released = 0;
    std::uint64_t missed = 0;
    std::uint64_t finished = 0;
    std::vector<std::uint32_t> up_to;  // the number of responses of at most grid[i]
  };

  Counted count(const Block &block) const {
    Counted counted{block.released, block.missed, block.responses.size(), std::vector<std::uint32_t>(grid_.size())};
    for (const Duration response : block.responses) {
      ++counted.up_to[static_cast<std::size_t>(std::lower_bound(grid_.begin(), grid_.end(), response) - grid_.begin())];
    }
    std::partial_sum(counted.up_to.begin(), counted.up_to.end(), counted.up_to.begin());
    return counted;
  }

  void read_percentiles(std::uint64_t finished, std::array<double, 3> &percentiles) const {
    if (finished == 0) return;
    for (std::size_t p = 0; p < kPercents.size(); ++p) {
      const double rank = std::max(1.0, std::ceil(kPercents[p] / 100 * static_cast<double>(finished)));
      std::size_t low = 0;
      std::size_t high = grid_.size() - 1;  // every response is at most the last value
      while (low < high) {
        const std::size_t middle = (low + high) / 2;
        std::uint64_t count = 0;
        for (const Counted *block : drawn_) count += block->up_to[middle];
        if (static_cast<double>(count) >= rank) {
          high = middle;
        } else {
          low = middle + 1;
        }
      }
      percentiles[p] = static_cast<double>(grid_[low]);
    }
  }

  const std::vector<Duration> &grid_;
  std::vector<std::vector<Counted>> runs_;
  std::vector<const Counted *> drawn_;
};

// Collects the replicates of one figure.
class Replicates {
 public:
  Replicates(double tolerance, std::uint32_t expected) : tolerance_(tolerance) { differences_.reserve(expected); }

  void add(double a, double b) {
    differences_.push_back(b - a);
    if (b <= a * (1 + tolerance_)) ++not_more_;
    if (b >= a * (1 - tolerance_)) ++not_less_;
  }

  void fill(FigureDifference &figure) {
    std::sort(differences_.begin(), differences_.end());
    const auto n = static_cast<double>(differences_.size());
    figure.low = differences_[static_cast<std::size_t>(0.025 * n)];
    figure.high = differences_[std::min(differences_.size() - 1, static_cast<std::size_t>(0.975 * n))];
    figure.p_more = (static_cast<double>(not_more_) + 1) / (n + 1);
    figure.p_less = (static_cast<double>(not_less_) + 1) / (n + 1);
    figure.tested = true;
  }

 private:
  double tolerance_;
  std::vector<double> differences_;
  std::uint64_t not_more_ = 0;
  std::uint64_t not_less_ = 0;
};

double miss_ratio(const BlockedRuns &runs) {
  std::uint64_t released = 0;
  std::uint64_t missed = 0;
  for (const std::vector<Block> &run : runs) {
    for (const Block &block : run) {
      released += block.released;
      missed += block.missed;
    }
  }
  return released == 0 ? 0 : static_cast<double>(missed) / static_cast<double>(released);
}

// Lag-1 correlation of a value of the blocks, over all runs; each run varies around its own mean.
template <class Value>
double correlation(const BlockedRuns &runs, Value value) {
  double products = 0;
  double squares = 0;
  double scale = 0;
  for (const std::vector<Block> &run : runs) {
    if (run.size() < 3) continue;
    std::vector<double> values;
    double mean = 0;
    for (const Block &block : run) {
      values.push_back(value(block));
      mean += values.back() / static_cast<double>(run.size());
    }
    for (std::size_t i = 0; i < values.size(); ++i) {
      scale += values[i] * values[i];
      squares += (values[i] - mean) * (values[i] - mean);
      if (i > 0) products += (values[i] - mean) * (values[i - 1] - mean);
    }
  }
  // A value that does not vary leaves only rounding errors.
  return squares > 1e-18 * scale ? products / squares : 0;
}

double block_correlation(const BlockedRuns &runs) {
  const double misses = correlation(runs, [](const Block &block) {
    return block.released == 0 ? 0.0 : static_cast<double>(block.missed) / static_cast<double>(block.released);
  });
  const double responses = correlation(runs, [](const Block &block) {
    double sum = 0;
    for (const Duration response : block.responses) sum += static_cast<double>(response);
    return block.responses.empty() ? 0.0 : sum / static_cast<double>(block.responses.size());
  });
  return std::max(misses, responses);
}

}  // namespace

RowDifference compare_blocks(const BlockedRuns &a, const BlockedRuns &b, const BootstrapOptions &options) {
  RowDifference row;
  const std::array<FigureDifference *, 3> figures = {&row.p50, &row.p95, &row.p99};
  std::vector<Duration> responses_a = pooled(a);
  std::vector<Duration> responses_b = pooled(b);
  std::sort(responses_a.begin(), responses_a.end());
  std::sort(responses_b.begin(), responses_b.end());
  row.miss_ratio.a = miss_ratio(a);
  row.miss_ratio.b = miss_ratio(b);
  const auto fewest = static_cast<double>(std::min(responses_a.size(), responses_b.size()));
  std::array<bool, 3> enough{};
  for (std::size_t p = 0; p < kPercents.size(); ++p) {
    if (!responses_a.empty()) figures[p]->a = static_cast<double>(metrics::percentile(responses_a, kPercents[p]));
    if (!responses_b.empty()) figures[p]->b = static_cast<double>(metrics::percentile(responses_b, kPercents[p]));
    enough[p] = fewest * (1 - kPercents[p] / 100) >= kFewestJobsBeyond;
  }
  const std::size_t blocks_a = block_count(a);
  const std::size_t blocks_b = block_count(b);
  if (std::min(blocks_a, blocks_b) < kFewestBlocks || options.replicates == 0) return row;

  row.block_correlation = std::max(block_correlation(a), block_correlation(b));
  row.correlation_limit = 3 / std::sqrt(static_cast<double>(std::min(blocks_a, blocks_b)));
  responses_a.insert(responses_a.end(), responses_b.begin(), responses_b.end());
  const std::vector<Duration> grid = grid_of(std::move(responses_a));
  Side side_a(a, grid);
  Side side_b(b, grid);
  Replicates misses(0, options.replicates);
  std::vector<Replicates> percentiles(kPercents.size(), Replicates(options.tolerance, options.replicates));
  Rng rng(options.seed);
  for (std::uint32_t i = 0; i < options.replicates; ++i) {
    const Side::Drawn drawn_a = side_a.draw(rng);
    const Side::Drawn drawn_b = side_b.draw(rng);
    misses.add(drawn_a.miss_ratio, drawn_b.miss_ratio);
    for (std::size_t p = 0; p < kPercents.size(); ++p) {
      percentiles[p].add(drawn_a.percentiles[p], drawn_b.percentiles[p]);
    }
  }
  misses.fill(row.miss_ratio);
  for (std::size_t p = 0; p < kPercents.size(); ++p) {
    if (enough[p]) percentiles[p].fill(*figures[p]);
  }
  return row;
}

double discovery_threshold(std::vector<double> p_values, double rate) {
  std::sort(p_values.begin(), p_values.end());
  const auto n = static_cast<double>(p_values.size());
  for (std::size_t k = p_values.size(); k > 0; --k) {
    if (p_values[k - 1] <= rate * static_cast<double>(k) / n) return p_values[k - 1];
  }
  return 0;
}

}  // namespace redag::lab
