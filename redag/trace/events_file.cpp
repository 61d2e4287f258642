// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/trace/events_file.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstring>
#include <deque>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <system_error>
#include <type_traits>
#include <utility>

#include "redag/base/check.hpp"
#include "redag/base/text.hpp"
#include "redag/loader/text_file.hpp"
#include "redag/loader/validate.hpp"
#include "redag/trace/event_codec.hpp"
#include "redag/trace/input_file.hpp"
#include "redag/trace/output_file.hpp"
#include "redag/trace/run_info_json.hpp"

namespace redag::trace {
namespace {

constexpr std::string_view kFormat = "redag.events/2";
// The carriage return shows a copy that "corrected" the ends of lines.
constexpr std::string_view kMagic = "redag.events/2\r\n";
static_assert(kMagic.size() == 16);

enum class BlockKind : std::uint32_t {
  Run = 1,
  Events = 2,
  End = 3,
  SoFar = 4,  // the content of an End that is not the last
  Hole = 5,   // a header alone: `first` is the place of the next block, `base` counts the events that were replaced
};

// The layout is the file's, little-endian as the machine is.
struct BlockHeader {
  std::uint32_t crc = 0;  // of the header's later bytes and of those in the file
  BlockKind kind = BlockKind::Run;
  std::uint32_t bytes = 0;  // in the file, after the header
  std::uint32_t whole = 0;  // the same before they were compressed
  std::uint64_t first = 0;  // how many events stand before the block
  Time base = 0;            // of events: the time of the first one; of the end: the place of the last Run, 0: the first
};
static_assert(sizeof(BlockHeader) == 32 && std::is_trivially_copyable_v<BlockHeader>);
constexpr std::size_t kHeaderBytes = sizeof(BlockHeader);

// What the last block says about the whole.
struct EndBlock {
  std::uint64_t events = 0;
  Time end = 0;
  std::uint64_t lost_events = 0;
};
static_assert(sizeof(EndBlock) == 24);

constexpr std::uint64_t kFirstBlock = kMagic.size();
constexpr std::uint64_t kEndBytes = kHeaderBytes + sizeof(EndBlock);
// Level 6 takes five times as long, for 7 % fewer bytes (docs/evidence/large_inputs.md).
constexpr int kLevel = 1;

constexpr std::uint64_t kMostExpansion = 1032;  // of zlib: a block that claims more is a lie
// A description becomes trees of JSON and YAML, many times its size. The most regular ones expand some 60 times.
constexpr std::uint64_t kMostInfoExpansion = 100;

std::uint32_t checksum(const BlockHeader &header, std::string_view bytes) {
  std::array<unsigned char, kHeaderBytes> head;
  std::memcpy(head.data(), &header, head.size());
  constexpr std::size_t kSkipped = sizeof(BlockHeader::crc);
  const uLong begun = crc32(0, head.data() + kSkipped, static_cast<uInt>(head.size() - kSkipped));
  if (bytes.empty()) return static_cast<std::uint32_t>(begun);
  return static_cast<std::uint32_t>(
      crc32(begun, reinterpret_cast<const Bytef *>(bytes.data()), static_cast<uInt>(bytes.size())));
}

std::string_view bytes_of(const EndBlock &block) { return {reinterpret_cast<const char *>(&block), sizeof block}; }

// The first line of a description is the run; the second one, if there is any, the positions of tasks.
std::string description(const RunInfo &info, std::span<const std::uint32_t> positions) {
  std::string text = run_header_to_json(kFormat, info);
  if (!positions.empty()) text += "\n" + nlohmann::json(positions).dump();
  return text;
}

Result<void> check_workload(const RunInfo &info) {
  Diagnostics mistakes = validate(info.workload, {.wcet_optional = true, .waits = true});
  if (has_errors(mistakes)) return tl::unexpected<Diagnostics>(std::move(mistakes));
  return {};
}

Result<Trace> read_all(Result<EventsReader> reader, const std::string &file) {
  if (!reader) return tl::unexpected<Diagnostics>(std::move(reader.error()));
  Trace trace;
  trace.info = reader->info();
  std::vector<JobEvent> events;
  for (;;) {
    const Result<bool> more = reader->next(events);
    if (!more) return tl::unexpected<Diagnostics>(more.error());
    if (!*more) return trace;
    if (trace.events.size() + events.size() > kMostEventsInMemory) {
      return file_error(file, 0, "has more than " + std::to_string(kMostEventsInMemory) + " events",
                        "'redag events' reads files of any length");
    }
    trace.events.insert(trace.events.end(), events.begin(), events.end());
  }
}

}  // namespace

class EventsWriter::Impl {
 public:
  /// `most_bytes`: of a record; 0: the file appears when it is complete.
  Impl(OutputFile file, std::uint64_t most_bytes) : file_(std::move(file)), codec_(0), most_bytes_(most_bytes) {
    pending_.reserve(most_bytes > 0 ? 0 : kMostBlockEvents);
    file_.write(kMagic);
    if (most_bytes > 0) write_block(hole(), {});
  }

