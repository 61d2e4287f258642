// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/terminal/progress.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>

#include "redag/base/text.hpp"
#include "redag_analysis/text/table.hpp"

namespace redag::cli {
namespace {

constexpr Duration kRedrawPeriod = 100 * kMillisecond;
constexpr std::size_t kBarWidth = 20;

// A first estimate can be far off, and beyond what a Duration holds.
std::string rest_in_words(double rest) {
  return (rest < 86'400e9 ? humanize_duration(static_cast<Duration>(rest)) : "more than a day") + " left";
}

Time now() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

}  // namespace

std::string progress_line(std::string_view label, double done, std::string_view detail, std::size_t width) {
  const double share = std::clamp(done, 0.0, 1.0);
  const auto filled = static_cast<std::size_t>(share * static_cast<double>(kBarWidth));
  const std::string bar = std::string(filled, '#') + std::string(kBarWidth - filled, ' ');
  const std::string line =
      fmt::format("{}{}[{}] {:3.0f} %  {}", label, label.empty() ? "" : " ", bar, 100 * share, detail);
  return cut(line, width);
}

Stopwatch::Stopwatch() : begin_(now()) {}

Duration Stopwatch::elapsed() const { return now() - begin_; }

std::string pace(std::uint64_t done, std::uint64_t total, Duration elapsed) {
  std::string text = fmt::format("{} of {}", format_count(done), format_count(total));
  if (done == 0 || elapsed <= 0) return text;
  const double each = static_cast<double>(elapsed) / static_cast<double>(done);
  const double rest = each * static_cast<double>(total - std::min(done, total));
  return text + fmt::format(", {:.0f}/s, {}", 1e9 / each, rest_in_words(rest));
}

Progress::Progress(Console &console) : console_(console), begin_(now()) {}

bool Progress::due() const { return console_.err_traits().terminal && now() - last_drawn_ >= kRedrawPeriod; }

void Progress::draw(double done, std::string_view detail) {
  if (!console_.err_traits().terminal) return;
  last_drawn_ = now();
  visible_ = true;
  // One column stays free, because a full last column wraps on some terminals.
  const std::size_t width = console_.err_traits().width;
  console_.note("\r\033[K" + progress_line(label_, done, detail, width > 1 ? width - 1 : 79));
}

std::string Progress::left(double done) const {
  const Duration elapsed = now() - begin_;
  if (done < 0.01 || elapsed < kSecond) return {};
  return ", " + rest_in_words(static_cast<double>(elapsed) * (1 - std::min(done, 1.0)) / done);
}

void Progress::clear() {
  if (visible_) console_.note("\r\033[K");
  visible_ = false;
}

}  // namespace redag::cli
