// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/line_plot.hpp"

#include <algorithm>
#include <array>
#include <iterator>
#include <string_view>
#include <utility>

#include <fmt/format.h>

namespace redag::experiment {
namespace {

// Sizes are in pixels.
constexpr double kPanelWidth = 400;
constexpr double kPanelHeight = 300;
constexpr double kLeft = 66;    // of a panel, for the y axis
constexpr double kBottom = 48;  // for the x axis
constexpr double kTop = 30;     // for a panel's title
constexpr double kRight = 16;
constexpr double kHead = 62;  // for the plot's title
constexpr double kLegendLine = 20;
constexpr double kCharacter = 7;  // a generous estimate, for the legend's width

// The colours of M. Okabe and K. Ito, distinct with any colour vision, with grey in place of yellow. Where lines
// outnumber the colours, the dashes differ. Dashes also keep a covered line visible.
constexpr std::array<std::string_view, 8> kColours = {"#0072b2", "#000000", "#d55e00", "#009e73",
                                                      "#cc79a7", "#e69f00", "#56b4e9", "#808080"};
constexpr std::array<std::string_view, 4> kDashes = {"", "9 5", "3 4", "10 4 3 4"};

std::string escaped(std::string_view text) {
  std::string safe;
  for (const char c : text) {
    switch (c) {
      case '&': safe += "&amp;"; break;
      case '<': safe += "&lt;"; break;
      case '>': safe += "&gt;"; break;
      default: safe += c; break;
    }
  }
  return safe;
}

// Every line has its own marker, which keeps lines on top of each other visible.
std::string marker(std::size_t line, double x, double y) {
  const std::string_view colour = kColours[line % kColours.size()];
  switch (line % 4) {
    case 0: return fmt::format("<circle cx='{:.1f}' cy='{:.1f}' r='3' fill='{}'/>", x, y, colour);
    case 1:
      return fmt::format("<rect x='{:.1f}' y='{:.1f}' width='5.4' height='5.4' fill='{}'/>", x - 2.7, y - 2.7, colour);
    case 2: return fmt::format("<path d='M{:.1f} {:.1f}l3.6 6.2h-7.2z' fill='{}'/>", x, y - 3.9, colour);
    default:
      return fmt::format("<path d='M{:.1f} {:.1f}l3.6 3.6l-3.6 3.6l-3.6-3.6z' fill='#fff' stroke='{}'/>", x, y - 3.6,
                         colour);
  }
}

std::string stroke(std::size_t line) {
  const std::string_view dash = kDashes[line % kDashes.size()];
  return fmt::format("fill='none' stroke='{}' stroke-width='1.8' stroke-linejoin='round'{}",
                     kColours[line % kColours.size()],
                     dash.empty() ? std::string() : fmt::format(" stroke-dasharray='{}'", dash));
}

class Drawing {
 public:
  explicit Drawing(const LinePlot &plot) : plot_(plot) {
    for (const LinePlot::Panel &panel : plot.panels) {
      for (const auto &series : panel.series) {
        for (const LinePlot::Value &value : series) x_largest_ = std::max(x_largest_, value.x);
      }
    }
    columns_ = plot.panels.size() == 1 ? 1 : (plot.panels.size() % 3 == 0 && plot.panels.size() > 3 ? 3 : 2);
  }

  std::string run() {
    std::size_t longest = 0;
    for (std::size_t line = 0; line < plot_.lines.size(); ++line) longest = std::max(longest, label(line).size());
    const std::size_t rows = std::max<std::size_t>(1, (plot_.panels.size() + columns_ - 1) / columns_);
    const double panels_right = static_cast<double>(columns_) * kPanelWidth;
    const double width = panels_right + 60 + static_cast<double>(longest) * kCharacter;
    const double panels_height = static_cast<double>(rows) * kPanelHeight;
    const double height = kHead + std::max(panels_height, 40 + static_cast<double>(plot_.lines.size()) * kLegendLine);
    put("<svg xmlns='http://www.w3.org/2000/svg' width='{0:.0f}' height='{1:.0f}' viewBox='0 0 {0:.0f} {1:.0f}' "
        "font-family='Helvetica, Arial, \"Liberation Sans\", sans-serif' font-size='13'>\n"
        "<rect width='100%' height='100%' fill='#fff'/>\n",
        width, height);
    put("<text x='{}' y='26' font-size='17' font-weight='bold'>{}</text>\n", 16, escaped(plot_.title));
    put("<text x='{}' y='46' fill='#555'>{}</text>\n", 16, escaped(plot_.subtitle));
    for (std::size_t p = 0; p < plot_.panels.size(); ++p) {
      const std::size_t row = p / columns_;
      left_ = static_cast<double>(p % columns_) * kPanelWidth + kLeft;
      top_ = kHead + static_cast<double>(row) * kPanelHeight + kTop;
      axes(plot_.panels[p]);
      for (std::size_t line = 0; line < plot_.panels[p].series.size(); ++line) band(line, plot_.panels[p].series[line]);
      for (std::size_t line = 0; line < plot_.panels[p].series.size(); ++line) draw(line, plot_.panels[p].series[line]);
    }
    legend(panels_right + 12);
    put("</svg>\n");
    return std::move(svg_);
  }