  void describe(const RunInfo &info, std::span<const std::uint32_t> positions) {
    write_events();
    codec_ = EventCodec(positions.empty() ? info.workload.task_count() : positions.size());
    description_ = description(info, positions);
    write_run();
  }

  void add(std::span<const JobEvent> events) {
    while (!events.empty()) {
      const std::size_t count = std::min(events.size(), kMostBlockEvents - pending_.size());
      pending_.insert(pending_.end(), events.begin(), events.begin() + static_cast<std::ptrdiff_t>(count));
      events = events.subspan(count);
      if (pending_.size() == kMostBlockEvents) write_events();
    }
  }

  Result<void> flush(std::uint64_t lost_events) {
    write_events();
    if (std::exchange(lost_, lost_events) != lost_events) {
      write_block({.kind = BlockKind::SoFar, .whole = sizeof(EndBlock), .first = count_},
                  bytes_of({count_, 0, lost_events}));
    }
    if (most_bytes_ > 0 && offset_ - start_ > most_bytes_) drop_oldest();
    if (!state_) return state_;
    if (Result<void> written = file_.flush(); !written) return written;
    const auto now = std::chrono::steady_clock::now();
    if (now - synced_ >= std::chrono::seconds(1)) {
      synced_ = now;
      file_.begin_sync();
    }
    return {};
  }

  Result<void> commit(Time end, std::uint64_t lost_events) {
    write_events();
    if (!state_) return state_;
    write_block({.kind = BlockKind::End, .whole = sizeof(EndBlock), .first = count_, .base = static_cast<Time>(run_)},
                bytes_of({count_, end, lost_events}));
    return file_.commit();
  }

 private:
  // A block of events.
  struct Place {
    std::uint64_t offset = 0;
    std::uint64_t first = 0;  // number of events before it
  };

  [[nodiscard]] BlockHeader hole() const {
    return {.kind = BlockKind::Hole, .first = start_, .base = static_cast<Time>(replaced_)};
  }

  // Keeps the newest blocks, and room for more.
  void drop_oldest() {
    while (places_.size() > 1 && offset_ - places_.front().offset > most_bytes_ / 4 * 3) places_.pop_front();
    if (places_.empty()) return;
    start_ = places_.front().offset;
    replaced_ = places_.front().first;
    if (run_ < start_) write_run();
    const BlockHeader header = sealed(hole(), {});
    file_.overwrite(kFirstBlock, {reinterpret_cast<const char *>(&header), sizeof header});
    file_.discard(kFirstBlock + kHeaderBytes, start_);
  }

  void write_run() {
    run_ = offset_;
    write({.kind = BlockKind::Run, .first = count_}, description_);
  }

  void write_events() {
    if (pending_.empty()) return;
    if (!std::all_of(pending_.begin(), pending_.end(), [this](const auto &event) { return codec_.is_event(event); }))
      state_ = make_error("an event of another run cannot be recorded");
    if (!state_) return;
    code_.clear();
    const Time base = pending_.front().time;
    codec_.encode(pending_, base, code_);
    if (most_bytes_ > 0) places_.push_back({offset_, count_});
    write({.kind = BlockKind::Events, .first = count_, .base = base}, code_);
    count_ += pending_.size();
    pending_.clear();
  }

