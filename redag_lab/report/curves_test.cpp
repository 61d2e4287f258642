// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/report/curves.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "redag/base/rng.hpp"

namespace redag::report {
namespace {

TEST(Curve, OfNothingIsEmpty) { EXPECT_TRUE(curve_of({}).empty()); }

TEST(Curve, OfFewValuesHasThemAll) {
  const std::vector<CurvePoint> points = curve_of({3, 5, 5, 9});
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

TEST(Curve, OfASketchIsThatOfItsValues) {
  Rng rng(7);
  std::vector<Duration> values(5'000);
  metrics::DurationSketch exact(values.size());
  metrics::DurationSketch counted(16);
  for (Duration &value : values) {
    value = static_cast<Duration>(rng() % 1'000'000);
    exact.add(value);
    counted.add(value);
  }
  std::sort(values.begin(), values.end());
  EXPECT_EQ(curve_of(exact), curve_of(values));
  const std::vector<CurvePoint> points = curve_of(counted);
  EXPECT_EQ(points.front(), (CurvePoint{values.front(), 1}));
  EXPECT_EQ(points.back(), (CurvePoint{values.back(), values.size()}));
  for (const CurvePoint &point : points) {
    const auto at_most = std::upper_bound(values.begin(), values.end(), point.value) - values.begin();
    ASSERT_EQ(point.count, static_cast<std::uint64_t>(at_most)) << point.value;
  }
}

TEST(Lateness, ClassesAreAnchoredAtReleaseAndDeadline) {
  constexpr std::size_t kHalf = LatenessHistogram::kClasses / 2;
  const auto class_of = [](Duration lateness) {
    LatenessHistogram histogram;
    histogram.add(lateness, 4000);
    return static_cast<std::size_t>(std::find(histogram.counts.begin(), histogram.counts.end(), 1U) -
                                    histogram.counts.begin());
  };
  EXPECT_EQ(class_of(-4000), 0U) << "at the release";
  EXPECT_EQ(class_of(-5000), 0U) << "before it: a clock that was corrected";
  EXPECT_EQ(class_of(0), kHalf - 1) << "at the deadline is not late";
  EXPECT_EQ(class_of(1), kHalf) << "a nanosecond beyond is";
  EXPECT_EQ(class_of(4000), LatenessHistogram::kClasses - 1);
  EXPECT_EQ(class_of(4001), LatenessHistogram::kClasses) << "more than a deadline late";
  EXPECT_EQ(class_of(kMaxDuration), LatenessHistogram::kClasses);
}

}  // namespace
}  // namespace redag::report
