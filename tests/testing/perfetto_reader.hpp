// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Reads trace.pftrace as trace_processor does: decompresses packets, and pairs the ends of slices with their begins. By
// protozero, with the field numbers of Perfetto's own description of the format, so that a mistake of the writer is not
// repeated here. Fails the calling test on anything it does not expect.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "redag/base/time.hpp"

namespace redag::testing {

/// A slice, or an instant (then without end). Arguments are texts, numbers in decimal.
struct PictureEvent {
  std::string track;  // with the names of those around it: "DAG control/ekf"
  std::uint64_t track_id = 0;
  std::string name;
  std::string category;
  Time begin = 0;
  Time end = kNever;
  std::map<std::string, std::string> arguments;
  std::vector<std::uint64_t> flows_out;
  std::vector<std::uint64_t> flows_in;
};

struct PictureCount {
  Time time = 0;
  std::int64_t value = 0;
};

struct Picture {
  std::vector<PictureEvent> slices;  // by their ends
  std::vector<PictureEvent> instants;
  std::map<std::string, std::vector<PictureCount>> counters;  // by track
  std::size_t packets = 0;
  std::size_t bytes = 0;  // of the packets before compression

  [[nodiscard]] std::vector<PictureEvent> slices_of(const std::string &track) const;
};

[[nodiscard]] Picture read_picture(const std::string &path);

}  // namespace redag::testing
