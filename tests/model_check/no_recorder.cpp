// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Replaces redag/runtime/recorder.cpp: no explored run is recorded, and the files of a record need no explorer.
#include "redag/runtime/recorder.hpp"

#include "redag/base/check.hpp"

namespace redag::runtime {

Result<std::unique_ptr<Recorder>> Recorder::create(const std::string &, std::uint64_t) {
  return make_error("runs are not recorded here");
}

Recorder::~Recorder() = default;

Result<void> Recorder::start(Engine &, Describe, const std::string &) {
  REDAG_CHECK(false, "there is no recorder here");
  return {};
}

Result<void> Recorder::finish(Time) {
  REDAG_CHECK(false, "there is no recorder here");
  return {};
}

}  // namespace redag::runtime

// A Recorder needs no more of its record.
namespace redag::trace {

class EventsWriter::Impl {};
EventsWriter::~EventsWriter() = default;

}  // namespace redag::trace
