// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The hall of bench_nav2: the lidar's rays and the map tell the same, and there is room to drive.
#include "../benchmarks/nav2_world.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace redag_rclcpp::lab::hall {
namespace {

constexpr double kPi = 3.14159265358979;

/// The map's cell at `point`, which is in the hall.
std::int8_t cell_at(const std::vector<std::int8_t> &map, Point point) {
  const auto columns = static_cast<std::size_t>(std::lround(kWidth / kResolution));
  return map.at(static_cast<std::size_t>(point.y / kResolution) * columns +
                static_cast<std::size_t>(point.x / kResolution));
}

TEST(Hall, RaysEndWhereTheMapHasAnObstacle) {
  const std::vector<std::int8_t> map = draw_map();
  int rays = 0;
  for (const Point &place : kPlaces) {
    for (double angle = -kPi; angle < kPi; angle += 0.1) {
      const auto at = [&](double distance) {
        return Point{place.x + distance * std::cos(angle), place.y + distance * std::sin(angle)};
      };
      const double distance = cast_ray(place, angle, 100);
      ASSERT_TRUE(std::isfinite(distance)) << place.x << ", " << place.y << ": " << angle;
      for (double d = 0; d < distance - 2 * kResolution; d += kResolution / 2) {
        ASSERT_EQ(cell_at(map, at(d)), 0) << place.x << ", " << place.y << ": " << angle << " at " << d;
      }
      // A ray that only grazes a corner may meet no cell.
      if (cast_ray(place, angle + 0.01, 100) - distance > 1 || cast_ray(place, angle - 0.01, 100) - distance > 1)
        continue;
      EXPECT_EQ(cell_at(map, at(distance + kResolution)), 100) << place.x << ", " << place.y << ": " << angle;
      ++rays;
    }
  }
  EXPECT_GT(rays, 300);
}

TEST(Hall, DistancesAreExact) {
  EXPECT_DOUBLE_EQ(cast_ray({12, 8}, 0, 12), 2.5);              // the left side of a shelf
  EXPECT_DOUBLE_EQ(cast_ray({12, 8}, kPi, 12), 2.5);            // the right side of the other one
  EXPECT_DOUBLE_EQ(cast_ray({3, 3}, -kPi / 2, 12), 3 - 0.2);    // a wall
  EXPECT_NEAR(cast_ray({12, 8}, kPi / 2, 12), 13.7 - 8, 1e-9);  // a pillar
}

TEST(Hall, FartherThanTheLimitIsInfinite) {
  EXPECT_DOUBLE_EQ(cast_ray({12, 8}, 0, 2.5), 2.5);
  EXPECT_TRUE(std::isinf(cast_ray({12, 8}, 0, 2.4)));
}

TEST(Hall, PlacesAndTheStartHaveRoom) {
  std::vector<Point> places(kPlaces.begin(), kPlaces.end());
  places.push_back({kStart.x, kStart.y});
  for (const Point &place : places) {
    for (double angle = -kPi; angle < kPi; angle += 0.05) {
      EXPECT_GT(cast_ray(place, angle, 100), 1) << place.x << ", " << place.y;
    }
  }
}

}  // namespace
}  // namespace redag_rclcpp::lab::hall
