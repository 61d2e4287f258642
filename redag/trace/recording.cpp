// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag/trace/recording.hpp"

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
  visit(trace_->events);
  return {};
}

}  // namespace redag::trace
