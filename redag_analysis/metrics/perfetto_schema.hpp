// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The part of Perfetto's trace format that we write: the numbers of its protobuf fields and values, by the names in
// perfetto/protos/perfetto/trace/perfetto_trace.proto (Apache-2.0). Each enumeration is a message.
#pragma once

#include <cstdint>

namespace redag::metrics::perfetto {

using Tag = std::uint32_t;

enum class Trace : Tag { Packet = 1 };

enum class TracePacket : Tag {
  ClockSnapshot = 6,
  Timestamp = 8,
  TrustedPacketSequenceId = 10,
  TrackEvent = 11,
  InternedData = 12,
  SequenceFlags = 13,
  CompressedPackets = 50,
  TimestampClockId = 58,
  TracePacketDefaults = 59,
  TrackDescriptor = 60,
  FirstPacketOnSequence = 87,
};
inline constexpr std::uint32_t kIncrementalStateCleared = 1;  // of SequenceFlags
inline constexpr std::uint32_t kNeedsIncrementalState = 2;

enum class TracePacketDefaults : Tag { TimestampClockId = 58 };

enum class ClockSnapshot : Tag { Clocks = 1, PrimaryTraceClock = 2 };
enum class Clock : Tag { ClockId = 1, Timestamp = 2, IsIncremental = 3 };
inline constexpr std::uint32_t kBootTime = 6;     // the clock of a trace
inline constexpr std::uint32_t kDeltaClock = 64;  // the first of those that belong to a sequence of packets

enum class InternedData : Tag {
  EventCategories = 1,
  EventNames = 2,
  DebugAnnotationNames = 3,
  DebugAnnotationStringValues = 29,
};
enum class InternedString : Tag { Iid = 1, Text = 2 };

enum class TrackDescriptor : Tag {
  Uuid = 1,
  Name = 2,
  ParentUuid = 5,
  Counter = 8,
  ChildOrdering = 11,
  SiblingOrderRank = 12,
};
inline constexpr std::int32_t kExplicitOrder = 3;  // of ChildOrdering
enum class CounterDescriptor : Tag { Unit = 3 };
inline constexpr std::int32_t kUnitCount = 2;

enum class TrackEvent : Tag {
  CategoryIids = 3,
  DebugAnnotations = 4,
  Type = 9,
  NameIid = 10,
  TrackUuid = 11,
  CounterValue = 30,
  FlowIds = 47,
  TerminatingFlowIds = 48,
};
inline constexpr std::int32_t kSliceBegin = 1;  // of Type
inline constexpr std::int32_t kSliceEnd = 2;
inline constexpr std::int32_t kInstant = 3;
inline constexpr std::int32_t kCounter = 4;
enum class DebugAnnotation : Tag { NameIid = 1, IntValue = 4, StringValue = 6, StringValueIid = 17 };

}  // namespace redag::metrics::perfetto
