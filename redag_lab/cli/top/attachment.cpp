// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/cli/top/attachment.hpp"

#include <algorithm>
#include <charconv>

namespace redag::cli {

std::optional<LiveTarget> parse_target(const std::string &text) {
  LiveTarget target;
  const char *const end = text.data() + text.size();
  const auto pid = std::from_chars(text.data(), end, target.pid);
  if (pid.ec != std::errc() || target.pid <= 0) return std::nullopt;
  if (pid.ptr == end) return target;
  std::uint32_t number = 0;
  const auto rest = std::from_chars(pid.ptr + 1, end, number);
  if (*pid.ptr != '.' || rest.ec != std::errc() || rest.ptr != end) return std::nullopt;
  target.number = number;
  return target;
}

void Attachment::attach(const live::Listed &listed) {
  const live::Frame &frame = listed.page->frame;
  known_ = Known{listed.path, listed.page->process, frame.name, frame.program};
}

const live::Listed *Attachment::find(const std::vector<live::Listed> &pages) {
  const auto first = [&](const auto &is_it) {
    return std::find_if(pages.begin(), pages.end(),
                        [&](const live::Listed &listed) { return listed.page && is_it(listed); });
  };
  auto found = pages.end();
  if (known_) {
    found = first([&](const auto &l) { return l.path == known_->path && l.page->process == known_->process; });
    if (found == pages.end()) {
      found = first([&](const auto &l) {
        return l.page->frame.name == known_->name && l.page->frame.program == known_->program;
      });
    }
  } else {
    found = first([&](const auto &l) { return !target_ || target_->names(l); });
  }
  if (found == pages.end()) return nullptr;
  attach(*found);
  return &*found;
}

void Attachment::step(const std::vector<live::Listed> &pages) {
  std::vector<const live::Listed *> readable;
  std::size_t at = 0;
  for (const live::Listed &listed : pages) {
    if (!listed.page) continue;
    if (known_ && listed.path == known_->path) at = readable.size();
    readable.push_back(&listed);
  }
  if (readable.empty()) return;
  attach(*readable[(at + 1) % readable.size()]);
}

}  // namespace redag::cli