  void write(BlockHeader header, std::string_view whole) {
    uLongf size = compressBound(static_cast<uLong>(whole.size()));
    packed_.resize(size);
    const int status =
        compress2(reinterpret_cast<Bytef *>(packed_.data()), &size, reinterpret_cast<const Bytef *>(whole.data()),
                  static_cast<uLong>(whole.size()), kLevel);
    REDAG_CHECK(status == Z_OK, "the compressor has room");
    header.whole = static_cast<std::uint32_t>(whole.size());
    write_block(header, std::string_view(packed_).substr(0, size));
  }

  static BlockHeader sealed(BlockHeader header, std::string_view bytes) {
    header.bytes = static_cast<std::uint32_t>(bytes.size());
    header.crc = checksum(header, bytes);
    return header;
  }

  void write_block(BlockHeader header, std::string_view bytes) {
    header = sealed(header, bytes);
    file_.write({reinterpret_cast<const char *>(&header), sizeof header});
    file_.write(bytes);
    offset_ += kHeaderBytes + bytes.size();
  }

  OutputFile file_;
  EventCodec codec_;
  Result<void> state_;  // the first mistake
  std::string description_;
  std::vector<JobEvent> pending_;
  std::string code_;
  std::string packed_;
  std::uint64_t count_ = 0;
  std::uint64_t offset_ = kFirstBlock;  // of the next block
  std::uint64_t run_ = 0;               // offset of the last description

  const std::uint64_t most_bytes_;
  std::uint64_t start_ = kFirstBlock + kHeaderBytes;  // offset of the first block that is kept
  std::uint64_t replaced_ = 0;                        // number of events before it
  std::deque<Place> places_;                          // that are kept
  std::uint64_t lost_ = 0;
  std::chrono::steady_clock::time_point synced_;
};

class EventsReader::Impl {
 public:
  explicit Impl(InputFile file) : file_(std::move(file)), codec_(0) {}

  Result<void> begin() {
    if (Result<void> known = read_magic(); !known) return known;
    if (read_checked(kFirstBlock) && header_.kind == BlockKind::Hole) {
      if (header_.first > file_.size() || header_.first < first_ + kHeaderBytes || header_.base < 0)
        return bad_block("the hole has no end");
      first_ = header_.first;
      replaced_ = static_cast<std::uint64_t>(header_.base);
    }
    is_complete = read_end();
    if (!is_complete) find_whole_blocks();
    offset_ = run_;
    if (Result<void> run = read_run(); !run) return run;
    if (footer.events < replaced_) return bad_block("fewer events were written than replaced");
    if (is_complete && (footer.end < -kMaxTraceTime || footer.end > kMaxTraceTime))
      return bad_block("the run has no end");
    if (is_complete && footer.end < info.start) return bad_block("the run ends before it begins");
    rewind();
    if (!is_complete) {
      if (Result<void> cut = cut_last_instant(); !cut) return cut;
    }
    info.end = footer.end;
    info.lost_events = footer.lost_events + replaced_;
    return {};
  }

  void rewind() {
    offset_ = first_;
    count_ = replaced_;
  }

  Result<bool> next(std::vector<JobEvent> &events) {
    events.clear();
    while (events.empty()) {
      if (offset_ >= blocks_end_ || (!is_complete && count_ == footer.events)) {
        if (!is_complete || count_ == footer.events) return false;
        return bad_block("the file has " + std::to_string(count_) + " events, but " + std::to_string(footer.events) +
                         " were written");
      }
      if (Result<void> read = read_block(most_encoded_bytes(kMostBlockEvents)); !read)
        return tl::unexpected<Diagnostics>(std::move(read.error()));
      if (header_.kind == BlockKind::Run || header_.kind == BlockKind::SoFar) continue;
      if (header_.kind != BlockKind::Events) return bad_block("this is not the block that is due here");
      if (header_.first != count_) return bad_block("a block is missing before this one");
      if (!codec_.decode(whole_, header_.base, events) || events.empty())
        return bad_block("the block holds no events of this run");
      if (!is_complete) events.resize(std::min<std::uint64_t>(events.size(), footer.events - count_));
      count_ += events.size();
      if (positions_.empty()) continue;
      for (JobEvent &event : events) event.task = TaskId(positions_[event.task.value]);
    }
    return true;
  }

