// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/report/curves.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "redag/base/rng.hpp"

namespace redag::report {
namespace {

metrics::DurationSketch sketch_of(const std::vector<Duration> &values, std::size_t exact) {
  metrics::DurationSketch sketch(exact);
  for (const Duration value : values) sketch.add(value);
  return sketch;
}

std::vector<CurvePoint> curve_of(const std::vector<Duration> &values) {
  return report::curve_of(sketch_of(values, values.size() + 1));
}

TEST(Curve, OfNothingIsEmpty) { EXPECT_TRUE(curve_of(std::vector<Duration>()).empty()); }

TEST(Curve, OfFewValuesHasThemAll) {
  const std::vector<CurvePoint> points = curve_of(std::vector<Duration>{3, 5, 5, 9});
  EXPECT_EQ(points, (std::vector<CurvePoint>{{3, 1}, {5, 3}, {9, 4}}));
}

TEST(Curve, EveryPointIsExact) {
  Rng rng(7);
  std::vector<Duration> values(20'000);
  for (Duration &value : values) value = static_cast<Duration>(rng() % 5000);
  std::sort(values.begin(), values.end());
  const std::vector<CurvePoint> points = curve_of(values);
  for (const CurvePoint &point : points) {
    const auto at_most = std::upper_bound(values.begin(), values.end(), point.value) - values.begin();
    ASSERT_EQ(point.count, static_cast<std::uint64_t>(at_most)) << point.value;
  }
  EXPECT_EQ(points.front().value, values.front());
  EXPECT_EQ(points.back().value, values.back());
  EXPECT_EQ(points.back().count, values.size());
}

TEST(Curve, OfAMillionValuesIsSmallAndKnowsItsTail) {
  std::vector<Duration> values(1'000'000);
  std::iota(values.begin(), values.end(), 1);
  const std::vector<CurvePoint> points = curve_of(values);
  EXPECT_LT(points.size(), 200U);
  const auto beyond = [&](double share) {
    return std::count_if(points.begin(), points.end(),
                         [&](const CurvePoint &p) { return static_cast<double>(p.value) > share * 1e6; });
  };
  EXPECT_GE(beyond(0.9), 85) << "about 20 for each power of ten";
  EXPECT_GE(beyond(0.999), 40);
  EXPECT_GE(beyond(0.99999), 8);
}

TEST(Curve, OfASketchHasTheEndsOfItsBuckets) {
  Rng rng(7);
  std::vector<Duration> values(5'000);
  for (Duration &value : values) value = static_cast<Duration>(rng() % 1'000'000);
  const std::vector<CurvePoint> points = report::curve_of(sketch_of(values, 16));
  std::sort(values.begin(), values.end());
  EXPECT_EQ(points.front(), (CurvePoint{values.front(), 1}));
  EXPECT_EQ(points.back(), (CurvePoint{values.back(), values.size()}));
  for (const CurvePoint &point : points) {
    const auto at_most = std::upper_bound(values.begin(), values.end(), point.value) - values.begin();
    ASSERT_EQ(point.count, static_cast<std::uint64_t>(at_most)) << point.value;
  }
}

}  // namespace
}  // namespace redag::report
