// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// trace.json for ui.perfetto.dev and chrome://tracing: a track per worker with the jobs' slices, and a process per DAG
// with every job from release to end, misses and skips. Written as the events are read; memory does not grow with the
// run. Format: "Trace Event Format", Chromium project.
#pragma once

#include <memory>
#include <span>
#include <string>

#include "redag/base/result.hpp"
#include "redag/trace/trace.hpp"

namespace redag::metrics {

struct PerfettoOptions {
  bool flows = true;  // arrows from a job to those that use its data
};

class PerfettoWriter {
 public:
  /// `run` must outlive this; its `end` is not used.
  [[nodiscard]] static Result<PerfettoWriter> create(const std::string &path, const trace::RunInfo &run,
                                                     const PerfettoOptions &options = {});
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

[[nodiscard]] Result<void> write_perfetto(const std::string &path, const trace::Trace &trace,
                                          const PerfettoOptions &options = {});

}  // namespace redag::metrics
