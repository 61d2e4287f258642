// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/text/footnotes.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "redag_analysis/text/wrap.hpp"

namespace redag {

std::string Footnotes::mark(const std::string &note) {
  if (note.empty()) return {};
  const auto found = std::find(notes_.begin(), notes_.end(), note);
  const auto at = static_cast<std::size_t>(found - notes_.begin());
  if (found == notes_.end()) notes_.push_back(note);
  return fmt::format(" [{}]", at + 1);
}

std::string Footnotes::render(std::size_t width) const {
  std::string text;
  for (std::size_t i = 0; i < notes_.size(); ++i) {
    const std::string mark = fmt::format("[{}] ", i + 1);
    text += mark + wrapped(notes_[i], mark.size(), width);
  }
  return text;
}

}  // namespace redag
