// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/trace/output_file.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <utility>

#include "redag/loader/text_file.hpp"

namespace redag::trace {
namespace {

constexpr std::size_t kBufferSize = std::size_t{1} << 20U;

std::string unnamed_path(int descriptor) { return "/proc/self/fd/" + std::to_string(descriptor); }

// Opens a file without a name in the directory of `path`. Returns -1 if that is not possible, or could not be named
// later.
int open_unnamed(const std::string &path) {
  const std::size_t slash = path.rfind('/');
  const std::string directory = slash == std::string::npos ? "." : path.substr(0, slash + 1);
  const int descriptor = ::open(directory.c_str(), O_WRONLY | O_TMPFILE | O_CLOEXEC, 0666);
  if (descriptor < 0 || ::access(unnamed_path(descriptor).c_str(), F_OK) == 0) return descriptor;
  ::close(descriptor);
  return -1;
}

}  // namespace

OutputFile::OutputFile(std::string path, int descriptor, Name name)
    : path_(std::move(path)), descriptor_(descriptor), name_(name) {
  buffer_.reserve(kBufferSize + kBufferSize / 16);
}

OutputFile::OutputFile(OutputFile &&other) noexcept
    : path_(std::move(other.path_)),
      descriptor_(std::exchange(other.descriptor_, -1)),
      name_(std::exchange(other.name_, Name::None)),
      error_(other.error_),
      buffer_(std::move(other.buffer_)) {}

OutputFile::~OutputFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
  if (name_ == Name::Temporary) ::unlink(temporary().c_str());
}

std::string OutputFile::temporary() const { return path_ + ".tmp." + std::to_string(::getpid()); }

Result<OutputFile> OutputFile::create(std::string path) {
  if (const int descriptor = open_unnamed(path); descriptor >= 0)
    return OutputFile(std::move(path), descriptor, Name::None);
  OutputFile file(std::move(path), -1, Name::None);
  file.descriptor_ = ::open(file.temporary().c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (file.descriptor_ < 0) {
    const int error = errno;
    return file_error(file.path_, 0, std::string("cannot write: ") + std::strerror(error),
                      error == ENOENT ? "does the directory exist?" : "");
  }
  file.name_ = Name::Temporary;
  return file;
}

Result<OutputFile> OutputFile::grow(std::string path) {
  // A reader keeps the file that it has opened.
  ::unlink(path.c_str());
  const int descriptor = ::open(path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  OutputFile file(std::move(path), descriptor, Name::Final);
  if (descriptor < 0 || ::flock(descriptor, LOCK_EX | LOCK_NB) != 0) file.fail();
  if (const Result<void> made = file.state(); !made) return tl::unexpected<Diagnostics>(made.error());
  return file;
}

void OutputFile::write(std::string_view text) {
  buffer_.append(text);
  if (buffer_.size() >= kBufferSize) write_out();
}

void OutputFile::write_out() {
  std::string_view rest = buffer_;
  while (error_ == 0 && !rest.empty()) {
    const ssize_t written = ::write(descriptor_, rest.data(), rest.size());
    if (written >= 0) {
      rest.remove_prefix(static_cast<std::size_t>(written));
    } else if (errno != EINTR) {
      fail();
    }
  }
  buffer_.clear();
}

// Keeps the first failure.
void OutputFile::fail() {
  if (error_ == 0) error_ = errno;
}

Result<void> OutputFile::state() const {
  if (error_ == 0) return {};
  return file_error(path_, 0, std::string("cannot write: ") + std::strerror(error_));
}

Result<void> OutputFile::flush() {
  write_out();
  return state();
}

void OutputFile::begin_sync() { ::sync_file_range(descriptor_, 0, 0, SYNC_FILE_RANGE_WRITE); }

void OutputFile::overwrite(std::uint64_t offset, std::string_view bytes) {
  write_out();
  if (error_ != 0) return;
  // A few bytes of a page that exists: the kernel writes them at once.
  const ssize_t written = ::pwrite(descriptor_, bytes.data(), bytes.size(), static_cast<off_t>(offset));
  if (written != static_cast<ssize_t>(bytes.size())) fail();
}

void OutputFile::discard(std::uint64_t from, std::uint64_t to) {
  if (error_ != 0 || from >= to) return;
  const auto length = static_cast<off_t>(to - from);
  if (::fallocate(descriptor_, FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, static_cast<off_t>(from), length) != 0)
    fail();
}

Result<void> OutputFile::commit() {
  write_out();
  const std::string temporary = this->temporary();
  if (error_ == 0 && name_ == Name::None) {
    ::unlink(temporary.c_str());  // of an earlier process with this id
    if (::linkat(AT_FDCWD, unnamed_path(descriptor_).c_str(), AT_FDCWD, temporary.c_str(), AT_SYMLINK_FOLLOW) != 0) {
      fail();
    } else {
      name_ = Name::Temporary;
    }
  }
  if (::close(std::exchange(descriptor_, -1)) != 0) fail();
  if (name_ == Name::Final) return state();
  if (error_ == 0 && std::rename(temporary.c_str(), path_.c_str()) != 0) fail();
  if (std::exchange(name_, Name::None) == Name::Temporary && error_ != 0) ::unlink(temporary.c_str());
  return state();
}

}  // namespace redag::trace
