// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// A recorded run whose events can be visited as often as a reader likes, some at a time: what needs several passes over
// a run then needs no memory for its events. They are in a file or in memory. Not thread-safe.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>

#include "redag/base/result.hpp"
#include "redag/trace/events_file.hpp"
#include "redag/trace/trace.hpp"

namespace redag::trace {

class Recording {
 public:
  using Visit = std::function<void(std::span<const JobEvent>)>;

  /// Opens a file of events. Errors: those of EventsReader::open().
  [[nodiscard]] static Result<Recording> open(const std::string &path);
  /// A trace in memory, which must outlive this object.
  Recording(const Trace &trace) : trace_(&trace) {}  // NOLINT(google-explicit-constructor): a trace is a recorded run

  [[nodiscard]] const RunInfo &info() const { return trace_ != nullptr ? trace_->info : reader_->info(); }

  /// Passes all events to `visit`, from the first one on. Error: a damaged file; never of a trace in memory.
  [[nodiscard]] Result<void> visit(const Visit &visit) const;

 private:
  explicit Recording(EventsReader reader) : reader_(std::make_shared<EventsReader>(std::move(reader))) {}

  const Trace *trace_ = nullptr;
  std::shared_ptr<EventsReader> reader_;  // empty if the trace is in memory
};

}  // namespace redag::trace
