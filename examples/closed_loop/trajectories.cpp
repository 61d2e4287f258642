// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numbers>
#include <string_view>

#include "pictures.hpp"

namespace closed_loop {
namespace {

// Sizes are in pixels. The colours are those of the plots of redag_lab/experiment, distinct with any colour vision.
constexpr double kWidth = 960;
constexpr double kPanel = 104;
constexpr double kLeft = 150;
constexpr double kRight = 16;
constexpr double kHead = 86;
constexpr double kDegrees = 48;  // half of the axis; 45 degrees count as a fall
constexpr std::array<std::string_view, 6> kColours = {"#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#000000"};

double seconds(Time time) { return static_cast<double>(time) / redag::kSecond; }

}  // namespace

std::string trajectories_svg(const std::vector<Recorded> &runs, const std::string &title, const std::string &subtitle) {
  std::string svg;
  const auto put = [&svg]<class... A>(fmt::format_string<A...> format, A &&...arguments) {
    fmt::format_to(std::back_inserter(svg), format, std::forward<A>(arguments)...);
  };
  const std::size_t plants = runs.front().plants.size();
  const double height = kHead + static_cast<double>(plants) * kPanel + 44;
  double end = 0;
  for (const Recorded &run : runs) {
    for (const PlantResult &plant : run.plants) {
      if (!plant.snapshots.empty()) end = std::max(end, seconds(plant.snapshots.back().time));
    }
  }
  const auto x = [&](double time) { return kLeft + time / end * (kWidth - kLeft - kRight); };
  put("<svg xmlns='http://www.w3.org/2000/svg' width='{0:.0f}' height='{1:.0f}' viewBox='0 0 {0:.0f} {1:.0f}' "
      "font-family='Helvetica, Arial, \"Liberation Sans\", sans-serif' font-size='13'>\n"
      "<rect width='100%' height='100%' fill='#fff'/>\n"
      "<text x='16' y='26' font-size='17' font-weight='bold'>{2}</text>\n<text x='16' y='46' fill='#555'>{3}</text>\n",
      kWidth, height, title, subtitle);
  for (std::size_t r = 0; r < runs.size(); ++r) {
    const double at = 16 + 150 * static_cast<double>(r);
    put("<path d='M{:.0f} 66h26' stroke='{}' stroke-width='2.5'/><text x='{:.0f}' y='70.5'>{}</text>\n", at,
        kColours[r % kColours.size()], at + 33, runs[r].executor);
  }
  for (std::size_t p = 0; p < plants; ++p) {
    const double top = kHead + static_cast<double>(p) * kPanel;
    const double middle = top + kPanel / 2;
    const auto y = [&](double degrees) {
      return middle - std::clamp(degrees, -kDegrees, kDegrees) / kDegrees * (kPanel / 2 - 8);
    };
    put("<text x='16' y='{:.1f}' font-weight='bold'>{}</text>\n", top + 20, runs.front().plants[p].plant);
    for (std::size_t r = 0; r < runs.size(); ++r) {
      const std::uint32_t falls = runs[r].plants[p].falls;
      put("<text x='16' y='{:.1f}' fill='{}' font-size='12'>{} fall{}</text>\n", top + 37 + 15 * static_cast<double>(r),
          kColours[r % kColours.size()], falls, falls == 1 ? "" : "s");
    }
    for (const int degrees : {-45, 0, 45}) {
      put("<path d='M{:.1f} {:.1f}H{:.1f}' stroke='{}'/><text x='{:.1f}' y='{:.1f}' text-anchor='end' fill='#555' "
          "font-size='11'>{}°</text>\n",
          kLeft, y(degrees), x(end), degrees == 0 ? "#bbb" : "#e5e5e5", kLeft - 6, y(degrees) + 4, degrees);
    }
    for (std::size_t r = runs.size(); r-- > 0;) {
      put("<path fill='none' stroke='{}' stroke-width='1.1' d='", kColours[r % kColours.size()]);
      bool pen_up = true;
      double last_x = 0;
      double last_y = 0;
      for (const Snapshot &snapshot : runs[r].plants[p].snapshots) {
        const double at_x = x(seconds(snapshot.time));
        const double at_y = y(snapshot.angle * 180 / std::numbers::pi);
        // Points less than a pixel away add nothing but bytes.
        if (!pen_up && !snapshot.down && at_x - last_x < 1.5 && std::abs(at_y - last_y) < 0.6) continue;
        last_x = at_x;
        last_y = at_y;
        put("{}{:.1f} {:.1f}", pen_up ? 'M' : 'L', at_x, at_y);
        pen_up = snapshot.down;  // the line breaks where a plant is set upright again
      }
      put("'/>\n");
    }
  }
  const double bottom = kHead + static_cast<double>(plants) * kPanel;
  for (int tick = 0; tick <= 10; ++tick) {
    const double time = end * tick / 10;
    put("<path d='M{:.1f} {:.1f}v5' stroke='#333'/><text x='{:.1f}' y='{:.1f}' text-anchor='middle'>{:.3g}</text>\n",
        x(time), bottom, x(time), bottom + 19, time);
  }
  put("<text x='{:.1f}' y='{:.1f}' text-anchor='middle'>seconds; angle from upright</text>\n</svg>\n", x(end / 2),
      bottom + 36);
  return svg;
}

}  // namespace closed_loop
