// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/loader/text_file.hpp"

#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>

namespace redag {

Result<std::string> read_text_file(const std::filesystem::path &path, const char *what, std::size_t most) {
  const auto fail = [&](std::string why) {
    return tl::unexpected<Diagnostics>(
        Diagnostics{Diagnostic{Severity::Error, path.string(), 0, 0, std::move(why), {}}});
  };
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) return fail(std::string("is a directory, not ") + what);
  errno = 0;
  std::ifstream stream(path, std::ios::binary);
  if (!stream) return fail(std::string("cannot open: ") + std::strerror(errno));
  std::string text;
  std::array<char, 65536> buffer{};
  while (stream.read(buffer.data(), buffer.size()), stream.gcount() > 0) {
    text.append(buffer.data(), static_cast<std::size_t>(stream.gcount()));
    if (text.size() > most) break;
  }
  if (stream.bad()) return fail(std::string("cannot read: ") + std::strerror(errno));
  return text;
}

}  // namespace redag
