// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/top/live_graphs.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "redag/base/text.hpp"
#include "redag_lab/cli/top/live_figures.hpp"

namespace redag::cli {
namespace {

using live::page::kClasses;

constexpr std::size_t kHeights = 8;

/// Appends a character to a line of spans.
void put(Line &line, const char *character, Tint tint) {
  if (line.empty() || line.back().tint != tint) line.push_back({"", tint});
  line.back().text += character;
}

std::size_t height_of(double share) {
  if (share <= 0) return 0;
  const auto height = static_cast<std::size_t>(std::ceil(std::min(share, 1.0) * static_cast<double>(kHeights)));
  return std::clamp<std::size_t>(height, 1, kHeights);
}

}  // namespace

const char *Glyphs::column(std::size_t height) const {
  static constexpr std::array<const char *, kHeights + 1> kBlocks{" ",      "\u2581", "\u2582", "\u2583", "\u2584",
                                                                  "\u2585", "\u2586", "\u2587", "\u2588"};
  static constexpr std::array<const char *, kHeights + 1> kAscii{" ", ".", ".", ":", "-", "=", "+", "*", "#"};
  return (ascii ? kAscii : kBlocks)[std::min(height, kHeights)];
}

Line share_bar(double share, std::size_t width, const Glyphs &glyphs) {
  const std::string percent = " " + format_percent(share);
  const std::size_t room = width - std::min(width, 2 + std::size_t{8});
  const auto full = static_cast<std::size_t>(std::lround(std::clamp(share, 0.0, 1.0) * static_cast<double>(room)));
  std::string bar;
  for (std::size_t i = 0; i < full; ++i) bar += glyphs.bar();
  const Tint tint = share >= 0.9 ? Tint::Bad : share >= 0.7 ? Tint::Caution : Tint::Good;
  return {{"[", Tint::Strong},
          {bar, tint},
          {std::string(room - full, ' ') + padded(percent, 8, true)},
          {"]", Tint::Strong}};
}

std::size_t TimeAxis::class_of(std::size_t column, std::size_t width) const {
  return first + column * (last - first) / width;
}

TimeAxis axis_of(const live::Frame &frame) {
  TimeAxis axis{kClasses, 0};
  const auto include = [&axis](const live::page::Spread &spread) {
    for (std::size_t i = 0; i < kClasses; ++i) {
      if (spread.all[i] == 0) continue;
      axis.first = std::min(axis.first, i);
      axis.last = std::max(axis.last, i + 1);
    }
  };
  for (const live::DagFrame &dag : frame.dags) include(dag.spread);
  for (const live::TaskFrame &task : frame.tasks) include(task.spread);
  return axis.last == 0 ? TimeAxis{} : axis;
}

std::string axis_text(const TimeAxis &axis, std::size_t width) {
  if (axis.is_empty()) return std::string(width, ' ');
  const auto text = [](std::size_t index) {
    const Duration time = index == 0 ? 0 : live::page::least_in(index);
    // Two digits: the axis has steps of half an octave.
    const double step =
        std::pow(10, std::max(0.0, std::floor(std::log10(std::max<double>(1, static_cast<double>(time))) - 1)));
    const double rounded = std::round(static_cast<double>(time) / step) * step;
    return humanize_duration(static_cast<Duration>(rounded));
  };
  const std::string left = text(axis.first);
  const std::string right = text(axis.last);
  if (left.size() + right.size() + 1 > width) return padded(redag::cut(left, width), width, false);
  return left + std::string(width - left.size() - right.size(), ' ') + right;
}

Line histogram(const std::uint32_t (&counts)[kClasses], const TimeAxis &axis, Duration deadline, std::size_t width,
               const Glyphs &glyphs) {
  Line line;
  if (axis.is_empty()) return {{std::string(width, ' ')}};
  // With more columns than classes, a class has several columns.
  std::vector<std::uint64_t> sums(width);
  for (std::size_t column = 0; column < width; ++column) {
    const std::size_t begin = axis.class_of(column, width);
    const std::size_t end = std::max(axis.class_of(column + 1, width), begin + 1);
    for (std::size_t i = begin; i < end && i < kClasses; ++i) sums[column] += counts[i];
  }
  const std::uint64_t most = *std::max_element(sums.begin(), sums.end());
  for (std::size_t column = 0; column < width; ++column) {
    const double share = most > 0 ? static_cast<double>(sums[column]) / static_cast<double>(most) : 0;
    // A blank stays plain: in the marked row, whose colours are reversed, it would be a red block.
    const bool is_late =
        sums[column] > 0 && deadline > 0 && live::page::least_in(axis.class_of(column, width)) >= deadline;
    put(line, glyphs.column(height_of(share)), is_late ? Tint::Bad : Tint::Plain);
  }
  return line;
}

void Course::add(const live::Frame &frame) {
  if (frame.sequence == sequence_) return;
  sequence_ = frame.sequence;
  std::map<std::string, std::deque<Duration>> kept;
  const auto add = [&](const LiveRow &row, const live::page::Figures &figures) {
    const std::string name = full_name(row, frame);
    std::deque<Duration> values;
    if (const auto known = values_.find(name); known != values_.end()) values = std::move(known->second);
    values.push_back(figures.recent_p99);
    if (values.size() > kLooks) values.pop_front();
    kept[name] = std::move(values);
  };
  for (std::size_t i = 0; i < frame.dags.size(); ++i) add({true, i}, frame.dags[i].figures);
  for (std::size_t i = 0; i < frame.tasks.size(); ++i) add({false, i}, frame.tasks[i].figures);
  values_ = std::move(kept);
}

void Course::clear() {
  values_.clear();
  sequence_ = 0;
}

Line Course::graph(const std::string &name, Duration deadline, std::size_t width, const Glyphs &glyphs) const {
  Line line;
  const auto known = values_.find(name);
  const std::size_t count = known == values_.end() ? 0 : std::min(width, known->second.size());
  if (count < width) line.push_back({std::string(width - count, ' ')});
  if (count == 0) return line;
  const auto begin = known->second.end() - static_cast<std::ptrdiff_t>(count);
  const Duration full = std::max({deadline, *std::max_element(begin, known->second.end()), Duration{1}});
  for (auto at = begin; at != known->second.end(); ++at) {
    const bool is_late = deadline > 0 && *at > deadline;
    put(line, glyphs.column(height_of(static_cast<double>(*at) / static_cast<double>(full))),
        is_late ? Tint::Bad : Tint::Plain);
  }
  return line;
}

}  // namespace redag::cli
