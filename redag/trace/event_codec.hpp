// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Events as few bytes, for the blocks of files: column by column, each number as its difference from what the events
// before it let expect. Jobs of periodic tasks then give the same bytes again and again, which a compressor removes.
// Owns tables by task; not thread-safe.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "redag/model/job_event.hpp"

namespace redag::trace {

/// The most events in one block.
inline constexpr std::size_t kMostBlockEvents = std::size_t{1} << 16U;
/// The most bytes that encode() makes of `count` events.
[[nodiscard]] constexpr std::size_t most_encoded_bytes(std::size_t count) { return 10 + 36 * count; }

// The code has its columns one after the other. A number takes seven bits a byte, the lowest first; the eighth bit says
// that more follow. A difference is folded, so that small ones of either sign are short: 0, -1, 1, -2 become 0, 1,
// 2, 3. All arithmetic wraps at 64 bits.
//
//   count         how many events follow
//   kind, reason  a byte for each event: kind + 16 * reason; kinds from 15 have no reason, and are
//                 15 + 16 * (kind - 15)
//   time          difference from the event before; of the first one, from the time in the header of the block
//   task          position in the workload
//   job           difference from the last event of the task; at first from 0
//   worker        worker + 1, or 0 for none, as difference from the last event of the task; at first from 0
//   value         difference from the last such event of the task, at first from the header's time (released, ready,
//                 dispatched); from the time of the event (started, finished, aborted, low_mode); else from 0
class EventCodec {
 public:
  /// `tasks`: how many tasks the run has.
  explicit EventCodec(std::size_t tasks);

  /// Appends the code of `events`, at most kMostBlockEvents. `base` is the time of the first one. Requires that
  /// is_event() holds for each of them.
  void encode(std::span<const JobEvent> events, Time base, std::string &out);

  /// Decodes what encode() wrote, and nothing else: false if the bytes are not the code of events of this run.
  [[nodiscard]] bool decode(std::string_view code, Time base, std::vector<JobEvent> &events);

  /// True if the event can be one of this run: a known task, kind and reason, times that do not overflow.
  [[nodiscard]] bool is_event(const JobEvent &event) const;

 private:
  // What the next event of a task is expected to say.
  struct Expected {
    std::uint32_t job = 0;
    std::uint32_t worker = 0;
    std::array<std::uint64_t, 3> value{};  // of Released, Ready and Dispatched
  };

  void begin(Time base);
  [[nodiscard]] std::uint64_t value_before(const JobEvent &event) const;
  void note(const JobEvent &event);

  std::vector<Expected> tasks_;
};

}  // namespace redag::trace
