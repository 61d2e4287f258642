// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/perfetto/perfetto_packets.hpp"

#include <zlib.h>

#include <algorithm>
#include <utility>

#include "redag/base/check.hpp"

namespace redag::metrics::perfetto {
namespace {

constexpr std::size_t kBlock = std::size_t{1} << 18U;  // bytes that are compressed together
constexpr int kLevel = 3;                              // of zlib: half the time of the usual 6, for a tenth more bytes

// The numbers of protobuf fields and values, by the names in perfetto/protos/perfetto/trace/perfetto_trace.proto.
using Field = std::uint32_t;
constexpr Field kPacket = 1;  // of Trace
struct TracePacket {
  static constexpr Field kTimestamp = 8, kSequence = 10, kTrackEvent = 11, kSequenceFlags = 13, kCompressed = 50;
  static constexpr Field kTrackDescriptor = 60;
  static constexpr std::uint64_t kStateCleared = 1;  // of the first packet of a sequence
};
struct TrackDescriptor {
  static constexpr Field kUuid = 1, kName = 2, kParent = 5, kCounter = 8, kChildOrdering = 11, kSiblingOrder = 12;
  static constexpr std::uint64_t kExplicit = 3;  // order of children
};
struct CounterDescriptor {
  static constexpr Field kUnit = 3;
  static constexpr std::uint64_t kCount = 2;
};
struct TrackEvent {
  static constexpr Field kArguments = 4, kType = 9, kTrack = 11, kCategories = 22, kName = 23, kCounterValue = 30;
  static constexpr Field kFlows = 47, kTerminatingFlows = 48;
  static constexpr std::uint64_t kBegin = 1, kEnd = 2, kInstant = 3, kCounter = 4;
};
struct DebugAnnotation {
  static constexpr Field kNumber = 4, kText = 6, kName = 10;
};

// Writes one message in protobuf's wire format (protobuf.dev/programming-guides/encoding). A message is open while its
// object lives, and appends to a text that it shares with those around it. Own code, because no library that ROS can
// install for its users does this without generated code.
class Message {
 public:
  Message(std::string &bytes, Field field) : bytes_(bytes) {
    append_tag(field, kLengthDelimited);
    bytes_.push_back('\0');
    begin_ = bytes_.size();
  }
  Message(const Message &) = delete;
  Message &operator=(const Message &) = delete;
  ~Message() {
    // Most messages are short. The length of a long one needs more room, and the message moves.
    std::string length;
    append_varint(length, bytes_.size() - begin_);
    bytes_.replace(begin_ - 1, 1, length);
  }

  /// Opens a message inside, before whose end this one is not written to.
  [[nodiscard]] Message inner(Field field) { return Message(bytes_, field); }
  void add(Field field, std::uint64_t value) {
    append_tag(field, kVarint);
    append_varint(bytes_, value);
  }
  void add_fixed(Field field, std::uint64_t value) {
    append_tag(field, kFixed64);
    for (unsigned shift = 0; shift < 64; shift += 8) bytes_.push_back(static_cast<char>(value >> shift));
  }
  /// Also for bytes.
  void add(Field field, std::string_view text) {
    append_tag(field, kLengthDelimited);
    append_varint(bytes_, text.size());
    bytes_.append(text);
  }

 private:
  // Types of the wire format.
  static constexpr std::uint32_t kVarint = 0;
  static constexpr std::uint32_t kFixed64 = 1;
  static constexpr std::uint32_t kLengthDelimited = 2;

  static void append_varint(std::string &bytes, std::uint64_t value) {
    for (; value >= 0x80; value >>= 7U) bytes.push_back(static_cast<char>(value | 0x80U));
    bytes.push_back(static_cast<char>(value));
  }
  void append_tag(Field field, std::uint32_t type) { append_varint(bytes_, std::uint64_t{field} << 3U | type); }

