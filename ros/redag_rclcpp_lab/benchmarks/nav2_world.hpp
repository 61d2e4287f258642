// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The hall in which bench_nav2's robot drives: walls and shelves as rectangles, and the places to drive to.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

namespace redag_rclcpp::lab::hall {

inline constexpr double kWidth = 24;         // m; its corner is the origin of the frame "map"
inline constexpr double kHeight = 16;        // m
inline constexpr double kResolution = 0.05;  // m, of the map

struct Point {
  double x;
  double y;
};

struct Pose {
  double x;
  double y;
  double yaw;
};

struct Rectangle {
  Point low;
  Point high;
};

inline constexpr std::array<Rectangle, 8> kObstacles = {{{{0, 0}, {kWidth, 0.2}},
                                                         {{0, kHeight - 0.2}, {kWidth, kHeight}},
                                                         {{0, 0}, {0.2, kHeight}},
                                                         {{kWidth - 0.2, 0}, {kWidth, kHeight}},
                                                         {{5.5, 5}, {9.5, 11}},
                                                         {{14.5, 5}, {18.5, 11}},
                                                         {{11.7, 1.7}, {12.3, 2.3}},
                                                         {{11.7, 13.7}, {12.3, 14.3}}}};

/// The robot drives round these places, one after another, and begins in front of the first one.
inline constexpr std::array<Point, 6> kPlaces = {{{12, 8}, {21, 13}, {21, 3}, {12, 8}, {3, 3}, {3, 13}}};
inline constexpr Pose kStart = {3, 13, -0.5};

/// The distance from `from` to the nearest obstacle in the direction `angle`, or infinity beyond `limit`.
inline double cast_ray(Point from, double angle, double limit) {
  const double dx = std::cos(angle);
  const double dy = std::sin(angle);
  // The part of the ray, in metres, that is between two parallel lines.
  const auto between = [](double origin, double slope, double low, double high) {
    if (std::abs(slope) < 1e-12) {
      constexpr double kFar = std::numeric_limits<double>::infinity();
      return low <= origin && origin <= high ? std::pair(-kFar, kFar) : std::pair(kFar, -kFar);
    }
    return std::minmax({(low - origin) / slope, (high - origin) / slope});
  };
  double nearest = std::numeric_limits<double>::infinity();
  for (const Rectangle &obstacle : kObstacles) {
    const auto [x_enters, x_leaves] = between(from.x, dx, obstacle.low.x, obstacle.high.x);
    const auto [y_enters, y_leaves] = between(from.y, dy, obstacle.low.y, obstacle.high.y);
    const double enters = std::max(x_enters, y_enters);
    if (enters >= 0 && enters <= std::min(x_leaves, y_leaves)) nearest = std::min(nearest, enters);
  }
  return nearest <= limit ? nearest : std::numeric_limits<double>::infinity();
}

/// The hall as the cells of a nav_msgs/OccupancyGrid, row by row from the origin: 100 where an obstacle is, else 0.
inline std::vector<std::int8_t> draw_map() {
  const auto columns = static_cast<std::size_t>(std::lround(kWidth / kResolution));
  const auto rows = static_cast<std::size_t>(std::lround(kHeight / kResolution));
  std::vector<std::int8_t> cells(columns * rows, 0);
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const Point centre{(static_cast<double>(i % columns) + 0.5) * kResolution,
                       (static_cast<double>(i / columns) + 0.5) * kResolution};
    for (const Rectangle &obstacle : kObstacles) {
      if (centre.x > obstacle.low.x && centre.x < obstacle.high.x && centre.y > obstacle.low.y &&
          centre.y < obstacle.high.y) {
        cells[i] = 100;
      }
    }
  }
  return cells;
}

}  // namespace redag_rclcpp::lab::hall
