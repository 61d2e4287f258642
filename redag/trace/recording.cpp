// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/trace/recording.hpp"

#include <algorithm>
#include <utility>

namespace redag::trace {

Result<Recording> Recording::open(const std::string &path) {
  Result<EventsReader> reader = EventsReader::open(path);
  if (!reader) return tl::unexpected<Diagnostics>(std::move(reader.error()));
  return Recording(*std::move(reader));
}

Result<void> Recording::visit(const Visit &visit) const {
  if (trace_ == nullptr) {
    reader_->rewind();
    return reader_->visit(visit);
  }
  constexpr std::size_t kPortion = 65'536;  // as of a file
  for (std::span<const JobEvent> rest = trace_->events; !rest.empty();) {
    const std::span<const JobEvent> first = rest.first(std::min(kPortion, rest.size()));
    visit(first);
    rest = rest.subspan(first.size());
  }
  return {};
}

}  // namespace redag::trace
