// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A file that appears completely or not at all: written under a temporary name in the same directory, and renamed by
// commit(). Every error (unwritable directory, full disk) is kept and reported by commit(). Not thread-safe.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "redag/base/result.hpp"

namespace redag::trace {

class OutputFile {
 public:
  /// Opens "<path>.tmp.<pid>". The directory must exist.
  [[nodiscard]] static Result<OutputFile> create(std::string path);

  OutputFile(OutputFile &&other) noexcept;
  OutputFile &operator=(OutputFile &&) = delete;
  OutputFile(const OutputFile &) = delete;
  OutputFile &operator=(const OutputFile &) = delete;
  /// Without commit(), removes the temporary file and leaves `path` as it was.
  ~OutputFile();

  /// Appends, buffered. Does nothing after an error.
  void write(std::string_view text);

  /// Flushes and renames the file to its final name, replacing an existing file.
  [[nodiscard]] Result<void> commit();

 private:
  OutputFile(std::string path, std::string temporary, int descriptor);

  void flush();

  std::string path_;
  std::string temporary_;
  int descriptor_ = -1;
  int error_ = 0;  // errno of the first failure
  std::string buffer_;
};

/// The largest file that is read: an endless one (a device, a pipe) must not use all memory.
inline constexpr std::size_t kMaxFileBytes = std::size_t{8} << 30U;

/// Reads a whole file, for readers of our formats. Errors name the file.
[[nodiscard]] Result<std::string> read_file(const std::string &path, std::size_t most = kMaxFileBytes);

/// Makes one error at a line of a file.
[[nodiscard]] tl::unexpected<Diagnostics> file_error(const std::string &file, int line, std::string message,
                                                     std::string hint = {});

}  // namespace redag::trace