  [[nodiscard]] std::uint64_t events() const { return footer.events - replaced_; }

  RunInfo info;
  bool is_complete = false;

 private:
  [[nodiscard]] tl::unexpected<Diagnostics> bad_block(const std::string &problem) const {
    return file_error(file_.name(), 0, "byte " + std::to_string(block_) + ": " + problem);
  }

  Result<void> read_magic() {
    const Result<std::string_view> begin = file_.read(0, kMagic.size());
    if (!begin) return tl::unexpected<Diagnostics>(begin.error());
    if (begin->empty()) return file_error(file_.name(), 0, "the file is empty");
    if (*begin == kMagic) return {};
    // The last two bytes are those that a damaged copy has lost.
    if (begin->substr(0, kFormat.size()) == kFormat) {
      return file_error(file_.name(), 0, "byte 14: the file was copied as text, which changed its bytes",
                        "copy it again");
    }
    return file_error(file_.name(), 0, "not a file of events: it does not begin with " + std::string(kFormat),
                      "'redag run' and 'redag simulate' write such files with --out");
  }

  // Reads the description at `offset_`.
  Result<void> read_run() {
    if (Result<void> run = read_block(kMaxInfoBytes, kMostInfoExpansion); !run) return run;
    if (header_.kind != BlockKind::Run) return bad_block("this is not the block that is due here");
    const std::size_t line = std::min(whole_.find('\n'), whole_.size());
    Result<RunInfo> read =
        run_header_from_json(std::string_view(whole_).substr(0, line), kFormat, "an event trace", file_.name());
    if (!read) return tl::unexpected<Diagnostics>(std::move(read.error()));
    info = *std::move(read);
    const std::size_t tasks = info.workload.task_count();
    codec_ = EventCodec(tasks);
    if (line == whole_.size()) return {};
    const std::string_view rest = std::string_view(whole_).substr(line);
    const nlohmann::json positions =
        json_is_too_large(rest) ? nlohmann::json() : nlohmann::json::parse(rest, nullptr, false);
    const auto is_position = [tasks](const nlohmann::json &entry) {
      return entry.is_number_unsigned() && entry.get<std::uint64_t>() < tasks;
    };
    if (!positions.is_array() || positions.empty() || !std::all_of(positions.begin(), positions.end(), is_position))
      return bad_block("the second line must list the positions of tasks in the workload");
    positions_ = positions.get<std::vector<std::uint32_t>>();
    codec_ = EventCodec(positions_.size());
    return {};
  }

  // Reads the block at `offset_`, of whatever kind, into `whole_`, and goes behind it.
  Result<void> read_block(std::uint64_t most, std::uint64_t expansion = kMostExpansion) {
    const Result<std::string_view> bytes = read_checked(offset_);
    if (!bytes) return tl::unexpected<Diagnostics>(bytes.error());
    offset_ += kHeaderBytes + header_.bytes;
    const bool is_skipped = header_.kind == BlockKind::Run && expansion != kMostInfoExpansion;
    if (is_skipped || (header_.kind != BlockKind::Run && header_.kind != BlockKind::Events)) return {};
    if (header_.whole > most || header_.whole > expansion * (std::uint64_t{header_.bytes} + 1))
      return bad_block("the block is longer than a block can be");
    whole_.resize(header_.whole);
    uLongf size = header_.whole;
    const int status = uncompress(reinterpret_cast<Bytef *>(whole_.data()), &size,
                                  reinterpret_cast<const Bytef *>(bytes->data()), static_cast<uLong>(bytes->size()));
    if (status != Z_OK || size != header_.whole) return bad_block("the block cannot be decompressed");
    return {};
  }

