// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Writes trace.pftrace for ui.perfetto.dev and trace_processor: a track for each worker with the jobs that it ran, for
// each task with its jobs from release to end, and each DAG's misses. docs/results_format.md describes them. Events are
// written as they are read; memory does not grow with the run.
#pragma once

#include <memory>
#include <span>
#include <string>

#include "redag/base/result.hpp"
#include "redag/trace/trace.hpp"

namespace redag::metrics {

class PerfettoWriter {
 public:
  /// Opens the file. `run`, whose `end` is not used, must outlive this object.
  [[nodiscard]] static Result<PerfettoWriter> create(const std::string &path, const trace::RunInfo &run);
  PerfettoWriter(PerfettoWriter &&) noexcept;
  PerfettoWriter &operator=(PerfettoWriter &&) = delete;
  PerfettoWriter(const PerfettoWriter &) = delete;
  PerfettoWriter &operator=(const PerfettoWriter &) = delete;
  ~PerfettoWriter();

  void add(std::span<const JobEvent> events);

  /// Closes the jobs in flight at `end` and completes the file.
  [[nodiscard]] Result<void> commit(Time end);

 private:
  class Impl;
  explicit PerfettoWriter(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

[[nodiscard]] Result<void> write_perfetto(const std::string &path, const trace::Trace &trace);

}  // namespace redag::metrics
