// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/files/run_files.hpp"

#include <filesystem>
#include <system_error>
#include <utility>

namespace redag::metrics {
namespace {

constexpr std::string_view kJobsFile = "jobs.csv";
constexpr std::string_view kPictureFile = "trace.pftrace";

}  // namespace

Result<RunFiles> RunFiles::create(const FilesOptions &options, const trace::RunInfo &run) {
  const auto path = [&](std::string_view name) { return options.folder + "/" + std::string(name); };
  auto events = trace::EventsWriter::create(path(trace::kEventsFile), run);
  if (!events) return tl::unexpected<Diagnostics>(std::move(events.error()));
  auto jobs = JobsCsvWriter::create(path(kJobsFile), run.workload);
  if (!jobs) return tl::unexpected<Diagnostics>(std::move(jobs.error()));
  RunFiles files(options, run, *std::move(events), *std::move(jobs));
  auto picture = PerfettoWriter::create(path(kPictureFile), *files.run_);
  if (!picture) return tl::unexpected<Diagnostics>(std::move(picture.error()));
  files.picture_.emplace(*std::move(picture));
  return files;
}

void RunFiles::add(std::span<const JobEvent> events) {
  events_.add(events);
  jobs_.add(events);
  count_ += events.size();
  if (count_ > options_.most_pictured) picture_.reset();
  if (picture_) picture_->add(events);
}

Diagnostics RunFiles::commit(Time end, std::uint64_t lost_events) {
  Diagnostics problems;
  const auto keep = [&problems](const Result<void> &written) {
    if (!written) problems.insert(problems.end(), written.error().begin(), written.error().end());
  };
  keep(events_.commit(end, lost_events));
  keep(jobs_.commit());
  if (picture_) {
    keep(picture_->commit(end));
  } else {  // that of an earlier run
    std::error_code ignored;
    std::filesystem::remove(path(kPictureFile), ignored);
  }
  return problems;
}

std::string RunFiles::names() const {
  std::string names = std::string(kJobsFile) + ", " + std::string(trace::kEventsFile);
  if (picture_) names += ", " + std::string(kPictureFile);
  return names;
}

Result<std::string> write_run_files(const FilesOptions &options, const trace::Trace &trace) {
  Result<RunFiles> files = RunFiles::create(options, trace.info);
  if (!files) return tl::unexpected<Diagnostics>(std::move(files.error()));
  files->add(trace.events);
  Diagnostics problems = files->commit(trace.info.end, trace.info.lost_events);
  if (!problems.empty()) return tl::unexpected<Diagnostics>(std::move(problems));
  return files->names();
}

}  // namespace redag::metrics