  std::string &bytes_;
  std::size_t begin_;  // of its content
};

void add_arguments(Message &event, std::span<const Argument> arguments) {
  for (const Argument &argument : arguments) {
    Message annotation = event.inner(TrackEvent::kArguments);
    annotation.add(DebugAnnotation::kName, argument.name);
    if (const auto *text = std::get_if<std::string_view>(&argument.value)) {
      annotation.add(DebugAnnotation::kText, *text);
    } else {
      annotation.add(DebugAnnotation::kNumber, static_cast<std::uint64_t>(std::get<std::int64_t>(argument.value)));
    }
  }
}

}  // namespace

PacketWriter::PacketWriter(trace::OutputFile file) : file_(std::move(file)) {
  raw_.reserve(kBlock + kBlock / 4);
  Message packet(raw_, kPacket);
  packet.add(TracePacket::kSequence, 1);
  packet.add(TracePacket::kSequenceFlags, TracePacket::kStateCleared);
}

std::uint64_t PacketWriter::add_track(std::string_view name, std::uint64_t parent, bool is_counter) {
  const std::uint64_t id = ++tracks_;
  Message packet(raw_, kPacket);
  packet.add(TracePacket::kSequence, 1);
  Message track = packet.inner(TracePacket::kTrackDescriptor);
  track.add(TrackDescriptor::kUuid, id);
  track.add(TrackDescriptor::kName, name);
  if (parent != 0) track.add(TrackDescriptor::kParent, parent);
  track.add(TrackDescriptor::kSiblingOrder, id);
  if (is_counter) {
    track.inner(TrackDescriptor::kCounter).add(CounterDescriptor::kUnit, CounterDescriptor::kCount);
  } else {
    track.add(TrackDescriptor::kChildOrdering, TrackDescriptor::kExplicit);
  }
  return id;
}

Track PacketWriter::add_track(std::string_view name, std::uint64_t parent) { return {add_track(name, parent, false)}; }

std::uint64_t PacketWriter::add_counter(std::string_view name, std::uint64_t parent) {
  const std::uint64_t id = add_track(name, parent, true);
  count(id, 0, 0);
  return id;
}

template <class Fill>
void PacketWriter::event(std::uint64_t track, Time time, std::uint64_t type, Fill fill) {
  {
    Message packet(raw_, kPacket);
    packet.add(TracePacket::kTimestamp, static_cast<std::uint64_t>(std::max<Time>(time, 0)));
    packet.add(TracePacket::kSequence, 1);
    Message event = packet.inner(TracePacket::kTrackEvent);
    event.add(TrackEvent::kType, type);
    event.add(TrackEvent::kTrack, track);
    fill(event);
  }
  if (raw_.size() >= kBlock) flush();
}

void PacketWriter::begin(Track &track, Time time, std::string_view name, std::string_view category,
                         std::span<const Argument> arguments, Flows arriving) {
  track.last = std::max(track.last, time);
  track.is_open = true;
  event(track.id, track.last, TrackEvent::kBegin, [&](Message &event) {
    event.add(TrackEvent::kName, name);
    if (!category.empty()) event.add(TrackEvent::kCategories, category);
    add_arguments(event, arguments);
    for (const std::uint64_t flow : arriving) event.add_fixed(TrackEvent::kTerminatingFlows, flow);
  });
}

void PacketWriter::end(Track &track, Time time, std::span<const Argument> arguments, Flows leaving) {
  track.last = std::max(track.last, time);
  track.is_open = false;
  event(track.id, track.last, TrackEvent::kEnd, [&](Message &event) {
    add_arguments(event, arguments);
    for (const std::uint64_t flow : leaving) event.add_fixed(TrackEvent::kFlows, flow);
  });
}

void PacketWriter::instant(const Track &track, Time time, std::string_view name, std::span<const Argument> arguments) {
  event(track.id, time, TrackEvent::kInstant, [&](Message &event) {
    event.add(TrackEvent::kName, name);
    add_arguments(event, arguments);
  });
}

void PacketWriter::count(std::uint64_t counter, Time time, std::int64_t value) {
  event(counter, time, TrackEvent::kCounter,
        [&](Message &event) { event.add(TrackEvent::kCounterValue, static_cast<std::uint64_t>(value)); });
}

void PacketWriter::flush() {
  if (raw_.empty()) return;
  uLongf size = ::compressBound(raw_.size());
  compressed_.resize(size);
  const int status = ::compress2(reinterpret_cast<Bytef *>(compressed_.data()), &size,
                                 reinterpret_cast<const Bytef *>(raw_.data()), raw_.size(), kLevel);
  REDAG_CHECK(status == Z_OK, "zlib has no memory");
  raw_.clear();
  std::string block;
  Message(block, kPacket).add(TracePacket::kCompressed, std::string_view(compressed_.data(), size));
  file_.write(block);
}

Result<void> PacketWriter::commit() {
  flush();
  return file_.commit();
}

}  // namespace redag::metrics::perfetto