  // Returns the bytes of the block at `offset` as the file has them.
  Result<std::string_view> read_checked(std::uint64_t offset) {
    block_ = offset;
    Result<std::string_view> head = file_.read(offset, kHeaderBytes);
    if (!head) return head;
    if (head->size() < kHeaderBytes) return bad_block("the file ends within a block");
    std::memcpy(&header_, head->data(), kHeaderBytes);
    if (header_.bytes > file_.size() - offset - kHeaderBytes) return bad_block("the file is damaged here");
    Result<std::string_view> bytes = file_.read(offset + kHeaderBytes, header_.bytes);
    if (!bytes) return bytes;
    if (bytes->size() < header_.bytes || header_.crc != checksum(header_, *bytes))
      return bad_block("the file is damaged here: the checksum of the block does not match");
    return bytes;
  }

  // Reads the last block; false if the file ends with another one.
  bool read_end() {
    if (file_.size() < first_ + kEndBytes) return false;
    blocks_end_ = file_.size() - kEndBytes;
    const Result<std::string_view> bytes = read_checked(blocks_end_);
    if (!bytes || header_.kind != BlockKind::End || bytes->size() != sizeof footer) return false;
    std::memcpy(&footer, bytes->data(), sizeof footer);
    run_ = header_.base > 0 ? static_cast<std::uint64_t>(header_.base) : first_;
    return true;
  }

  // Of a file without its end: finds the last description, and the end of the blocks that were written completely.
  void find_whole_blocks() {
    run_ = blocks_end_ = first_;
    for (Result<std::string_view> bytes = read_checked(first_); bytes; bytes = read_checked(blocks_end_)) {
      if (header_.kind == BlockKind::Run) run_ = blocks_end_;
      if (header_.kind == BlockKind::SoFar && bytes->size() == sizeof footer)
        std::memcpy(&footer, bytes->data(), sizeof footer);
      blocks_end_ += kHeaderBytes + header_.bytes;
    }
    footer.events = std::numeric_limits<std::uint64_t>::max();
  }

  // A part of the last instant may be missing: the run ends before it.
  Result<void> cut_last_instant() {
    std::vector<JobEvent> events;
    std::uint64_t kept = replaced_;  // before the last instant
    Time last = info.start;
    for (;;) {
      const std::uint64_t before = count_;
      const Result<bool> more = next(events);
      if (!more) return tl::unexpected<Diagnostics>(more.error());
      if (!*more) break;
      for (std::size_t i = 0; i < events.size(); ++i) {
        if (events[i].time <= last && before + i > replaced_) continue;
        last = std::max(last, events[i].time);
        kept = before + i;
      }
    }
    footer.events = kept;
    footer.end = std::max(info.start, last - 1);
    const std::uint64_t rest = file_.size() - blocks_end_;
    info.remarks.push_back({.begun = footer.end,
                            .text = "the record ends here: the run was killed, or still goes on" +
                                    (rest == 0 ? "" : "; " + std::to_string(rest) + " bytes are no whole block")});
    rewind();
    return {};
  }