 private:
  template <class... Arguments>
  void put(fmt::format_string<Arguments...> format, Arguments &&...arguments) {
    fmt::format_to(std::back_inserter(svg_), format, std::forward<Arguments>(arguments)...);
  }

  [[nodiscard]] static double inner_width() { return kPanelWidth - kLeft - kRight; }
  [[nodiscard]] static double inner_height() { return kPanelHeight - kTop - kBottom; }
  [[nodiscard]] double x(double value) const { return left_ + value / x_end_ * inner_width(); }
  [[nodiscard]] double y(double value) const { return top_ + (1 - value / plot_.y_end) * inner_height(); }

  void x_tick(double place, const std::string &text) {
    put("<path d='M{:.1f} {:.1f}v5' stroke='#333'/>", x(place), y(0));
    put("<text x='{:.1f}' y='{:.1f}' text-anchor='middle' fill='#333'>{}</text>\n", x(place), y(0) + 19, escaped(text));
  }

  void axes(const LinePlot::Panel &panel) {
    x_end_ = panel.ticks.empty() ? x_largest_ : std::max(panel.ticks.back().first, 1e-9);
    const std::string &title = panel.title;
    put("<text x='{:.1f}' y='{:.1f}' text-anchor='middle' font-weight='bold'>{}</text>\n", x(x_end_ / 2), top_ - 10,
        escaped(title));
    for (int tick = 0; tick <= 5; ++tick) {
      const double share = tick / 5.0 * plot_.y_end;
      put("<path d='M{:.1f} {:.1f}H{:.1f}' stroke='#ddd'/>", left_, y(share), x(x_end_));
      put("<text x='{:.1f}' y='{:.1f}' text-anchor='end' fill='#333'>{:.3g} %</text>\n", left_ - 7, y(share) + 4.5,
          100 * share);
      if (panel.ticks.empty()) x_tick(tick / 5.0 * x_end_, fmt::format("{:.3g}", tick / 5.0 * x_end_));
    }
    for (const auto &[place, text] : panel.ticks) x_tick(place, text);
    put("<path d='M{:.1f} {:.1f}V{:.1f}H{:.1f}' fill='none' stroke='#333'/>\n", left_, y(plot_.y_end), y(0), x(x_end_));
    put("<text x='{:.1f}' y='{:.1f}' text-anchor='middle'>{}</text>\n", x(x_end_ / 2), y(0) + 38,
        escaped(panel.x_label.empty() ? plot_.x_label : panel.x_label));
    put("<text transform='translate({:.1f} {:.1f}) rotate(-90)' text-anchor='middle'>{}</text>\n", left_ - 50,
        y(plot_.y_end / 2), escaped(plot_.y_label));
  }

  void band(std::size_t line, const std::vector<LinePlot::Value> &series) {
    if (series.size() < 2) return;
    put("<path d='");
    for (std::size_t i = 0; i < series.size(); ++i) {
      put("{}{:.1f} {:.1f}", i == 0 ? 'M' : 'L', x(series[i].x), y(series[i].high));
    }
    for (auto value = series.rbegin(); value != series.rend(); ++value)
      put("L{:.1f} {:.1f}", x(value->x), y(value->low));
    put("z' fill='{}' fill-opacity='0.15'/>\n", kColours[line % kColours.size()]);
  }

  void draw(std::size_t line, const std::vector<LinePlot::Value> &series) {
    if (series.empty()) return;
    put("<path d='");
    for (std::size_t i = 0; i < series.size(); ++i) {
      put("{}{:.1f} {:.1f}", i == 0 ? 'M' : 'L', x(series[i].x), y(series[i].y));
    }
    put("' {}/>\n", stroke(line));
    for (const LinePlot::Value &value : series) put("{}", marker(line, x(value.x), y(value.y)));
    put("\n");
  }

  [[nodiscard]] bool is_drawn(std::size_t line) const {
    return std::any_of(plot_.panels.begin(), plot_.panels.end(),
                       [&](const LinePlot::Panel &panel) { return !panel.series[line].empty(); });
  }
  [[nodiscard]] std::string label(std::size_t line) const {
    return plot_.lines[line] + (is_drawn(line) ? "" : " (does not apply)");
  }

  void legend(double left) {
    double at = kHead + kTop + 6;
    for (std::size_t line = 0; line < plot_.lines.size(); ++line) {
      put("<path d='M{:.1f} {:.1f}h28' {}/>{}", left, at, stroke(line), marker(line, left + 14, at));
      put("<text x='{:.1f}' y='{:.1f}'{}>{}</text>\n", left + 36, at + 4.5, is_drawn(line) ? "" : " fill='#888'",
          escaped(label(line)));
      at += kLegendLine;
    }
  }

  const LinePlot &plot_;
  double x_largest_ = 1;
  double x_end_ = 1;  // of the current panel
  std::size_t columns_ = 1;
  double left_ = 0;  // inner edge of the current panel
  double top_ = 0;
  std::string svg_;
};

}  // namespace

std::string to_svg(const LinePlot &plot) { return Drawing(plot).run(); }

}  // namespace redag::experiment
