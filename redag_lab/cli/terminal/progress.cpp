// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/terminal/progress.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "redag/base/text.hpp"
#include "redag/threads/clock.hpp"
#include "redag_analysis/text/tint.hpp"

namespace redag::cli {
namespace {

constexpr Duration kRedrawPeriod = 100 * kMillisecond;
constexpr std::size_t kBarWidth = 20;

}  // namespace

std::string progress_line(std::string_view label, double done, std::string_view detail, std::size_t width) {
  const double share = std::clamp(done, 0.0, 1.0);
  const auto filled = static_cast<std::size_t>(share * static_cast<double>(kBarWidth));
  const std::string bar = std::string(filled, '#') + std::string(kBarWidth - filled, ' ');
  const std::string line =
      fmt::format("{}{}[{}] {:3.0f} %  {}", label, label.empty() ? "" : " ", bar, 100 * share, detail);
  return cut(line, width);
}

Progress::Progress(Console &console) : console_(console), begin_(runtime::monotonic_now()) {}

bool Progress::due() const {
  return console_.err_traits().terminal && runtime::monotonic_now() - last_drawn_ >= kRedrawPeriod;
}

void Progress::draw(double done, std::string_view detail) {
  if (!console_.err_traits().terminal) return;
  last_drawn_ = runtime::monotonic_now();
  visible_ = true;
  // One column stays free, because a full last column wraps on some terminals.
  const std::size_t width = console_.err_traits().width;
  console_.note("\r\033[K" + progress_line(label_, done, detail, width > 1 ? width - 1 : 79));
}

Duration Progress::elapsed() const { return runtime::monotonic_now() - begin_; }

std::string Progress::left(double done) const {
  if (done < 0.01 || elapsed() < kSecond) return {};
  const double rest = static_cast<double>(elapsed()) * (1 - std::min(done, 1.0)) / done;
  return fmt::format(", {} left", humanize_duration(static_cast<Duration>(rest)));
}

void Progress::clear() {
  if (visible_) console_.note("\r\033[K");
  visible_ = false;
}

}  // namespace redag::cli
