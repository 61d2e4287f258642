// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/trace/output_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <utility>

namespace redag::trace {
namespace {

constexpr std::size_t kBufferSize = std::size_t{1} << 20U;

}  // namespace

tl::unexpected<Diagnostics> file_error(const std::string &file, int line, std::string message, std::string hint) {
  const int column = line > 0 ? 1 : 0;
  return tl::unexpected<Diagnostics>(
      Diagnostics{Diagnostic{Severity::Error, file, line, column, std::move(message), std::move(hint)}});
}

OutputFile::OutputFile(std::string path, std::string temporary, int descriptor)
    : path_(std::move(path)), temporary_(std::move(temporary)), descriptor_(descriptor) {
  buffer_.reserve(kBufferSize + kBufferSize / 16);
}

OutputFile::OutputFile(OutputFile &&other) noexcept
    : path_(std::move(other.path_)),
      temporary_(std::move(other.temporary_)),
      descriptor_(std::exchange(other.descriptor_, -1)),
      error_(other.error_),
      buffer_(std::move(other.buffer_)) {}

OutputFile::~OutputFile() {
  if (descriptor_ < 0) return;
  ::close(descriptor_);
  ::unlink(temporary_.c_str());
}

Result<OutputFile> OutputFile::create(std::string path) {
  std::string temporary = path + ".tmp." + std::to_string(::getpid());
  const int descriptor = ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (descriptor < 0) {
    const int error = errno;
    return file_error(path, 0, std::string("cannot write: ") + std::strerror(error),
                      error == ENOENT ? "does the directory exist?" : "");
  }
  return OutputFile(std::move(path), std::move(temporary), descriptor);
}

void OutputFile::write(std::string_view text) {
  buffer_.append(text);
  if (buffer_.size() >= kBufferSize) flush();
}

void OutputFile::flush() {
  std::string_view rest = buffer_;
  while (error_ == 0 && !rest.empty()) {
    const ssize_t written = ::write(descriptor_, rest.data(), rest.size());
    if (written >= 0) {
      rest.remove_prefix(static_cast<std::size_t>(written));
    } else if (errno != EINTR) {
      error_ = errno;
    }
  }
  buffer_.clear();
}

Result<void> OutputFile::commit() {
  flush();
  if (::close(std::exchange(descriptor_, -1)) != 0 && error_ == 0) error_ = errno;
  if (error_ == 0 && std::rename(temporary_.c_str(), path_.c_str()) != 0) error_ = errno;
  if (error_ == 0) return {};
  ::unlink(temporary_.c_str());
  return file_error(path_, 0, std::string("cannot write: ") + std::strerror(error_));
}

Result<std::string> read_file(const std::string &path, std::size_t most) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return file_error(path, 0, std::string("cannot open: ") + std::strerror(errno));
  std::string text;
  struct stat status {};
  const bool known = ::fstat(descriptor, &status) == 0;
  if (known && S_ISCHR(status.st_mode)) {  // /dev/zero has no end
    ::close(descriptor);
    return file_error(path, 0, "is a device, not a file");
  }
  if (known && status.st_size > 0) {
    text.reserve(std::min(static_cast<std::size_t>(status.st_size), most));
  }
  std::string block(kBufferSize, '\0');
  ssize_t count = 0;
  while ((count = ::read(descriptor, block.data(), block.size())) != 0) {
    if (count > 0 && static_cast<std::size_t>(count) > most - text.size()) {
      ::close(descriptor);
      return file_error(path, 0, "is longer than " + std::to_string(most >> 20U) + " MiB");
    }
    if (count > 0) {
      text.append(block, 0, static_cast<std::size_t>(count));
    } else if (errno != EINTR) {
      const int error = errno;
      ::close(descriptor);
      return file_error(path, 0, std::string("cannot read: ") + std::strerror(error));
    }
  }
  ::close(descriptor);
  return text;
}

}  // namespace redag::trace
