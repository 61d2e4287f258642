// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/live/reader.hpp"

#include <dirent.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <cstring>
#include <optional>
#include <string_view>
#include <system_error>
#include <thread>

namespace redag::live {
namespace {

using page::DagRow;
using page::FrameHeader;
using page::Header;
using page::TaskRow;

constexpr std::uint64_t kMostBytes = std::uint64_t{64} << 20U;
constexpr std::uint32_t kMostRow = 4096;
constexpr auto kPause = std::chrono::milliseconds(2);

class File {
 public:
  // O_NONBLOCK, because a pipe can have the name of a page.
  explicit File(const std::string &path)
      : descriptor_(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK)) {}
  ~File() {
    if (descriptor_ >= 0) ::close(descriptor_);
  }
  File(const File &) = delete;
  File &operator=(const File &) = delete;

  [[nodiscard]] bool is_open() const { return descriptor_ >= 0; }
  [[nodiscard]] bool inspect(struct stat &info) const { return ::fstat(descriptor_, &info) == 0; }

  /// Returns false if there are too few bytes. Reads instead of mapping: a page truncated meanwhile would kill us
  /// (SIGBUS).
  [[nodiscard]] bool read(void *target, std::size_t size, std::uint64_t offset) const {
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

 private:
  int descriptor_;
};

tl::unexpected<Diagnostics> damaged(const std::string &path, const char *what) {
  return make_error(fmt::format("{} is not a live page: {}", path, what), "was it written by another program?");
}

/// Returns UTF-8 that a terminal prints unchanged; all other bytes become '?'.
std::string printable(std::string_view text) {
  std::string result;
  for (std::size_t i = 0; i < text.size();) {
    const auto byte = [&](std::size_t at) { return static_cast<unsigned char>(text[at]); };
    const unsigned char first = byte(i);
    const std::size_t length = first < 0x80                    ? 1
                               : first >= 0xc2 && first < 0xe0 ? 2
                               : first < 0xe0                  ? 0
                               : first < 0xf0                  ? 3
                               : first < 0xf5                  ? 4
                                                               : 0;
    bool good = length > 0 && i + length <= text.size() && first >= 0x20 && first != 0x7f;
    for (std::size_t k = 1; good && k < length; ++k) good = (byte(i + k) & 0xc0U) == 0x80;
    if (good && first == 0xc2 && byte(i + 1) < 0xa0) good = false;   // a control character
    if (good && first == 0xe0 && byte(i + 1) < 0xa0) good = false;   // an overlong form
    if (good && first == 0xed && byte(i + 1) >= 0xa0) good = false;  // a surrogate
    if (good && first == 0xf0 && byte(i + 1) < 0x90) good = false;
    if (good && first == 0xf4 && byte(i + 1) >= 0x90) good = false;
    // Directional marks and similar ones (U+200E .. U+202E, U+2066 .. U+2069) would reverse the text beside them.
    if (good && first == 0xe2 &&
        ((byte(i + 1) == 0x80 && byte(i + 2) >= 0x8b && byte(i + 2) <= 0xaf) ||
         (byte(i + 1) == 0x81 && byte(i + 2) >= 0xa0))) {
      good = false;
    }
    result += good ? text.substr(i, length) : "?";
    i += good ? length : 1;
  }
  return result;
}

template <std::size_t Size>
std::string get_name(const char (&name)[Size]) {
  return printable({name, static_cast<std::size_t>(std::find(name, name + Size, '\0') - name)});
}

bool is_duration(std::int64_t value) { return value >= 0 && value <= kMaxDuration; }

bool is_plausible(const page::Figures &figures) {
  return is_duration(figures.cpu) && is_duration(figures.response_p50) && is_duration(figures.response_p99) &&
         is_duration(figures.response_max) && is_duration(figures.recent_cpu) && is_duration(figures.recent_p50) &&
         is_duration(figures.recent_p99) && is_duration(figures.recent_max);
}

/// Returns false if the row is not plausible. `tasks`: how many rows of tasks there are.
bool decode(const page::DeviceRow &row, std::uint32_t tasks, DeviceFrame &device) {
  device.name = get_name(row.name);
  device.slots = row.slots;
  device.used = row.used;
  device.queued = row.queued;
  device.served = row.served;
  device.recent_served = row.recent_served;
  device.busy = row.busy;
  device.recent_busy = row.recent_busy;
  bool plausible = row.slots > 0 && row.used <= row.slots && is_duration(row.busy) && is_duration(row.recent_busy);
  for (const std::uint32_t task : row.task) {
    if (task == page::kNoTask) continue;
    plausible = plausible && task < tasks;
    device.tasks.push_back(task);
  }
  return plausible;
}

std::optional<Diagnostics> problem_with(const File &file, const std::string &path, struct stat &info) {
  if (!file.is_open()) {
    const int error = errno;
    const bool hidden = error == EACCES || error == EPERM;
    return make_error(fmt::format("{}: {}", path, std::generic_category().message(error)),
                      hidden ? "it belongs to another user: run as that user or as root" : "")
        .value();
  }
  if (!file.inspect(info)) return make_error(fmt::format("{} cannot be inspected", path)).value();
  if (!S_ISREG(info.st_mode)) return damaged(path, "it is not a file").value();
  if (info.st_uid != ::geteuid() && info.st_uid != 0) {
    return make_error(fmt::format("{} is not read, because it belongs to user {}", path, info.st_uid),
                      "run as that user")
        .value();
  }
  constexpr mode_t kOthers = S_IRWXG | S_IRWXO;
  if ((info.st_mode & kOthers) != 0) {
    return make_error(fmt::format("{} is not read, because other users than its owner can open it", path),
                      "no executor creates such a page")
        .value();
  }
  return std::nullopt;
}

Result<Header> read_header(const File &file, const std::string &path, std::uint64_t file_size) {
  Header header{};
  if (!file.read(&header, sizeof(header), 0)) return damaged(path, "it is too short");
  if (std::memcmp(header.magic, page::kMagic, sizeof(header.magic)) != 0)
    return damaged(path, "its first bytes are wrong");
  if (header.version != page::kVersion) {
    return make_error(
        fmt::format("{} has version {}, but this program reads version {}", path, header.version, page::kVersion),
        "use the redag that the executor was built with");
  }
  const auto is_row = [](std::uint32_t size, std::size_t least) {
    return size >= least && size <= kMostRow && size % 8 == 0;
  };
  const bool sound =
      header.page_size <= kMostBytes && header.page_size <= file_size && header.header_size >= sizeof(Header) &&
      is_row(header.frame_header_size, page::kLeastFrameHeader) && is_row(header.dag_row_size, page::kLeastDagRow) &&
      is_row(header.task_row_size, page::kLeastTaskRow) && header.slot_offset <= header.page_size &&
      header.slot_size % 8 == 0 && header.slot_size >= header.frame_header_size &&
      header.slot_size <= (header.page_size - header.slot_offset) / 2;
  if (!sound) return damaged(path, "its sizes do not match");
  return header;
}

/// Returns the frame's bytes, checked; empty while it is being overwritten, or if it is damaged.
std::vector<std::byte> read_slot(const File &file, const Header &header, FrameHeader &frame) {
  const std::uint64_t offset = header.slot_offset + header.sequence % 2 * header.slot_size;
  const std::size_t known = std::min<std::size_t>(sizeof(frame), header.frame_header_size);
  if (!file.read(&frame, known, offset)) return {};
  const std::uint64_t size = header.frame_header_size + std::uint64_t{frame.dags} * header.dag_row_size +
                             std::uint64_t{frame.tasks} * header.task_row_size;
  if (size > header.slot_size) return {};
  std::vector<std::byte> bytes(size);
  if (!file.read(bytes.data(), size, offset)) return {};
  std::memcpy(&frame, bytes.data(), known);
  const std::uint64_t again = header.frame_header_size + std::uint64_t{frame.dags} * header.dag_row_size +
                              std::uint64_t{frame.tasks} * header.task_row_size;
  if (again != size) return {};
  const std::span<const std::byte> checked = std::span(bytes).subspan(sizeof(frame.checksum));
  if (page::checksum(checked) != frame.checksum || frame.sequence != header.sequence) return {};
  return bytes;
}

Result<Frame> decode(const std::string &path, const Header &header, const FrameHeader &head,
                     const std::vector<std::byte> &bytes) {
  Frame frame;
  frame.name = get_name(head.name);
  frame.program = get_name(head.program);
  frame.driver = get_name(head.driver);
  frame.preemption = get_name(head.preemption);
  frame.policy = get_name(head.policy);
  frame.workers = head.workers;
  frame.sequence = head.sequence;
  frame.began = head.began;
  frame.published = head.published;
  frame.interval = head.interval;
  frame.window = head.window;
  frame.publisher_cpu = head.publisher_cpu;
  frame.left_out = head.left_out;
  frame.alert = get_name(head.alert);
  frame.threads_in_all = head.threads_in_all;
  frame.devices_in_all = head.devices_in_all;
  bool plausible = head.threads <= page::kThreads && head.devices <= page::kDevices && is_duration(head.began) &&
                   is_duration(head.published) && is_duration(head.interval) && is_duration(head.window) &&
                   is_duration(head.publisher_cpu);
  for (std::uint32_t i = 0; plausible && i < head.threads; ++i) {
    const page::ThreadRow &row = head.thread[i];
    plausible =
        is_duration(row.used) && is_duration(row.recent_used) && (row.task < head.tasks || row.task == page::kNoTask);
    const auto task = row.task == page::kNoTask ? std::nullopt : std::optional(row.task);
    frame.threads.push_back({.index = row.index, .used = row.used, .recent_used = row.recent_used, .task = task});
  }
  for (std::uint32_t i = 0; plausible && i < head.devices; ++i) {
    plausible = decode(head.device[i], head.tasks, frame.devices.emplace_back());
  }
  const std::byte *at = bytes.data() + header.frame_header_size;
  for (std::uint32_t d = 0; d < head.dags; ++d, at += header.dag_row_size) {
    DagRow row{};
    std::memcpy(&row, at, std::min<std::size_t>(sizeof(row), header.dag_row_size));
    plausible = plausible && is_plausible(row.figures) && is_duration(row.deadline);
    frame.dags.push_back(DagFrame{.name = get_name(row.name),
                                  .max_active = row.max_active,
                                  .figures = row.figures,
                                  .deadline = row.deadline,
                                  .late = row.late,
                                  .recent_late = row.recent_late,
                                  .spread = row.spread});
  }
  for (std::uint32_t t = 0; t < head.tasks; ++t, at += header.task_row_size) {
    TaskRow row{};
    std::memcpy(&row, at, std::min<std::size_t>(sizeof(row), header.task_row_size));
    plausible = plausible && row.dag < head.dags && is_duration(row.period) && is_duration(row.deadline) &&
                is_duration(row.bound) && is_plausible(row.figures) && row.priority >= 0 && row.priority <= 99;
    frame.tasks.push_back(TaskFrame{.name = get_name(row.name),
                                    .dag = row.dag,
                                    .period = row.period,
                                    .deadline = row.deadline,
                                    .bound = row.bound,
                                    .figures = row.figures,
                                    .spread = row.spread,
                                    .priority = static_cast<int>(row.priority)});
  }
  if (!plausible) return damaged(path, "its figures are out of range");
  return frame;
}

/// Parses "redag.PID.N".
bool parse_name(std::string_view name, std::int64_t &pid, std::uint32_t &number) {
  constexpr std::string_view kPrefix = "redag.";
  if (name.substr(0, kPrefix.size()) != kPrefix) return false;
  const char *const end = name.data() + name.size();
  const auto first = std::from_chars(name.data() + kPrefix.size(), end, pid);
  if (first.ec != std::errc() || first.ptr == end || *first.ptr != '.' || pid <= 0) return false;
  const auto second = std::from_chars(first.ptr + 1, end, number);
  return second.ec == std::errc() && second.ptr == end;
}

struct Named {
  std::int64_t pid = 0;
  std::uint32_t number = 0;
};

std::vector<Named> named_pages(const std::string &folder) {
  std::vector<Named> found;
  DIR *directory = ::opendir(folder.c_str());
  if (directory == nullptr) return found;
  while (const dirent *entry = ::readdir(directory)) {
    Named named;
    if (parse_name(entry->d_name, named.pid, named.number)) found.push_back(named);
  }
  ::closedir(directory);
  std::sort(found.begin(), found.end(),
            [](const Named &a, const Named &b) { return a.pid != b.pid ? a.pid < b.pid : a.number < b.number; });
  return found;
}

/// Removes the page if it can be trusted and its process is dead.
bool remove_if_stale(const std::string &path) {
  const File file(path);
  struct stat info {};
  if (problem_with(file, path, info)) return false;
  const Result<Header> header = read_header(file, path, static_cast<std::uint64_t>(info.st_size));
  if (!header || life_of({header->pid, header->process_start, header->pid_namespace}) != Life::Dead) return false;
  // Another process may have taken the name meanwhile; its page stays.
  struct stat now {};
  if (::lstat(path.c_str(), &now) != 0 || now.st_ino != info.st_ino || now.st_dev != info.st_dev) return false;
  return ::unlink(path.c_str()) == 0;
}

}  // namespace

Result<Page> read_page(const std::string &path, int tries) {
  const File file(path);
  struct stat info {};
  if (auto problem = problem_with(file, path, info)) return tl::unexpected<Diagnostics>(*std::move(problem));
  for (int i = 0; i < tries; ++i) {
    if (i > 0) std::this_thread::sleep_for(kPause);
    const Result<Header> header = read_header(file, path, static_cast<std::uint64_t>(info.st_size));
    if (!header) return tl::unexpected<Diagnostics>(header.error());
    if (header->sequence == 0) continue;  // the first frame is being written
    FrameHeader head{};
    const std::vector<std::byte> bytes = read_slot(file, *header, head);
    if (bytes.empty()) continue;
    Result<Frame> frame = decode(path, *header, head, bytes);
    if (!frame) return tl::unexpected<Diagnostics>(std::move(frame.error()));
    return Page{{header->pid, header->process_start, header->pid_namespace}, *std::move(frame)};
  }
  return damaged(path, "it has no complete frame");
}

std::vector<Listed> list_pages(const std::string &folder) {
  (void)remove_stale_pages(folder);
  std::vector<Listed> listed;
  for (const Named &named : named_pages(folder)) {
    const std::string path = page_path(folder, named.pid, named.number);
    listed.push_back(Listed{path, named.pid, named.number, read_page(path)});
  }
  return listed;
}

std::size_t remove_stale_pages(const std::string &folder) {
  std::size_t removed = 0;
  for (const Named &named : named_pages(folder)) {
    if (remove_if_stale(page_path(folder, named.pid, named.number))) ++removed;
  }
  return removed;
}

std::string page_path(const std::string &folder, std::int64_t pid, std::uint32_t number) {
  return fmt::format("{}/redag.{}.{}", folder, pid, number);
}

}  // namespace redag::live
