// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/trace/flight_recorder.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <condition_variable>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "redag/base/blocked_signals.hpp"
#include "redag/base/lock_guard.hpp"
#include "redag/base/mutex.hpp"
#include "redag/base/text.hpp"
#include "redag/model/validate.hpp"
#include "redag/trace/output_file.hpp"
#include "redag/trace/run_info_json.hpp"

namespace redag::trace {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kFormat = "redag.flight/1";
constexpr std::size_t kBlockBytes = 4096;  // a page: if the process is killed, it is either the old or the new one

struct FlightHeader {
  std::uint32_t crc = 0;       // of all later bytes in the block
  std::uint32_t count = 0;     // number of its events
  std::uint64_t sequence = 0;  // number of the block, from 1
  std::uint64_t first = 0;     // number of events before this block
  std::uint64_t lost = 0;      // number of events that the rings had lost by then
};
static_assert(sizeof(FlightHeader) == sizeof(JobEvent));

constexpr std::size_t kBlockEvents = (kBlockBytes - sizeof(FlightHeader)) / sizeof(JobEvent);

struct Block {
  FlightHeader header;
  std::array<JobEvent, kBlockEvents> events;
};
static_assert(sizeof(Block) == kBlockBytes);

std::uint32_t checksum(const Block &block) {
  // The layout is the file's: covers all bytes after the checksum.
  std::array<unsigned char, kBlockBytes> bytes;
  std::memcpy(bytes.data(), &block, bytes.size());
  constexpr std::size_t kSkipped = sizeof(FlightHeader::crc);
  return static_cast<std::uint32_t>(crc32(0, bytes.data() + kSkipped, static_cast<uInt>(bytes.size() - kSkipped)));
}

std::string info_path(const std::string &folder) { return folder + "/run.json"; }
std::string events_path(const std::string &folder) { return folder + "/events.bin"; }

tl::unexpected<Diagnostics> system_error(const std::string &file, const char *what, int error) {
  return file_error(file, 0, std::string(what) + ": " + std::strerror(error));
}

Result<void> write_info(const std::string &folder, const RunInfo &info, std::span<const std::uint32_t> positions) {
  Diagnostics mistakes = validate(info.workload, {.wcet_optional = true, .waits = true});
  if (has_errors(mistakes)) return tl::unexpected<Diagnostics>(std::move(mistakes));
  Result<OutputFile> file = OutputFile::create(info_path(folder));
  if (!file) return tl::unexpected<Diagnostics>(std::move(file.error()));
  file->write(run_header_to_json(kFormat, info) + "\n");
  if (!positions.empty()) file->write(nlohmann::json(positions).dump() + "\n");
  return file->commit();
}

void sync_path(const std::string &path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return;
  static_cast<void>(::fsync(descriptor));
  ::close(descriptor);
}

// Closes the descriptor at the end of its scope.
class Descriptor {
 public:
  explicit Descriptor(int value) : value_(value) {}
  Descriptor(Descriptor &&other) noexcept : value_(std::exchange(other.value_, -1)) {}
  Descriptor &operator=(Descriptor &&) = delete;
  Descriptor(const Descriptor &) = delete;
  Descriptor &operator=(const Descriptor &) = delete;
  ~Descriptor() {
    if (value_ >= 0) ::close(value_);
  }
  [[nodiscard]] int get() const { return value_; }

 private:
  int value_;
};

}  // namespace

// ---- writing ----

class FlightRecorder::Impl {
 public:
  Impl(std::string folder, Descriptor file, const FlightOptions &options)
      : folder_(std::move(folder)),
        file_(std::move(file)),
        capacity_(std::max<std::uint64_t>(2, options.most_bytes / kBlockBytes)),
        sync_every_(options.sync_every),
        syncer_(start_syncer()) {}
  Impl(const Impl &) = delete;
  Impl &operator=(const Impl &) = delete;
  ~Impl() {
    {
      const LockGuard guard(lock_);
      stop_ = true;
    }
    changed_.notify_all();
    syncer_.join();
  }

