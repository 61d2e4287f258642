// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Writes packets of Perfetto's trace format: tracks, slices, instants and counters. Owns the file and how it becomes
// small: texts are numbered, most times are differences, and packets are compressed in blocks, which Perfetto reads as
// they are. Knows nothing of jobs. Memory does not grow with the file. Not thread-safe.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "redag/base/result.hpp"
#include "redag/base/time.hpp"
#include "redag/trace/output_file.hpp"
#include "redag_analysis/metrics/perfetto_schema.hpp"
#include "redag_analysis/metrics/protobuf.hpp"

namespace redag::metrics::perfetto {

template <class Fields>
using Builder = protobuf::Message<Fields>;

/// Number of a track, for the whole file.
enum class Track : std::uint64_t { None = 0 };

/// A text that stands in the file once: its number among those of its kind.
enum class EventName : std::uint64_t { None = 0 };
enum class Category : std::uint64_t { None = 0 };
enum class ArgumentName : std::uint64_t { None = 0 };
enum class ArgumentText : std::uint64_t { None = 0 };

/// What a slice or an instant states besides its name: a number, a text of the file, or one that occurs once.
struct Argument {
  Argument(ArgumentName its_name, std::int64_t value) : name(its_name), number(value) {}
  Argument(ArgumentName its_name, ArgumentText value) : name(its_name), text(value) {}
  Argument(ArgumentName its_name, std::string_view value) : name(its_name), once(value) {}

  ArgumentName name;
  std::int64_t number = 0;
  ArgumentText text = ArgumentText::None;
  std::string_view once;
};

/// What a slice begins or ends with.
struct SliceDetails {
  std::span<const Argument> arguments{};
  std::span<const std::uint64_t> flows_out{};  // arrows that begin here; each number is used once in the file
  std::span<const std::uint64_t> flows_in{};   // arrows that end here
};

class PacketWriter {
 public:
  explicit PacketWriter(trace::OutputFile file);
  PacketWriter(const PacketWriter &) = delete;
  PacketWriter &operator=(const PacketWriter &) = delete;
  ~PacketWriter() = default;

  EventName event_name(std::string_view text);
  Category category(std::string_view text);
  ArgumentName argument_name(std::string_view text);
  ArgumentText argument_text(std::string_view text);

  /// Adds a track, below `parent` unless that is None. Siblings have the order in which they are added; those of one
  /// name are drawn as one.
  Track add_track(std::string_view name, Track parent = Track::None);
  Track add_counter(std::string_view name, Track parent);

  // Times count from the beginning of the trace; earlier ones become 0. On a track, slices have to nest.
  void begin(Track track, Time time, EventName name, Category category, const SliceDetails &details = {});
  void end(Track track, Time time, const SliceDetails &details = {});
  void instant(Track track, Time time, EventName name, std::span<const Argument> arguments);
  void count(Track track, Time time, std::int64_t value);

  /// Completes the file.
  [[nodiscard]] Result<void> commit();

 private:
  static constexpr std::uint32_t kSequence = 1;

  using Numbers = std::map<std::string, std::uint64_t, std::less<>>;

  /// Writes a packet that `fill` makes.
  template <class Fill>
  void packet(Fill fill) {
    Builder<TracePacket> packet(trace_, Trace::Packet);
    packet.add_uint(TracePacket::TrustedPacketSequenceId, kSequence);
    fill(packet);
  }
  void flush_if_full();
  std::uint64_t number_of(Numbers &numbers, InternedData kind, std::string_view text);
  Track add_track(std::string_view name, Track parent, bool is_counter);
  void set_time(Builder<TracePacket> &packet, Time time);
  template <class Fill>
  void event(Track track, Time time, std::int32_t type, Fill fill);
  void flush();

  trace::OutputFile file_;
  std::string raw_;         // packets that are not compressed yet
  std::string compressed_;  // reused
  Builder<Trace> trace_{raw_};
  Numbers event_names_;
  Numbers categories_;
  Numbers argument_names_;
  Numbers argument_texts_;
  std::uint64_t tracks_ = 0;
  Time last_ = 0;  // of the clock of differences
};

}  // namespace redag::metrics::perfetto
