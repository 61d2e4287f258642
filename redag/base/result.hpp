// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The result of a function whose input can be bad: a value, or every mistake found, each with its place and a hint.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <tl/expected.hpp>

namespace redag {

enum class Severity : std::uint8_t { Error, Warning };

/// One mistake in a user's text. `line` and `column` count from 1; 0: there is no place to point at.
struct Diagnostic {
  Severity severity = Severity::Error;
  std::string file;
  int line = 0;
  int column = 0;
  std::string message;
  std::string hint;

  /// For example "cart.yaml:4:12: error: unknown key 'wect' (did you mean 'wcet'?)".
  [[nodiscard]] std::string to_string() const;

  friend bool operator==(const Diagnostic &, const Diagnostic &) = default;
};

using Diagnostics = std::vector<Diagnostic>;

template <class T>
using Result = tl::expected<T, Diagnostics>;

/// Makes the error of a Result from one message without a place.
[[nodiscard]] inline tl::unexpected<Diagnostics> make_error(std::string message, std::string hint = {}) {
  return tl::unexpected<Diagnostics>(
      Diagnostics{Diagnostic{Severity::Error, {}, 0, 0, std::move(message), std::move(hint)}});
}

/// Returns one diagnostic a line.
[[nodiscard]] std::string to_string(const Diagnostics &diagnostics);

}  // namespace redag
