// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/live/owned_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>

namespace redag::live {

int create_owned_file(const std::string &path) {
  constexpr mode_t kOwnerOnly = S_IRUSR | S_IWUSR;
  const int descriptor = ::open(path.c_str(), O_CREAT | O_EXCL | O_RDWR | O_CLOEXEC | O_NOFOLLOW, kOwnerOnly);
  if (descriptor >= 0) (void)::fchmod(descriptor, kOwnerOnly);  // restores what the umask took away
  return descriptor;
}

}  // namespace redag::live
