// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "tests/fuzz/scratch_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>

#include "redag/base/check.hpp"

namespace redag::fuzz {
namespace {

class Folder {
 public:
  Folder() {
    path_ = (::access("/dev/shm", W_OK) == 0 ? "/dev/shm" : "/tmp") + std::string("/redag_fuzz_XXXXXX");
    REDAG_CHECK(::mkdtemp(path_.data()) != nullptr, "a folder for files can be made");
  }
  ~Folder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  Folder(const Folder &) = delete;
  Folder &operator=(const Folder &) = delete;

  [[nodiscard]] const std::string &path() const { return path_; }

 private:
  std::string path_;
};

}  // namespace

const std::string &scratch_folder() {
  static const Folder folder;
  return folder.path();
}

std::string scratch_file(std::string_view name, std::string_view content) {
  std::string path = scratch_folder() + "/" + std::string(name);
  const int descriptor = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, S_IRUSR | S_IWUSR);
  REDAG_CHECK(descriptor >= 0, "a file in the process's own folder can be made");
  while (!content.empty()) {
    const ssize_t written = ::write(descriptor, content.data(), content.size());
    REDAG_CHECK(written > 0, "a file in the process's own folder can be written");
    content.remove_prefix(static_cast<std::size_t>(written));
  }
  ::close(descriptor);
  return path;
}

}  // namespace redag::fuzz
