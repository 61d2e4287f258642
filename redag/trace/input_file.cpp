// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/trace/input_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "redag/loader/text_file.hpp"

namespace redag::trace {

InputFile::InputFile(std::string_view bytes, std::string name)
    : name_(std::move(name)), size_(bytes.size()), bytes_(bytes) {}

InputFile::InputFile(InputFile &&other) noexcept
    : name_(std::move(other.name_)),
      descriptor_(std::exchange(other.descriptor_, -1)),
      size_(other.size_),
      owned_(std::move(other.owned_)),
      bytes_(other.bytes_),
      is_pipe_(other.is_pipe_) {}

InputFile::~InputFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

Result<InputFile> InputFile::open(const std::string &path) {
  struct stat status {};
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return file_error(path, 0, std::string("cannot open: ") + std::strerror(errno));
  if (::fstat(descriptor, &status) == 0 && S_ISREG(status.st_mode) && status.st_size > 0) {
    return InputFile(path, descriptor, static_cast<std::uint64_t>(status.st_size));
  }
  // A pipe must not be opened twice: its writer may have left in between.
  Result<std::string> all = read_rest(descriptor, path);
  ::close(descriptor);
  if (!all) return tl::unexpected<Diagnostics>(std::move(all.error()));
  InputFile file(path, -1, all->size());
  file.owned_ = *std::move(all);
  file.is_pipe_ = true;
  return file;
}

Result<std::string_view> InputFile::read(std::uint64_t offset, std::size_t count) {
  offset = std::min(offset, size_);
  count = static_cast<std::size_t>(std::min<std::uint64_t>(count, size_ - offset));
  if (descriptor_ < 0) return (is_pipe_ ? std::string_view(owned_) : bytes_).substr(offset, count);
  owned_.resize(count);
  std::size_t done = 0;
  while (done < count) {
    const ssize_t got = ::pread(descriptor_, owned_.data() + done, count - done, static_cast<off_t>(offset + done));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return file_error(name_, 0, std::string("cannot read: ") + std::strerror(errno));
    if (got == 0) break;  // the file was cut meanwhile
    done += static_cast<std::size_t>(got);
  }
  return std::string_view(owned_).substr(0, done);
}

}  // namespace redag::trace
