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
  const live::Listed *found = nullptr;
  const auto look_for = [&](const auto &is_it) {
    if (found != nullptr) return;
    const auto at = std::find_if(pages.begin(), pages.end(),
                                 [&](const live::Listed &listed) { return listed.page && is_it(listed); });
    if (at != pages.end()) found = &*at;
  };
  if (known_) {
    look_for([&](const live::Listed &l) { return l.path == known_->path && l.page->process == known_->process; });
    look_for([&](const live::Listed &l) {
      return l.page->frame.name == known_->name && l.page->frame.program == known_->program;
    });
  } else if (target_) {
    look_for([&](const live::Listed &l) { return target_->names(l); });
  } else if (std::count_if(pages.begin(), pages.end(), [](const auto &l) { return l.page.has_value(); }) == 1) {
    look_for([](const live::Listed &) { return true; });
  }
  if (found != nullptr) attach(*found);
  return found;
}

}  // namespace redag::cli