  InputFile file_;
  EndBlock footer;
  std::uint64_t first_ = kFirstBlock;  // offset of the first block that is kept
  std::uint64_t replaced_ = 0;         // number of events before it
  std::uint64_t run_ = 0;              // offset of the last description
  std::uint64_t blocks_end_ = 0;       // behind the last block, or where the end is
  std::uint64_t offset_ = 0;           // of the next block
  std::uint64_t block_ = 0;            // of the last one that was read
  BlockHeader header_;                 // of the same
  std::string whole_;
  EventCodec codec_;
  std::vector<std::uint32_t> positions_;  // of tasks, by the events' ids; empty: ids are positions
  std::uint64_t count_ = 0;
};

EventsWriter::EventsWriter(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
EventsWriter::EventsWriter(EventsWriter &&) noexcept = default;
EventsWriter::~EventsWriter() = default;

Result<EventsWriter> EventsWriter::create(const std::string &path, const RunInfo &info) {
  return make(OutputFile::create, path, info, 0, {});
}

Result<EventsWriter> EventsWriter::record(const std::string &path, const RunInfo &info, std::uint64_t most_bytes,
                                          std::span<const std::uint32_t> positions) {
  return make(OutputFile::grow, path, info, most_bytes, positions).and_then([](EventsWriter writer) {
    return writer.flush(0).map([&] { return std::move(writer); });
  });
}

Result<EventsWriter> EventsWriter::make(Result<OutputFile> (*open)(std::string), const std::string &path,
                                        const RunInfo &info, std::uint64_t most_bytes,
                                        std::span<const std::uint32_t> positions) {
  if (Result<void> valid = check_workload(info); !valid) return tl::unexpected<Diagnostics>(std::move(valid.error()));
  Result<OutputFile> file = open(path);
  if (!file) return tl::unexpected<Diagnostics>(std::move(file.error()));
  EventsWriter writer(std::make_unique<Impl>(*std::move(file), most_bytes));
  writer.impl_->describe(info, positions);
  return writer;
}

Result<void> EventsWriter::describe(const RunInfo &info, std::span<const std::uint32_t> positions) {
  return check_workload(info).map([&] { impl_->describe(info, positions); });
}

Result<void> EventsWriter::flush(std::uint64_t lost_events) { return impl_->flush(lost_events); }

void EventsWriter::add(std::span<const JobEvent> events) { impl_->add(events); }

Result<void> EventsWriter::commit(Time end, std::uint64_t lost_events) { return impl_->commit(end, lost_events); }

EventsReader::EventsReader(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
EventsReader::EventsReader(EventsReader &&) noexcept = default;
EventsReader::~EventsReader() = default;

Result<EventsReader> EventsReader::make(InputFile file) {
  auto impl = std::make_unique<Impl>(std::move(file));
  if (Result<void> begun = impl->begin(); !begun) return tl::unexpected<Diagnostics>(std::move(begun.error()));
  return EventsReader(std::move(impl));
}

Result<EventsReader> EventsReader::open(const std::string &path) {
  Result<InputFile> file = InputFile::open(path);
  if (!file) return tl::unexpected<Diagnostics>(std::move(file.error()));
  return make(*std::move(file));
}

Result<EventsReader> EventsReader::of(std::string_view bytes, const std::string &file) {
  return make(InputFile(bytes, file));
}

const RunInfo &EventsReader::info() const { return impl_->info; }
bool EventsReader::is_complete() const { return impl_->is_complete; }
std::uint64_t EventsReader::events() const { return impl_->events(); }

Result<bool> EventsReader::next(std::vector<JobEvent> &events) { return impl_->next(events); }

void EventsReader::rewind() { impl_->rewind(); }

Result<void> EventsReader::visit(const std::function<void(std::span<const JobEvent>)> &visit) {
  std::vector<JobEvent> events;
  for (;;) {
    const Result<bool> more = next(events);
    if (!more) return tl::unexpected<Diagnostics>(more.error());
    if (!*more) return {};
    visit(events);
  }
}

Result<std::string> move_unfinished_aside(const std::string &path) {
  namespace fs = std::filesystem;
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return std::string();
  const bool is_locked = ::flock(descriptor, LOCK_SH | LOCK_NB) != 0;
  ::close(descriptor);
  if (is_locked) return file_error(path, 0, "another run is being recorded here", "choose another folder");
  if (const Result<EventsReader> reader = EventsReader::open(path); reader && reader->is_complete())
    return std::string();
  const fs::path place(path);
  fs::path aside;
  std::error_code error;
  for (int number = 1; number == 1 || fs::exists(aside, error); ++number) {
    aside = place.parent_path() / (place.stem().string() + "." + std::to_string(number) + place.extension().string());
  }
  fs::rename(place, aside, error);
  if (error) return file_error(path, 0, "cannot rename to '" + aside.string() + "': " + error.message());
  return aside.string();
}

Result<void> write_trace(const std::string &path, const Trace &trace) {
  Result<EventsWriter> writer = EventsWriter::create(path, trace.info);
  if (!writer) return tl::unexpected<Diagnostics>(std::move(writer.error()));
  writer->add(trace.events);
  return writer->commit(trace.info.end, trace.info.lost_events);
}

Result<Trace> read_trace(const std::string &path) { return read_all(EventsReader::open(path), path); }

Result<Trace> parse_trace(std::string_view bytes, const std::string &file) {
  return read_all(EventsReader::of(bytes, file), file);
}

}  // namespace redag::trace
