// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/base/check.hpp"

#include <cstdio>
#include <cstdlib>

namespace redag::detail {

void check_failed(const char *condition, const char *message, const char *file, int line) noexcept {
  std::fprintf(stderr,
               "%s:%d: internal error: %s [%s]\nThis is a bug in ReDAG-RT; please report it with the workload.\n", file,
               line, message, condition);
  std::fflush(stderr);
  std::abort();
}

}  // namespace redag::detail
