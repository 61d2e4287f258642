#include "redag/base/check.hpp"

#include <cstdio>
#include <cstdlib>

namespace redag::detail {

void check_failed(const char *condition, const char *message, std::source_location where) noexcept {
  std::fprintf(stderr,
               "%s:%u: internal error: %s [%s]\nThis is a bug in ReDAG-RT; please report it with the workload.\n",
               where.file_name(), static_cast<unsigned>(where.line()), message, condition);
  std::fflush(stderr);
  std::abort();
}

}  // namespace redag::detail
