// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Bytes of a file, read where a reader asks for them, so that a file longer than memory can be read. What has no places
// (a pipe) is read as a whole first. Not thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "redag/base/result.hpp"

namespace redag::trace {

class InputFile {
 public:
  /// Errors: what the system refuses, a device, a pipe of more than kMaxFileBytes.
  [[nodiscard]] static Result<InputFile> open(const std::string &path);
  /// Takes bytes in memory, which must outlive this object, for a file called `name`.
  InputFile(std::string_view bytes, std::string name);

  InputFile(InputFile &&other) noexcept;
  InputFile &operator=(InputFile &&) = delete;
  InputFile(const InputFile &) = delete;
  InputFile &operator=(const InputFile &) = delete;
  ~InputFile();

  [[nodiscard]] const std::string &name() const { return name_; }
  [[nodiscard]] std::uint64_t size() const { return size_; }

  /// Returns up to `count` bytes from `offset` on: fewer where the file ends. They are valid until the next call.
  [[nodiscard]] Result<std::string_view> read(std::uint64_t offset, std::size_t count);

 private:
  InputFile(std::string name, int descriptor, std::uint64_t size)
      : name_(std::move(name)), descriptor_(descriptor), size_(size) {}

  std::string name_;
  int descriptor_ = -1;  // -1: the bytes are in memory
  std::uint64_t size_ = 0;
  std::string owned_;       // of a pipe: all bytes; of a file: those of the last call
  std::string_view bytes_;  // of memory that others own
  bool is_pipe_ = false;
};

}  // namespace redag::trace
