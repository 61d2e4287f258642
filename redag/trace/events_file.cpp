// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/trace/events_file.hpp"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <type_traits>
#include <utility>

#include "redag/base/check.hpp"
#include "redag/model/validate.hpp"
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

enum class BlockKind : std::uint32_t { Run = 1, Events = 2, End = 3 };

// The layout is the file's, little-endian as the machine is.
struct BlockHeader {
  std::uint32_t crc = 0;  // of the header's later bytes and of those in the file
  BlockKind kind = BlockKind::Run;
  std::uint32_t bytes = 0;  // in the file, after the header
  std::uint32_t whole = 0;  // the same before they were compressed
  std::uint64_t first = 0;  // how many events stand before the block
  Time base = 0;            // the time of the first event
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
  return static_cast<std::uint32_t>(
      crc32(begun, reinterpret_cast<const Bytef *>(bytes.data()), static_cast<uInt>(bytes.size())));
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
                        "'redag check-trace' and 'redag events' read files of any length");
    }
    trace.events.insert(trace.events.end(), events.begin(), events.end());
  }
}

}  // namespace

class EventsWriter::Impl {
 public:
  Impl(OutputFile file, const RunInfo &info) : file_(std::move(file)), codec_(info.workload.task_count()) {
    pending_.reserve(kMostBlockEvents);
    file_.write(kMagic);
    write(BlockHeader{.kind = BlockKind::Run}, run_header_to_json(kFormat, info));
  }

  void add(std::span<const JobEvent> events) {
    while (!events.empty()) {
      const std::size_t count = std::min(events.size(), kMostBlockEvents - pending_.size());
      pending_.insert(pending_.end(), events.begin(), events.begin() + static_cast<std::ptrdiff_t>(count));
      events = events.subspan(count);
      if (pending_.size() == kMostBlockEvents) write_events();
    }
  }

  Result<void> commit(Time end, std::uint64_t lost_events) {
    write_events();
    const EndBlock last{count_, end, lost_events};
    std::string bytes(sizeof last, '\0');
    std::memcpy(bytes.data(), &last, sizeof last);
    write_block(BlockHeader{.kind = BlockKind::End, .whole = sizeof last, .first = count_}, bytes);
    return file_.commit();
  }

 private:
  void write_events() {
    if (pending_.empty()) return;
    for (const JobEvent &event : pending_) REDAG_CHECK(codec_.is_event(event), "an event of another run");
    code_.clear();
    const Time base = pending_.front().time;
    codec_.encode(pending_, base, code_);
    write(BlockHeader{.kind = BlockKind::Events, .first = count_, .base = base}, code_);
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

  void write_block(BlockHeader header, std::string_view bytes) {
    header.bytes = static_cast<std::uint32_t>(bytes.size());
    header.crc = checksum(header, bytes);
    std::array<char, kHeaderBytes> head;
    std::memcpy(head.data(), &header, head.size());
    file_.write({head.data(), head.size()});
    file_.write(bytes);
  }

  OutputFile file_;
  EventCodec codec_;
  std::vector<JobEvent> pending_;
  std::string code_;
  std::string packed_;
  std::uint64_t count_ = 0;
};

class EventsReader::Impl {
 public:
  explicit Impl(InputFile file) : file_(std::move(file)), offset_(kMagic.size()), codec_(0) {}

  Result<void> begin() {
    if (Result<void> known = read_magic(); !known) return known;
    if (Result<void> last = read_end(); !last) return last;
    if (Result<void> run = read_block(BlockKind::Run, kMaxInfoBytes, kMostInfoExpansion); !run) return run;
    Result<RunInfo> read = run_header_from_json(whole_, kFormat, "an event trace", file_.name());
    if (!read) return tl::unexpected<Diagnostics>(std::move(read.error()));
    info = *std::move(read);
    if (footer.end < info.start) return bad_block("the run ends before it begins");
    info.end = footer.end;
    info.lost_events = footer.lost_events;
    codec_ = EventCodec(info.workload.task_count());
    first_ = offset_;
    return {};
  }

