// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Footnotes of a table: a long text that many rows share stands below the table once. Not thread-safe.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace redag {

class Footnotes {
 public:
  /// Returns " [1]", the mark of a note: of equal notes the same. An empty note has none.
  [[nodiscard]] std::string mark(const std::string &note);

  /// Returns the notes in the order of their marks, each with a newline. `width` is in columns; 0: no limit.
  [[nodiscard]] std::string render(std::size_t width) const;

 private:
  std::vector<std::string> notes_;
};

}  // namespace redag
