// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/text/words.hpp"

#include "redag/base/text.hpp"

namespace redag {

std::string plural(std::uint64_t count, std::string_view noun, std::string_view many) {
  std::string text = format_count(count) + " ";
  if (count != 1 && !many.empty()) return text.append(many);
  return text.append(noun).append(count == 1 ? "" : "s");
}

std::string join(const std::vector<std::string> &names) {
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (i > 0) text += i + 1 == names.size() ? " and " : ", ";
    text += names[i];
  }
  return text;
}

std::string join_first(std::vector<std::string> names, std::size_t most) {
  if (names.size() > most) {
    const std::size_t more = names.size() - most;
    names.resize(most);
    names.push_back(plural(more, "other"));
  }
  return join(names);
}

}  // namespace redag
