// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/perfetto_packets.hpp"

#include <zlib.h>

#include <algorithm>

#include "redag/base/check.hpp"

namespace redag::metrics::perfetto {
namespace {

constexpr std::size_t kBlock = std::size_t{1} << 18U;  // bytes that are compressed together
constexpr int kLevel = 3;                              // of zlib: half the time of the usual 6, for a tenth more bytes

template <class Number>
std::uint64_t value(Number number) {
  return static_cast<std::uint64_t>(number);
}

void add_arguments(Builder<TrackEvent> &event, std::span<const Argument> arguments) {
  for (const Argument &argument : arguments) {
    Builder<DebugAnnotation> annotation(event, TrackEvent::DebugAnnotations);
    annotation.add_uint(DebugAnnotation::NameIid, value(argument.name));
    if (argument.text != ArgumentText::None) {
      annotation.add_uint(DebugAnnotation::StringValueIid, value(argument.text));
    } else if (argument.once.data() != nullptr) {
      annotation.add_text(DebugAnnotation::StringValue, argument.once);
    } else {
      annotation.add_int(DebugAnnotation::IntValue, argument.number);
    }
  }
}

void add_details(Builder<TrackEvent> &event, const SliceDetails &details) {
  add_arguments(event, details.arguments);
  for (const std::uint64_t flow : details.flows_out) event.add_fixed64(TrackEvent::FlowIds, flow);
  for (const std::uint64_t flow : details.flows_in) event.add_fixed64(TrackEvent::TerminatingFlowIds, flow);
}

}  // namespace

PacketWriter::PacketWriter(trace::OutputFile file) : file_(std::move(file)) {
  raw_.reserve(kBlock + kBlock / 4);
  packet([](Builder<TracePacket> &packet) {
    packet.add_uint(TracePacket::SequenceFlags, kIncrementalStateCleared);
    packet.add_uint(TracePacket::FirstPacketOnSequence, 1);
    Builder<TracePacketDefaults> defaults(packet, TracePacket::TracePacketDefaults);
    defaults.add_uint(TracePacketDefaults::TimestampClockId, kDeltaClock);
  });
  packet([](Builder<TracePacket> &packet) {
    Builder<ClockSnapshot> snapshot(packet, TracePacket::ClockSnapshot);
    for (const std::uint32_t id : {kBootTime, kDeltaClock}) {
      Builder<Clock> clock(snapshot, ClockSnapshot::Clocks);
      clock.add_uint(Clock::ClockId, id);
      clock.add_uint(Clock::Timestamp, 0);
      if (id == kDeltaClock) clock.add_uint(Clock::IsIncremental, 1);
    }
    snapshot.add_uint(ClockSnapshot::PrimaryTraceClock, kBootTime);
  });
}

std::uint64_t PacketWriter::number_of(Numbers &numbers, InternedData kind, std::string_view text) {
  if (const auto known = numbers.find(text); known != numbers.end()) return known->second;
  const std::uint64_t number = numbers.size() + 1;
  numbers.emplace(text, number);
  packet([&](Builder<TracePacket> &packet) {
    packet.add_uint(TracePacket::SequenceFlags, kNeedsIncrementalState);
    Builder<InternedData> data(packet, TracePacket::InternedData);
    Builder<InternedString> entry(data, kind);
    entry.add_uint(InternedString::Iid, number);
    entry.add_text(InternedString::Text, text);
  });
  return number;
}

EventName PacketWriter::event_name(std::string_view text) {
  return EventName(number_of(event_names_, InternedData::EventNames, text));
}

Category PacketWriter::category(std::string_view text) {
  return Category(number_of(categories_, InternedData::EventCategories, text));
}

ArgumentName PacketWriter::argument_name(std::string_view text) {
  return ArgumentName(number_of(argument_names_, InternedData::DebugAnnotationNames, text));
}

ArgumentText PacketWriter::argument_text(std::string_view text) {
  return ArgumentText(number_of(argument_texts_, InternedData::DebugAnnotationStringValues, text));
}

Track PacketWriter::add_track(std::string_view name, Track parent, bool is_counter) {
  const Track track{++tracks_};
  packet([&](Builder<TracePacket> &packet) {
    Builder<TrackDescriptor> descriptor(packet, TracePacket::TrackDescriptor);
    descriptor.add_uint(TrackDescriptor::Uuid, value(track));
    descriptor.add_text(TrackDescriptor::Name, name);
    if (parent != Track::None) descriptor.add_uint(TrackDescriptor::ParentUuid, value(parent));
    descriptor.add_int(TrackDescriptor::SiblingOrderRank, static_cast<std::int32_t>(value(track)));
    if (is_counter) {
      Builder<CounterDescriptor> counter(descriptor, TrackDescriptor::Counter);
      counter.add_int(CounterDescriptor::Unit, kUnitCount);
    } else {
      descriptor.add_int(TrackDescriptor::ChildOrdering, kExplicitOrder);
    }
  });
  return track;
}

Track PacketWriter::add_track(std::string_view name, Track parent) { return add_track(name, parent, false); }

Track PacketWriter::add_counter(std::string_view name, Track parent) { return add_track(name, parent, true); }

// Most packets follow each other in time: the difference to the one before is enough. Others state their time.
void PacketWriter::set_time(Builder<TracePacket> &packet, Time time) {
  time = std::max<Time>(time, 0);
  if (time >= last_) {
    packet.add_uint(TracePacket::Timestamp, static_cast<std::uint64_t>(time - last_));
    last_ = time;
  } else {
    packet.add_uint(TracePacket::Timestamp, static_cast<std::uint64_t>(time));
    packet.add_uint(TracePacket::TimestampClockId, kBootTime);
  }
}

template <class Fill>
void PacketWriter::event(Track track, Time time, std::int32_t type, Fill fill) {
  packet([&](Builder<TracePacket> &packet) {
    packet.add_uint(TracePacket::SequenceFlags, kNeedsIncrementalState);
    set_time(packet, time);
    Builder<TrackEvent> event(packet, TracePacket::TrackEvent);
    event.add_int(TrackEvent::Type, type);
    event.add_uint(TrackEvent::TrackUuid, value(track));
    fill(event);
  });
  flush_if_full();
}

void PacketWriter::begin(Track track, Time time, EventName name, Category category, const SliceDetails &details) {
  event(track, time, kSliceBegin, [&](Builder<TrackEvent> &event) {
    event.add_uint(TrackEvent::NameIid, value(name));
    if (category != Category::None) event.add_uint(TrackEvent::CategoryIids, value(category));
    add_details(event, details);
  });
}

void PacketWriter::end(Track track, Time time, const SliceDetails &details) {
  event(track, time, kSliceEnd, [&](Builder<TrackEvent> &event) { add_details(event, details); });
}

void PacketWriter::instant(Track track, Time time, EventName name, std::span<const Argument> arguments) {
  event(track, time, kInstant, [&](Builder<TrackEvent> &event) {
    event.add_uint(TrackEvent::NameIid, value(name));
    add_arguments(event, arguments);
  });
}

void PacketWriter::count(Track track, Time time, std::int64_t count) {
  event(track, time, kCounter, [&](Builder<TrackEvent> &event) { event.add_int(TrackEvent::CounterValue, count); });
}

void PacketWriter::flush_if_full() {
  if (raw_.size() >= kBlock) flush();
}

void PacketWriter::flush() {
  if (raw_.empty()) return;
  uLongf size = ::compressBound(raw_.size());
  compressed_.resize(size);
  const int status = ::compress2(reinterpret_cast<Bytef *>(compressed_.data()), &size,
                                 reinterpret_cast<const Bytef *>(raw_.data()), raw_.size(), kLevel);
  REDAG_CHECK(status == Z_OK, "zlib has no memory");
  raw_.clear();
  std::string head;
  {
    Builder<Trace> trace(head);
    Builder<TracePacket> packet(trace, Trace::Packet);
    packet.add_text(TracePacket::CompressedPackets, std::string_view(compressed_.data(), size));
  }
  file_.write(head);
}

Result<void> PacketWriter::commit() {
  flush();
  return file_.commit();
}

}  // namespace redag::metrics::perfetto