  Result<void> describe(const RunInfo &info, std::span<const std::uint32_t> positions) {
    Result<void> written = write_info(folder_, info, positions);
    if (written) note_news(true);
    return written;
  }

  Result<void> append(std::span<const JobEvent> events, std::uint64_t lost) {
    if (broken_ || (events.empty() && lost == lost_)) return {};
    lost_ = lost;
    blocks_.clear();
    do {
      const std::size_t count = std::min(events.size(), kBlockEvents);
      Block &block = blocks_.emplace_back();
      std::copy_n(events.begin(), count, block.events.begin());
      block.header = {
          .count = static_cast<std::uint32_t>(count), .sequence = ++sequence_, .first = first_, .lost = lost};
      block.header.crc = checksum(block);
      first_ += count;
      events = events.subspan(count);
    } while (!events.empty());
    return write_blocks();
  }

 private:
  // Writes adjacent blocks in one call. The place of a block is (its sequence number - 1) modulo the capacity.
  Result<void> write_blocks() {
    std::uint64_t sequence = sequence_ - blocks_.size() + 1;
    for (std::span<const Block> rest = blocks_; !rest.empty();) {
      const std::uint64_t place = (sequence - 1) % capacity_;
      const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(rest.size(), capacity_ - place));
      if (const int error = write_whole(std::as_bytes(rest.first(count)), place * kBlockBytes); error != 0) {
        broken_ = true;
        return system_error(events_path(folder_), "cannot write", error);
      }
      rest = rest.subspan(count);
      sequence += count;
    }
    note_news(false);
    return {};
  }

  int write_whole(std::span<const std::byte> bytes, std::uint64_t offset) const {
    while (!bytes.empty()) {
      const ssize_t written = ::pwrite(file_.get(), bytes.data(), bytes.size(), static_cast<off_t>(offset));
      if (written < 0 && errno == EINTR) continue;
      if (written < 0) return errno;
      bytes = bytes.subspan(static_cast<std::size_t>(written));
      offset += static_cast<std::uint64_t>(written);
    }
    return 0;
  }

  void note_news(bool of_info) {
    {
      const LockGuard guard(lock_);
      news_ = true;
      info_news_ = info_news_ || of_info;
    }
    changed_.notify_all();
  }

  std::thread start_syncer() {
    const BlockedSignals inherited;
    return std::thread([this] { keep_in_sync(); });
  }

  // The disk can take long, and the appending thread must not wait for it.
  void keep_in_sync() {
    for (;;) {
      bool with_info = false;
      {
        const LockGuard guard(lock_);
        while (!stop_ && !news_) changed_.wait(lock_);
        if (!news_) return;
        news_ = false;
        with_info = std::exchange(info_news_, false);
      }
      static_cast<void>(::fdatasync(file_.get()));
      if (with_info) {
        sync_path(info_path(folder_));
        sync_path(folder_);
      }
      const LockGuard guard(lock_);
      const auto until = std::chrono::steady_clock::now() + std::chrono::nanoseconds(sync_every_);
      while (!stop_ && changed_.wait_until(lock_, until) == std::cv_status::no_timeout) {
      }
    }
  }

  std::string folder_;
  Descriptor file_;
  std::uint64_t capacity_;  // in blocks
  Duration sync_every_;
  std::uint64_t sequence_ = 0;  // number of the last block
  std::uint64_t first_ = 0;     // number of events so far
  std::uint64_t lost_ = 0;
  std::vector<Block> blocks_;
  bool broken_ = false;

  Mutex lock_;
  std::condition_variable_any changed_;
  bool stop_ REDAG_GUARDED_BY(lock_) = false;
  bool news_ REDAG_GUARDED_BY(lock_) = true;       // there are blocks that are not on the disk yet
  bool info_news_ REDAG_GUARDED_BY(lock_) = true;  // the description of the run is not on the disk yet
  std::thread syncer_;                             // last: it uses the members above
};

