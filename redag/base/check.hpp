// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Broken invariants. REDAG_CHECK stays on in release builds: a scheduler that goes on after losing count of a job is
// worse than one that stops and says where.
#pragma once

namespace redag::detail {

/// Prints the condition and its place to standard error and aborts.
[[noreturn]] void check_failed(const char *condition, const char *message, const char *file, int line) noexcept;

}  // namespace redag::detail

// __FILE__ and not std::source_location: clang 14 has none with GCC's standard library.
#define REDAG_CHECK(condition, message)                \
  (static_cast<bool>(condition) ? static_cast<void>(0) \
                                : ::redag::detail::check_failed(#condition, message, __FILE__, __LINE__))
