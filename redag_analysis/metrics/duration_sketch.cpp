// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/duration_sketch.hpp"

#include <algorithm>
#include <utility>

namespace redag::metrics {

void DurationSketch::add(Duration value) {
  if (!is_exact()) {
    count(value);
  } else if (values_.size() < most_exact_) {
    values_.push_back(value);
  } else {
    count_exact_values();
    count(value);
  }
}

void DurationSketch::merge(const DurationSketch &other) {
  if (is_exact() && other.is_exact()) {
    values_.insert(values_.end(), other.values_.begin(), other.values_.end());
    return;
  }
  count_exact_values();
  for (const Duration value : other.values_) count(value);
  for (const Page &page : other.pages_) {
    Page &own = page_of(page.first);
    for (std::size_t i = 0; i < kPageSize; ++i) own.counts[i] += page.counts[i];
  }
  if (other.is_exact()) return;
  count_ += other.count_;
  sum_ += other.sum_;
  min_ = std::min(min_, other.min_);
  max_ = std::max(max_, other.max_);
}

Distribution DurationSketch::distribution() const {
  if (is_exact()) return distribution_of(values_);
  Distribution result;
  result.count = count_;
  result.mean = static_cast<double>(sum_) / static_cast<double>(count_);
  result.min = min_;
  result.p50 = percentile(50);
  result.p90 = percentile(90);
  result.p95 = percentile(95);
  result.p99 = percentile(99);
  result.max = max_;
  result.percentile_error = kRelativeError;
  return result;
}

std::vector<CountedDurations> DurationSketch::counted() const {
  std::vector<CountedDurations> all;
  if (is_exact()) {
    std::vector<Duration> sorted = values_;
    std::sort(sorted.begin(), sorted.end());
    for (const Duration value : sorted) {
      if (all.empty() || all.back().high != value) all.push_back({value, value, 0});
      ++all.back().count;
    }
    return all;
  }
  for (const Page &page : pages_) {
    for (std::size_t i = 0; i < kPageSize; ++i) {
      if (page.counts[i] == 0) continue;
      all.push_back({static_cast<Duration>(Buckets::lowest_in(page.first + i)),
                     static_cast<Duration>(Buckets::highest_in(page.first + i)), page.counts[i]});
    }
  }
  // The extremes are known exactly.
  all.front().low = std::min(min_, all.front().high);
  all.back().high = max_;
  return all;
}

std::size_t DurationSketch::memory() const {
  return values_.capacity() * sizeof(Duration) + pages_.capacity() * sizeof(Page);
}

void DurationSketch::count(Duration value) {
  const std::size_t bucket = Buckets::bucket_of(static_cast<std::uint64_t>(std::max<Duration>(value, 0)));
  ++page_of(bucket).counts[bucket % kPageSize];
  ++count_;
  sum_ += value;
  min_ = std::min(min_, value);
  max_ = std::max(max_, value);
}

void DurationSketch::count_exact_values() {
  for (const Duration value : std::exchange(values_, {})) count(value);
}

DurationSketch::Page &DurationSketch::page_of(std::size_t bucket) {
  const std::size_t first = bucket - bucket % kPageSize;
  if (last_page_ < pages_.size() && pages_[last_page_].first == first) return pages_[last_page_];
  auto at = std::lower_bound(pages_.begin(), pages_.end(), first,
                             [](const Page &page, std::size_t wanted) { return page.first < wanted; });
  if (at == pages_.end() || at->first != first) at = pages_.insert(at, Page{first, {}});
  last_page_ = static_cast<std::size_t>(at - pages_.begin());
  return *at;
}

Duration DurationSketch::percentile(double percent) const {
  std::uint64_t left = nearest_rank(percent, count_);
  for (const Page &page : pages_) {
    for (std::size_t i = 0; i < kPageSize; ++i) {
      if (page.counts[i] < left) {
        left -= page.counts[i];
        continue;
      }
      const std::uint64_t low = Buckets::lowest_in(page.first + i);
      const std::uint64_t middle = low + (Buckets::highest_in(page.first + i) - low) / 2;
      return std::clamp(static_cast<Duration>(middle), std::max<Duration>(min_, 0), std::max<Duration>(max_, 0));
    }
  }
  return max_;
}

}  // namespace redag::metrics
