// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A file that appears completely or not at all: written without a name in its directory, so that a killed process
// leaves nothing behind, and named by commit(). Where the file system has no files without a name, "<path>.tmp.<pid>"
// is written and renamed. Every error (unwritable directory, full disk) is kept and reported by commit(). Not
// thread-safe.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "redag/base/result.hpp"

namespace redag::trace {

class OutputFile {
 public:
  /// The directory must exist.
  [[nodiscard]] static Result<OutputFile> create(std::string path);

  OutputFile(OutputFile &&other) noexcept;
  OutputFile &operator=(OutputFile &&) = delete;
  OutputFile(const OutputFile &) = delete;
  OutputFile &operator=(const OutputFile &) = delete;
  /// Without commit(), leaves `path` as it was, and nothing beside it.
  ~OutputFile();

  /// Appends, buffered. Does nothing after an error.
  void write(std::string_view text);

  /// Flushes the file and gives it its name, replacing an existing file.
  [[nodiscard]] Result<void> commit();

 private:
  OutputFile(std::string path, int descriptor, bool is_named);

  void flush();
  void fail();
  [[nodiscard]] std::string temporary() const;

  std::string path_;
  int descriptor_ = -1;
  bool is_named_ = false;  // it has its temporary name
  int error_ = 0;          // errno of the first failure
  std::string buffer_;
};

/// The largest file that is read: an endless one (a device, a pipe) must not use all memory.
inline constexpr std::size_t kMaxFileBytes = std::size_t{8} << 30U;

/// Reads a whole file, for readers of our formats. Errors name the file.
[[nodiscard]] Result<std::string> read_file(const std::string &path, std::size_t most = kMaxFileBytes);
/// The same of an open file, which has this path: what has not been read of it.
[[nodiscard]] Result<std::string> read_rest(int descriptor, const std::string &path, std::size_t most = kMaxFileBytes);

/// Makes one error at a line of a file.
[[nodiscard]] tl::unexpected<Diagnostics> file_error(const std::string &file, int line, std::string message,
                                                     std::string hint = {});

}  // namespace redag::trace