  void rewind() {
    offset_ = first_;
    count_ = 0;
  }

  Result<bool> next(std::vector<JobEvent> &events) {
    events.clear();
    if (offset_ + kEndBytes >= file_.size()) {
      if (count_ == footer.events) return false;
      return bad_block("the file has " + std::to_string(count_) + " events, but " + std::to_string(footer.events) +
                       " were written");
    }
    if (Result<void> read = read_block(BlockKind::Events, most_encoded_bytes(kMostBlockEvents)); !read)
      return tl::unexpected<Diagnostics>(std::move(read.error()));
    if (header_.first != count_) return bad_block("a block is missing before this one");
    if (!codec_.decode(whole_, header_.base, events) || events.empty())
      return bad_block("the block holds no events of this run");
    count_ += events.size();
    return true;
  }

  RunInfo info;  // complete
  EndBlock footer;

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

  // Reads the block at `offset_` into `whole_`, and goes behind it.
  Result<void> read_block(BlockKind kind, std::uint64_t most, std::uint64_t expansion = kMostExpansion) {
    const Result<std::string_view> bytes = read_checked(offset_);
    if (!bytes) return tl::unexpected<Diagnostics>(bytes.error());
    if (header_.kind != kind) return bad_block("this is not the block that is due here");
    if (header_.whole > most || header_.whole > expansion * (std::uint64_t{header_.bytes} + 1))
      return bad_block("the block is longer than a block can be");
    whole_.resize(header_.whole);
    uLongf size = header_.whole;
    const int status = uncompress(reinterpret_cast<Bytef *>(whole_.data()), &size,
                                  reinterpret_cast<const Bytef *>(bytes->data()), static_cast<uLong>(bytes->size()));
    if (status != Z_OK || size != header_.whole) return bad_block("the block cannot be decompressed");
    offset_ += kHeaderBytes + header_.bytes;
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

  Result<void> read_end() {
    const std::uint64_t least = kMagic.size() + kEndBytes;
    block_ = file_.size() < least ? file_.size() : file_.size() - kEndBytes;
    const Result<std::string_view> bytes = file_.size() < least ? bad_block("") : read_checked(block_);
    if (!bytes || header_.kind != BlockKind::End || bytes->size() != sizeof(EndBlock)) {
      return file_error(
          file_.name(), 0,
          "the file is incomplete or damaged: its last block is missing, at byte " + std::to_string(file_.size()));
    }
    std::memcpy(&footer, bytes->data(), sizeof footer);
    if (footer.end < -kMaxTraceTime || footer.end > kMaxTraceTime) return bad_block("the run has no end");
    return {};
  }

  InputFile file_;
  std::uint64_t offset_;     // of the next block
  std::uint64_t first_ = 0;  // offset of the first block of events
  std::uint64_t block_ = 0;  // of the last one that was read
  BlockHeader header_;       // of the same
  std::string whole_;
  EventCodec codec_;
  std::uint64_t count_ = 0;
};

EventsWriter::EventsWriter(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
EventsWriter::EventsWriter(EventsWriter &&) noexcept = default;
EventsWriter::~EventsWriter() = default;

Result<EventsWriter> EventsWriter::create(const std::string &path, const RunInfo &info) {
  Diagnostics mistakes = validate(info.workload, {.wcet_optional = true, .waits = true});
  if (has_errors(mistakes)) return tl::unexpected<Diagnostics>(std::move(mistakes));
  Result<OutputFile> file = OutputFile::create(path);
  if (!file) return tl::unexpected<Diagnostics>(std::move(file.error()));
  return EventsWriter(std::make_unique<Impl>(*std::move(file), info));
}

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
std::uint64_t EventsReader::events() const { return impl_->footer.events; }

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
