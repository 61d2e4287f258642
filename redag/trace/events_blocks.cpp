// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// redag.events/2: blocks of compressed bytes, each with a checksum. The first one describes the run, the last one
// proves that none is missing; it has a fixed length, so that a reader finds it from the end.
#include <zlib.h>

#include <array>
#include <cstring>
#include <string>
#include <type_traits>
#include <utility>

#include "redag/base/check.hpp"
#include "redag/trace/event_codec.hpp"
#include "redag/trace/events_form.hpp"
#include "redag/trace/run_info_json.hpp"

namespace redag::trace {
namespace {

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

class BlockSink final : public EventsSink {
 public:
  BlockSink(OutputFile file, const RunInfo &info) : file_(std::move(file)), codec_(info.workload.task_count()) {
    pending_.reserve(kMostBlockEvents);
    file_.write(kBlockMagic);
    write(BlockHeader{.kind = BlockKind::Run}, run_header_to_json(kBlockFormat, info));
  }

  void add(std::span<const JobEvent> events) override {
    while (!events.empty()) {
      const std::size_t count = std::min(events.size(), kMostBlockEvents - pending_.size());
      pending_.insert(pending_.end(), events.begin(), events.begin() + static_cast<std::ptrdiff_t>(count));
      events = events.subspan(count);
      if (pending_.size() == kMostBlockEvents) write_events();
    }
  }

  Result<void> commit(Time end, std::uint64_t lost_events) override {
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

class BlockSource final : public EventsSource {
 public:
  explicit BlockSource(InputFile file) : file_(std::move(file)), offset_(kBlockMagic.size()), codec_(0) {}

  Result<void> begin() {
    if (Result<void> last = read_end(); !last) return last;
    if (Result<void> run = read_block(BlockKind::Run, kMaxInfoBytes, kMostInfoExpansion); !run) return run;
    Result<RunInfo> read = run_header_from_json(whole_, kBlockFormat, "an event trace", file_.name());
    if (!read) return tl::unexpected<Diagnostics>(std::move(read.error()));
    info = *std::move(read);
    if (footer.end < info.start) return bad_block("the run ends before it begins");
    info.end = footer.end;
    info.lost_events = footer.lost_events;
    codec_ = EventCodec(info.workload.task_count());
    first_ = offset_;
    return {};
  }

  void rewind() override {
    offset_ = first_;
    count_ = 0;
  }

  Result<bool> next(std::vector<JobEvent> &events) override {
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

 private:
  [[nodiscard]] tl::unexpected<Diagnostics> bad_block(const std::string &problem) const {
    return file_error(file_.name(), 0, "byte " + std::to_string(block_) + ": " + problem);
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
    const std::uint64_t least = kBlockMagic.size() + kEndBytes;
    block_ = file_.size() < least ? file_.size() : file_.size() - kEndBytes;
    const Result<std::string_view> bytes = file_.size() < least ? bad_block("") : read_checked(block_);
    if (!bytes || header_.kind != BlockKind::End || bytes->size() != sizeof(EndBlock)) {
      return file_error(
          file_.name(), 0,
          "the file is incomplete or damaged: its last block is missing, at byte " + std::to_string(file_.size()));
    }
    EndBlock last;
    std::memcpy(&last, bytes->data(), sizeof last);
    if (last.end < -kMaxTraceTime || last.end > kMaxTraceTime) return bad_block("the run has no end");
    footer = {last.events, last.end, last.lost_events};
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

}  // namespace

std::unique_ptr<EventsSink> block_sink(OutputFile file, const RunInfo &info) {
  return std::make_unique<BlockSink>(std::move(file), info);
}

Result<std::unique_ptr<EventsSource>> block_source(InputFile file) {
  auto source = std::make_unique<BlockSource>(std::move(file));
  if (Result<void> begun = source->begin(); !begun) return tl::unexpected<Diagnostics>(std::move(begun.error()));
  return source;
}

}  // namespace redag::trace
