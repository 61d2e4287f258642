// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Records the run of an engine into the events.redag of a folder (docs/events.md). Owns a thread of normal
// priority, which takes the engine's events ten times a second.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag/engine/engine.hpp"
#include "redag/threads/parker.hpp"
#include "redag/threads/threads.hpp"
#include "redag/trace/events_file.hpp"
#include "redag/trace/trace.hpp"

namespace redag::runtime {

class Recorder {
 public:
  /// Describes the run with all tasks so far, which have the ids of the engine; without machine and provenance. Any
  /// thread.
  using Describe = std::function<trace::RunInfo()>;

  /// Makes sure that `folder` can be written. An unfinished record of an earlier run is moved aside, to events.1.redag
  /// and so on: moved_aside() then names it. Error: what the system refused.
  [[nodiscard]] static Result<std::unique_ptr<Recorder>> create(const std::string &folder, std::uint64_t most_bytes);
  ~Recorder();  // keeps what was written, if finish() was not called
  Recorder(const Recorder &) = delete;
  Recorder &operator=(const Recorder &) = delete;

  /// Starts the record, and the thread. `engine` must live until finish() or the destructor. If there is a thread
  /// already, does nothing. Error: the record cannot be written, or there can be no thread.
  [[nodiscard]] Result<void> start(Engine &engine, Describe describe, const std::string &name);
  /// Once the engine's threads have ended: completes the record of a run that ended at `end`. Error: what could not be
  /// written, now or before; the record then has what was written before.
  [[nodiscard]] Result<void> finish(Time end);

  [[nodiscard]] const std::string &moved_aside() const { return moved_aside_; }

 private:
  Recorder(std::string path, std::uint64_t most_bytes, std::string moved_aside)
      : path_(std::move(path)), most_bytes_(most_bytes), moved_aside_(std::move(moved_aside)) {}

  void main() noexcept;
  void end_thread();
  void collect(Time end);
  [[nodiscard]] Result<void> describe_again();

  const std::string path_;
  const std::uint64_t most_bytes_;
  const std::string moved_aside_;
  Engine *engine_ = nullptr;
  Describe describe_;
  std::string name_;
  std::optional<trace::EventsWriter> file_;  // from the first task on
  Workload described_;
  std::vector<trace::Removal> removals_;  // described
  std::optional<Time> settled_;           // described
  Time described_at_ = 0;
  std::vector<JobEvent> events_;
  Result<void> state_;  // the first error
  Event stop_;
  ThreadHandle thread_;
};

}  // namespace redag::runtime