Result<FlightRecorder> FlightRecorder::create(const std::string &folder, const RunInfo &info,
                                              const FlightOptions &options, std::span<const std::uint32_t> positions) {
  if (::mkdir(folder.c_str(), 0777) != 0) {
    const int error = errno;
    if (error != EEXIST) return system_error(folder, "cannot create the folder", error);
    if (has_flight_record(folder)) {
      return file_error(folder, 0, "the folder holds the record of an earlier run that did not end normally",
                        "restore its results with 'redag recover', or choose another folder");
    }
  }
  if (Result<void> written = write_info(folder, info, positions); !written)
    return tl::unexpected<Diagnostics>(std::move(written.error()));
  const std::string path = events_path(folder);
  Descriptor file(::open(path.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0666));
  if (file.get() < 0) return system_error(path, "cannot write", errno);
  // While this process lives, no other process can take the record for that of an ended run.
  if (::flock(file.get(), LOCK_EX | LOCK_NB) != 0) return system_error(path, "cannot lock", errno);
  try {
    return FlightRecorder(std::make_unique<Impl>(folder, std::move(file), options));
  } catch (const std::system_error &error) {
    return file_error(folder, 0, std::string("cannot start the recorder's thread: ") + error.what());
  }
}

FlightRecorder::FlightRecorder(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
FlightRecorder::FlightRecorder(FlightRecorder &&) noexcept = default;
FlightRecorder::~FlightRecorder() = default;

Result<void> FlightRecorder::describe(const RunInfo &info, std::span<const std::uint32_t> positions) {
  return impl_->describe(info, positions);
}

Result<void> FlightRecorder::append(std::span<const JobEvent> events, std::uint64_t lost_events) {
  return impl_->append(events, lost_events);
}

// ---- reading ----

namespace {

struct Description {
  RunInfo info;
  std::vector<std::uint32_t> positions;  // of tasks, by the events' ids; empty: ids are positions
};

Result<Description> read_info(const std::string &folder) {
  const std::string path = info_path(folder);
  if (!has_flight_record(folder)) {
    return file_error(path, 0, "the folder holds no record of a run",
                      "'redag run --out DIR' records into DIR/flight while it runs, and deletes the record at the end");
  }
  const Result<std::string> text = read_file(path, kMaxInfoBytes);
  if (!text) return tl::unexpected<Diagnostics>(text.error());
  const std::size_t line = text->find('\n');
  Result<RunInfo> info =
      run_header_from_json(std::string_view(*text).substr(0, line), kFormat, "a flight record", path);
  if (!info) return tl::unexpected<Diagnostics>(std::move(info.error()));
  Description found{std::move(*info), {}};
  const std::string_view rest = line == std::string::npos ? "" : std::string_view(*text).substr(line + 1);
  if (rest.empty()) return found;
  const nlohmann::json positions =
      json_is_too_large(rest) ? nlohmann::json() : nlohmann::json::parse(rest, nullptr, false);
  const std::size_t tasks = found.info.workload.task_count();
  const auto is_position = [tasks](const nlohmann::json &entry) {
    return entry.is_number_unsigned() && entry.get<std::uint64_t>() < tasks;
  };
  if (!positions.is_array() || !std::all_of(positions.begin(), positions.end(), is_position)) {
    return file_error(path, 2, "the second line must list the positions of tasks in the workload");
  }
  found.positions = positions.get<std::vector<std::uint32_t>>();
  return found;
}

// Returns all whole blocks of the file in the order in which they were written. `damaged` counts the others.
Result<std::vector<Block>> read_blocks(const std::string &path, std::uint64_t &damaged) {
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (file.get() < 0) return system_error(path, "cannot open", errno);
  if (::flock(file.get(), LOCK_SH | LOCK_NB) != 0) {
    return file_error(path, 0, "the run is still in progress and writes its record",
                      "wait for the end of the run; 'redag top' shows it until then");
  }
  const Result<std::string> bytes = read_file(path);
  if (!bytes) return tl::unexpected<Diagnostics>(bytes.error());
  std::vector<Block> blocks(bytes->size() / kBlockBytes);
  if (!blocks.empty()) std::memcpy(blocks.data(), bytes->data(), blocks.size() * kBlockBytes);
  const auto is_damaged = [](const Block &block) {
    return block.header.count > kBlockEvents || block.header.sequence == 0 || block.header.crc != checksum(block);
  };
  damaged = std::erase_if(blocks, is_damaged) + (bytes->size() % kBlockBytes != 0 ? 1 : 0);
  std::sort(blocks.begin(), blocks.end(),
            [](const Block &a, const Block &b) { return a.header.sequence < b.header.sequence; });
  return blocks;
}

// Returns the event with the workload's task id, or nothing if it cannot belong to this run.
std::optional<JobEvent> read_event(JobEvent event, const Description &run, std::size_t tasks, Time not_before) {
  if (!run.positions.empty()) {
    if (event.task.value >= run.positions.size()) return std::nullopt;
    event.task = TaskId(run.positions[event.task.value]);
  }
  const bool is_plausible = has_valid_times(event) && event.time >= not_before && event.task.value < tasks &&
                            event.kind <= kLastJobEventKind && event.reason <= kLastReason &&
                            (event.worker == WorkerId::kNoneValue || event.worker < kMaxWorkers);
  return is_plausible ? std::optional(event) : std::nullopt;
}

}  // namespace

Result<Recovered> recover(const std::string &folder, Time end_of_run) {
  Result<Description> run = read_info(folder);
  if (!run) return tl::unexpected<Diagnostics>(std::move(run.error()));
  Recovered found;
  found.trace.info = run->info;
  const Result<std::vector<Block>> blocks = read_blocks(events_path(folder), found.damaged);
  if (!blocks) return tl::unexpected<Diagnostics>(blocks.error());

  // A gap ends the record, because later events cannot be judged without the missing ones.
  std::vector<JobEvent> &events = found.trace.events;
  const std::size_t tasks = found.trace.info.workload.task_count();
  std::uint64_t lost = 0;
  for (std::size_t i = 0; i < blocks->size(); ++i) {
    const Block &block = (*blocks)[i];
    if (i == 0) found.overwritten = block.header.first;
    if (i > 0 && block.header.sequence != (*blocks)[i - 1].header.sequence + 1) {
      found.damaged += block.header.sequence - (*blocks)[i - 1].header.sequence - 1;
      break;
    }
    lost = block.header.lost;
    for (const JobEvent &recorded : std::span(block.events).first(block.header.count)) {
      const auto event = read_event(recorded, *run, tasks, events.empty() ? -kMaxTraceTime : events.back().time);
      if (!event) {
        return file_error(events_path(folder), 0, "its events do not belong to the run that run.json describes");
      }
      events.push_back(*event);
    }
  }
  if (end_of_run != kNever) {
    found.trace.info.end = end_of_run;
  } else if (!events.empty()) {
    // The last instant may be incomplete.
    const Time end = events.back().time;
    found.trace.info.end = end;
    std::erase_if(events, [end](const JobEvent &event) { return event.time == end; });
  } else {
    found.trace.info.end = found.trace.info.start;
  }
  found.trace.info.lost_events = lost + found.overwritten;
  return found;
}

bool has_flight_record(const std::string &folder) {
  std::error_code ignored;
  return fs::exists(info_path(folder), ignored) || fs::exists(events_path(folder), ignored);
}

Result<std::string> move_record_aside(const std::string &folder) {
  if (!has_flight_record(folder)) return std::string();
  std::string aside;
  std::error_code error;
  for (int number = 1; aside.empty() || fs::exists(aside, error); ++number) {
    aside = folder + "." + std::to_string(number);
  }
  fs::rename(folder, aside, error);
  if (error) return file_error(folder, 0, "cannot rename to '" + aside + "': " + error.message());
  return aside;
}

Result<void> remove_flight_record(const std::string &folder) {
  for (const std::string &path : {events_path(folder), info_path(folder)}) {
    if (::unlink(path.c_str()) != 0 && errno != ENOENT) return system_error(path, "cannot delete", errno);
  }
  if (::rmdir(folder.c_str()) != 0 && errno != ENOENT) return system_error(folder, "cannot delete", errno);
  return {};
}

}  // namespace redag::trace
