// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A file that appears completely or not at all: written without a name in its directory, so that a killed process
// leaves nothing behind, and named by commit(). Where the file system has no files without a name, "<path>.tmp.<pid>"
// is written and renamed. Every error (unwritable directory, full disk) is kept and reported by commit(). A file that
// grows() has its name from the beginning instead. Not thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "redag/base/result.hpp"

namespace redag::trace {

class OutputFile {
 public:
  /// The directory must exist.
  [[nodiscard]] static Result<OutputFile> create(std::string path);

  /// Replaces a file by an empty one, which has the name at once, and is locked (flock) while this object lives.
  [[nodiscard]] static Result<OutputFile> grow(std::string path);

  OutputFile(OutputFile &&other) noexcept;
  OutputFile &operator=(OutputFile &&) = delete;
  OutputFile(const OutputFile &) = delete;
  OutputFile &operator=(const OutputFile &) = delete;
  /// Without commit(), leaves `path` as it was, and nothing beside it. A file that grows stays with what was flushed.
  ~OutputFile();

  /// Appends, buffered. Does nothing after an error.
  void write(std::string_view text);

  /// Hands all bytes to the kernel: they survive the process. Error: the first failure, also in later calls.
  [[nodiscard]] Result<void> flush();
  /// Asks the kernel to begin to write what was flushed to the disk, and does not wait.
  void begin_sync();
  /// Of a file that grows: replaces bytes that were flushed.
  void overwrite(std::uint64_t offset, std::string_view bytes);
  /// Gives the blocks of [from, to) back to the file system, and leaves a hole there.
  void discard(std::uint64_t from, std::uint64_t to);

  /// Flushes the file and gives it its name, replacing an existing file.
  [[nodiscard]] Result<void> commit();

 private:
  enum class Name { None, Temporary, Final };

  OutputFile(std::string path, int descriptor, Name name);

  void write_out();
  void fail();
  [[nodiscard]] Result<void> state() const;
  [[nodiscard]] std::string temporary() const;

  std::string path_;
  int descriptor_ = -1;
  Name name_ = Name::None;
  int error_ = 0;  // errno of the first failure
  std::string buffer_;
};

}  // namespace redag::trace
