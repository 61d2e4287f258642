// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/top/device_lines.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <span>
#include <string>

#include "redag/base/text.hpp"
#include "redag_lab/cli/top/live_cells.hpp"
#include "redag_lab/cli/top/live_figures.hpp"

namespace redag::cli {
namespace {

using live::DeviceFrame;
using live::Frame;

constexpr std::size_t kBetween = 2;
constexpr std::size_t kBusyBar = 18;
constexpr std::size_t kLeastServed = 8;  // the names of tasks are not shown in less

// From left to right, behind the name.
struct DeviceColumn {
  enum : std::size_t { Busy, Slots, Queue, Rate, Serves };
};
constexpr std::size_t kDeviceColumns = DeviceColumn::Serves + 1;
constexpr std::size_t kByImportance[] = {DeviceColumn::Queue, DeviceColumn::Busy, DeviceColumn::Slots,
                                         DeviceColumn::Rate, DeviceColumn::Serves};
using Texts = std::array<std::string, kDeviceColumns>;

/// Returns the names of the tasks that a device serves.
std::string served_text(const DeviceFrame &device, const Frame &frame) {
  std::vector<std::string> names;
  for (const std::uint32_t task : device.tasks) names.push_back(full_name(frame.tasks[task], frame));
  if (device.used > names.size()) names.push_back(fmt::format("{} more", device.used - names.size()));
  return fmt::format("{}", fmt::join(names, ", "));
}

/// Returns the width of each column; 0: there is no room for it. `left`: the room behind the names.
std::array<std::size_t, kDeviceColumns> widths_of(const std::vector<Texts> &rows, std::size_t left) {
  std::array<std::size_t, kDeviceColumns> widths{};
  for (const std::size_t column : kByImportance) {
    std::size_t needed = column == DeviceColumn::Busy ? kBusyBar : 0;
    for (const Texts &row : rows) needed = std::max(needed, display_width(row[column]));
    if (column == DeviceColumn::Serves) {
      needed = std::min(needed, std::max(kLeastServed, left > kBetween ? left - kBetween : 0));
    }
    if (needed + kBetween > left) continue;
    widths[column] = needed;
    left -= needed + kBetween;
  }
  return widths;
}

}  // namespace

std::vector<Line> device_lines(const Frame &frame, bool since_start, std::size_t width, std::size_t most,
                               const Glyphs &glyphs) {
  if (frame.devices.empty() || most < 2) return {};
  const bool all = frame.devices.size() < most && frame.devices_in_all <= frame.devices.size();
  const auto shown = std::span(frame.devices).first(std::min(frame.devices.size(), all ? most - 1 : most - 2));
  std::vector<Texts> rows{{"busy", "slots", "queue", "served/s", "serves"}};
  std::size_t of_names = display_width("device");
  for (const DeviceFrame &device : shown) {
    of_names = std::max(of_names, display_width(device.name));
    rows.push_back({"", fmt::format("{}/{}", device.used, device.slots), fmt::format("{}", device.queued),
                    rate_text(rate_of(device, frame, since_start)), served_text(device, frame)});
  }
  of_names = std::min(of_names, width);
  const auto widths = widths_of(rows, width - of_names);

  std::vector<Line> lines;
  for (std::size_t r = 0; r < rows.size(); ++r) {
    const bool is_title = r == 0;
    const std::string &name = is_title ? "device" : shown[r - 1].name;
    Line line{{padded(cut_middle(name, of_names), of_names, false), is_title ? Tint::Strong : Tint::Plain}};
    for (std::size_t column = 0; column < kDeviceColumns; ++column) {
      if (widths[column] == 0) continue;
      line.push_back({std::string(kBetween, ' ')});
      if (column == DeviceColumn::Busy && !is_title) {
        const Line bar = share_bar(share_of(shown[r - 1], frame, since_start), widths[column], glyphs);
        line.insert(line.end(), bar.begin(), bar.end());
        continue;
      }
      const bool is_text = column == DeviceColumn::Busy || column == DeviceColumn::Serves;
      line.push_back({padded(cut_middle(rows[r][column], widths[column]), widths[column], !is_text),
                      is_title ? Tint::Strong : Tint::Plain});
    }
    lines.push_back(std::move(line));
  }
  if (!all) lines.push_back({{fmt::format("{} more devices", frame.devices_in_all - shown.size()), Tint::Faint}});
  return lines;
}

}  // namespace redag::cli
