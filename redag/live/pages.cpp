// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/live/pages.hpp"

#include <dirent.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <string_view>
#include <system_error>
#include <tuple>
#include <utility>

#include "redag/live/process.hpp"

namespace redag::live {
namespace {

constexpr std::uint64_t kMostBytes = std::uint64_t{64} << 20U;
constexpr std::uint32_t kMostRow = 4096;

/// Parses "redag.PID.N".
bool parse_name(std::string_view name, PageName &page) {
  constexpr std::string_view kPrefix = "redag.";
  if (name.substr(0, kPrefix.size()) != kPrefix) return false;
  const char *const end = name.data() + name.size();
  const auto first = std::from_chars(name.data() + kPrefix.size(), end, page.pid);
  if (first.ec != std::errc() || first.ptr == end || *first.ptr != '.' || page.pid <= 0) return false;
  const auto second = std::from_chars(first.ptr + 1, end, page.number);
  return second.ec == std::errc() && second.ptr == end;
}

/// Removes the page if it can be trusted and its process is dead.
bool remove_if_stale(const std::string &path) {
  const Result<PageFile> file = PageFile::open(path);
  if (!file) return false;
  const Result<page::Header> header = file->header();
  if (!header || life_of({header->pid, header->process_start, header->pid_namespace}) != Life::Dead) return false;
  // Another process may have taken the name meanwhile; its page stays.
  return file->has_name() && ::unlink(path.c_str()) == 0;
}

}  // namespace

// O_NONBLOCK, because a pipe can have the name of a page.
Result<PageFile> PageFile::open(const std::string &path) {
  PageFile file(path, ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK));
  if (file.descriptor_ < 0) {
    const int error = errno;
    const bool hidden = error == EACCES || error == EPERM;
    return make_error(fmt::format("{}: {}", path, std::generic_category().message(error)),
                      hidden ? "it belongs to another user: run as that user or as root" : "");
  }
  struct stat info {};
  if (::fstat(file.descriptor_, &info) != 0) return make_error(fmt::format("{} cannot be inspected", path));
  if (!S_ISREG(info.st_mode)) return file.damaged("it is not a file");
  if (info.st_uid != ::geteuid() && info.st_uid != 0) {
    return make_error(fmt::format("{} is not read, because it belongs to user {}", path, info.st_uid),
                      "run as that user");
  }
  constexpr mode_t kOthers = S_IRWXG | S_IRWXO;
  if ((info.st_mode & kOthers) != 0) {
    return make_error(fmt::format("{} is not read, because other users than its owner can open it", path),
                      "no executor creates such a page");
  }
  file.size_ = static_cast<std::uint64_t>(info.st_size);
  file.inode_ = info.st_ino;
  file.device_ = info.st_dev;
  return file;
}

PageFile::PageFile(PageFile &&other) noexcept
    : path_(std::move(other.path_)),
      descriptor_(std::exchange(other.descriptor_, -1)),
      size_(other.size_),
      inode_(other.inode_),
      device_(other.device_) {}

PageFile::~PageFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

bool PageFile::read(void *target, std::size_t size, std::uint64_t offset) const {
  auto *to = static_cast<std::byte *>(target);
  while (size > 0) {
    const ssize_t got = ::pread(descriptor_, to, size, static_cast<off_t>(offset));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return false;
    to += got;
    offset += static_cast<std::uint64_t>(got);
    size -= static_cast<std::size_t>(got);
  }
  return true;
}

Result<page::Header> PageFile::header() const {
  page::Header header{};
  if (!read(&header, sizeof(header), 0)) return damaged("it is too short");
  if (std::memcmp(header.magic, page::kMagic, sizeof(header.magic)) != 0) return damaged("its first bytes are wrong");
  if (header.version != page::kVersion) {
    return make_error(
        fmt::format("{} has version {}, but this program reads version {}", path_, header.version, page::kVersion),
        "use the redag that the executor was built with");
  }
  const auto is_row = [](std::uint32_t size, std::size_t least) {
    return size >= least && size <= kMostRow && size % 8 == 0;
  };
  const bool sound =
      header.page_size <= kMostBytes && header.page_size <= size_ && header.header_size >= sizeof(header) &&
      is_row(header.frame_header_size, page::kLeastFrameHeader) && is_row(header.dag_row_size, page::kLeastDagRow) &&
      is_row(header.task_row_size, page::kLeastTaskRow) && header.slot_offset <= header.page_size &&
      header.slot_size % 8 == 0 && header.slot_size >= header.frame_header_size &&
      header.slot_size <= (header.page_size - header.slot_offset) / 2;
  if (!sound) return damaged("its sizes do not match");
  return header;
}

tl::unexpected<Diagnostics> PageFile::damaged(const char *what) const {
  return make_error(fmt::format("{} is not a live page: {}", path_, what), "was it written by another program?");
}

bool PageFile::has_name() const {
  struct stat now {};
  return ::lstat(path_.c_str(), &now) == 0 && now.st_ino == inode_ && now.st_dev == device_;
}

std::string page_path(const std::string &folder, std::int64_t pid, std::uint32_t number) {
  return fmt::format("{}/redag.{}.{}", folder, pid, number);
}

std::vector<PageName> named_pages(const std::string &folder) {
  std::vector<PageName> found;
  DIR *directory = ::opendir(folder.c_str());
  if (directory == nullptr) return found;
  while (const dirent *entry = ::readdir(directory)) {
    PageName page;
    if (parse_name(entry->d_name, page)) found.push_back(page);
  }
  ::closedir(directory);
  std::sort(found.begin(), found.end(),
            [](const PageName &a, const PageName &b) { return std::tie(a.pid, a.number) < std::tie(b.pid, b.number); });
  return found;
}

std::size_t remove_stale_pages(const std::string &folder) {
  std::size_t removed = 0;
  for (const PageName &named : named_pages(folder)) {
    if (remove_if_stale(page_path(folder, named.pid, named.number))) ++removed;
  }
  return removed;
}

}  // namespace redag::live
