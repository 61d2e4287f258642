// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Parses YAML text into a tree of nodes that know their place, for the readers of YAML files. Uses libyaml's events,
// because its documents follow aliases. Pure functions.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "redag/base/result.hpp"

namespace redag::yaml {

struct Node {
  enum class Kind : std::uint8_t { Null, Scalar, Sequence, Map };

  Kind kind = Kind::Null;
  bool quoted = false;         // a scalar in quotes or of several lines (| and >) is text, never a number
  int line = 0;                // from 1
  int column = 0;              // from 1, in characters
  std::string text;            // of a scalar
  std::vector<Node> children;  // of a sequence: the items; of a map: key, value, key, value, ...

  [[nodiscard]] bool is(std::string_view word) const { return kind == Kind::Scalar && text == word; }
};

/// The deepest nesting that is read. A workload needs seven levels.
inline constexpr std::size_t kMaxDepth = 32;

/// Returns the one document in `text`; a text without one gives a Null node. Errors: not UTF-8, control characters,
/// YAML syntax, aliases, anchors and tags, more than one document, nesting beyond kMaxDepth.
[[nodiscard]] Result<Node> parse(std::string_view text, const std::string &file);

/// Returns true if an unquoted scalar with this text is a Null node.
[[nodiscard]] bool is_null(std::string_view plain);

/// Returns the place of the first character that looks like a space, or like nothing, and is none for YAML: a no-break
/// space (U+00A0), for instance. npos if there is none. parse() refuses it in unquoted scalars.
[[nodiscard]] std::size_t find_odd_space(std::string_view text);

/// Describes a node for messages: "a map", "a list", "'5ms'".
[[nodiscard]] std::string describe(const Node &node);

}  // namespace redag::yaml
