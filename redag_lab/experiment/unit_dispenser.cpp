// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/unit_dispenser.hpp"

#include <algorithm>
#include <optional>
#include <utility>

namespace redag::experiment {
namespace {

constexpr std::uint64_t kMostGrowth = 8;        // from one batch to the next: the first units can be the fastest
constexpr std::uint64_t kLargestBatch = 65536;  // units

}  // namespace

UnitDispenser::UnitDispenser(NextUnit next, std::uint64_t count, std::uint32_t ranks, std::uint32_t jobs, Accept accept)
    : next_(std::move(next)),
      count_(count),
      ranks_(std::max(1U, ranks)),
      jobs_(std::max(1U, jobs)),
      accept_(std::move(accept)) {}

std::vector<std::uint64_t> UnitDispenser::take(std::uint32_t rank, Time now) {
  Batch &batch = batches_[rank];
  if (batch.units > 0) {
    const auto took = static_cast<double>(std::max<Duration>(now - batch.begin, 1));
    const double fitting = static_cast<double>(batch.units) * kBatchTime / took;
    batch.size = std::min({static_cast<std::uint64_t>(fitting), batch.units * kMostGrowth, kLargestBatch});
  }
  const std::uint64_t share = (count_ - handed_out_) / (std::uint64_t{2} * ranks_);
  const std::uint64_t size = std::max<std::uint64_t>(std::min(batch.size, share), jobs_);
  std::vector<std::uint64_t> units;
  while (units.size() < size && handed_out_ < count_) {
    const std::optional<std::uint64_t> unit = next_();
    if (!unit) break;
    ++handed_out_;
    open_[*unit] = rank;
    order_.push_back(*unit);
    units.push_back(*unit);
  }
  if (units.empty()) units = again(rank, std::max<std::uint64_t>(jobs_, open_.size() / (std::uint64_t{2} * ranks_)));
  batch.begin = now;
  batch.units = units.size();
  return units;
}

// Gives the units that were handed out longest ago. They go to the end of the line: the next rank gets others.
std::vector<std::uint64_t> UnitDispenser::again(std::uint32_t rank, std::uint64_t size) {
  std::vector<std::uint64_t> units;
  for (std::size_t left = order_.size(); left > 0 && units.size() < size; --left) {
    const std::uint64_t unit = order_.front();
    order_.pop_front();
    const auto at = open_.find(unit);
    if (at == open_.end()) continue;  // it is finished
    order_.push_back(unit);
    if (at->second == rank) continue;
    at->second = rank;
    units.push_back(unit);
  }
  repeated_ += units.size();
  return units;
}

Result<void> UnitDispenser::finish(std::uint64_t unit, const std::string &result) {
  if (open_.erase(unit) == 0) return {};
  while (!order_.empty() && !open_.contains(order_.front())) order_.pop_front();
  ++done_;
  return accept_(unit, result);
}

}  // namespace redag::experiment
