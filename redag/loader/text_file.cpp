// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/loader/text_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

namespace redag {

tl::unexpected<Diagnostics> file_error(const std::string &file, int line, std::string message, std::string hint) {
  const int column = line > 0 ? 1 : 0;
  return tl::unexpected<Diagnostics>(
      Diagnostics{Diagnostic{Severity::Error, file, line, column, std::move(message), std::move(hint)}});
}

Result<std::string> read_file(const std::string &path, std::size_t most) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return file_error(path, 0, std::string("cannot open: ") + std::strerror(errno));
  Result<std::string> text = read_rest(descriptor, path, most);
  ::close(descriptor);
  return text;
}

Result<std::string> read_rest(int descriptor, const std::string &path, std::size_t most) {
  std::string text;
  struct stat status {};
  const bool known = ::fstat(descriptor, &status) == 0;
  if (known && S_ISDIR(status.st_mode)) return file_error(path, 0, "is a directory, not a file");
  if (known && S_ISCHR(status.st_mode) && ::isatty(descriptor) == 0) {  // /dev/zero has no end
    return file_error(path, 0, "is a device, not a file");
  }
  if (known && status.st_size > 0) text.reserve(std::min(static_cast<std::size_t>(status.st_size), most));
  std::string block(std::size_t{1} << 20U, '\0');
  ssize_t count = 0;
  while ((count = ::read(descriptor, block.data(), block.size())) != 0) {
    if (count > 0 && static_cast<std::size_t>(count) > most - text.size()) {
      return file_error(path, 0, "is larger than " + std::to_string(most >> 20U) + " MiB");
    }
    if (count > 0) {
      text.append(block, 0, static_cast<std::size_t>(count));
    } else if (errno != EINTR) {
      return file_error(path, 0, std::string("cannot read: ") + std::strerror(errno));
    }
  }
  return text;
}

}  // namespace redag
