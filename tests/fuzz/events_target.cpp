// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <zlib.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "redag/base/check.hpp"
#include "redag/trace/events_file.hpp"
#include "redag_analysis/metrics/check/trace_checker.hpp"
#include "redag_analysis/metrics/files/jobs_csv.hpp"
#include "redag_analysis/metrics/files/summary_json.hpp"
#include "redag_analysis/metrics/jobs.hpp"
#include "redag_analysis/metrics/perfetto/perfetto.hpp"
#include "redag_analysis/metrics/summary.hpp"
#include "redag_analysis/metrics/why/why.hpp"
#include "redag_lab/report/document.hpp"
#include "redag_lab/report/page.hpp"
#include "redag_lab/report/verdict.hpp"
#include "tests/fuzz/scratch_file.hpp"
#include "tests/fuzz/targets.hpp"

namespace redag::fuzz {
namespace {

constexpr std::string_view kMagic = "redag.events/2\r\n";
constexpr std::size_t kHeaderBytes = 32;

std::uint32_t number_at(const std::string &file, std::size_t at) {
  std::uint32_t number = 0;
  std::memcpy(&number, file.data() + at, sizeof number);
  return number;
}

// Corrects the checksums, which random bytes rarely match.
std::string file_with_checksums(std::string_view input) {
  std::string file(input);
  for (std::size_t at = kMagic.size(); at + kHeaderBytes <= file.size();) {
    const std::size_t length = kHeaderBytes + std::size_t{number_at(file, at + 8)};
    if (length > file.size() - at) break;
    const auto *rest = reinterpret_cast<const Bytef *>(file.data() + at + 4);
    const auto checksum = static_cast<std::uint32_t>(crc32(0, rest, static_cast<uInt>(length - 4)));
    std::memcpy(file.data() + at, &checksum, sizeof checksum);
    at += length;
  }
  return file;
}

void append_block(std::uint32_t kind, std::string_view bytes, std::uint32_t whole, std::uint64_t first, Time base,
                  std::string &file) {
  const auto append = [&file](const auto &value) {
    std::string raw(sizeof value, '\0');
    std::memcpy(raw.data(), &value, sizeof value);
    file += raw;
  };
  append(std::uint32_t{0});
  append(kind);
  append(static_cast<std::uint32_t>(bytes.size()));
  append(whole);
  append(first);
  append(base);
  file += bytes;
}

std::string packed(std::string_view bytes) {
  uLongf size = compressBound(static_cast<uLong>(bytes.size()));
  std::string out(size, '\0');
  REDAG_CHECK(compress(reinterpret_cast<Bytef *>(out.data()), &size, reinterpret_cast<const Bytef *>(bytes.data()),
                       static_cast<uLong>(bytes.size())) == Z_OK,
              "there is room");
  out.resize(size);
  return out;
}

// Makes a file of its parts before compression, which random bytes rarely survive: a line that describes the run; a
// byte for the number of events; a code of events.
std::string file_of_parts(std::string_view input) {
  const std::string_view run = input.substr(0, input.find('\n'));
  input.remove_prefix(std::min(input.size(), run.size() + 1));
  const std::uint64_t events = input.empty() ? 0 : static_cast<unsigned char>(input.front());
  const std::string_view code = input.substr(std::min<std::size_t>(input.size(), 1));
  std::string file(kMagic);
  append_block(1, packed(run), static_cast<std::uint32_t>(run.size()), 0, 0, file);
  append_block(2, packed(code), static_cast<std::uint32_t>(code.size()), 0, 0, file);
  std::string end(24, '\0');
  std::memcpy(end.data(), &events, sizeof events);
  append_block(3, end, 24, events, 0, file);
  return file_with_checksums(file);
}

}  // namespace

void events_target(std::string_view input) {
  if (input.empty()) return;
  const std::string file = input.starts_with(kMagic) ? file_with_checksums(input) : file_of_parts(input);
  const Result<trace::Trace> trace = trace::parse_trace(file, "events.redag");
  if (!trace) {
    REDAG_CHECK(!trace.error().empty(), "a refusal says why");
    return;
  }
  (void)metrics::check_trace(*trace, metrics::rules_for(trace->info));
  (void)metrics::check_trace(*trace);
  (void)metrics::summary_to_json(metrics::summarize(*trace), trace->info);
  const metrics::Investigation investigation = metrics::Investigation::of(*trace).value();
  const std::vector<metrics::Explanation> explanations = investigation.explain(investigation.misses()).value();
  for (const metrics::Explanation &one : explanations) {
    Duration sum = 0;
    for (const metrics::Part &part : one.parts) sum += part.length;
    REDAG_CHECK(sum == one.length(), "parts sum to the whole");
  }
  const std::string &folder = scratch_folder();
  auto jobs = metrics::JobsCsvWriter::create(folder + "/jobs.csv", trace->info.workload);
  REDAG_CHECK(jobs.has_value(), "a place for jobs.csv");
  jobs->add(trace->events);
  REDAG_CHECK(jobs->commit().has_value(), "jobs.csv");
  REDAG_CHECK(metrics::write_perfetto(folder + "/trace.pftrace", *trace).has_value(), "trace.pftrace");
  std::vector<report::Group> groups;
  report::GroupReader reader("fuzz", report::digest_options(1));
  REDAG_CHECK(reader.add(folder, *trace).has_value(), "a trace in memory can be read");
  if (reader.fits(trace->info)) REDAG_CHECK(reader.add(folder, *trace).has_value(), "and again");
  groups.push_back(reader.finish());
  (void)report::page(report::to_json(groups));
  (void)report::verdict_of(groups.front());
  const std::string path = folder + "/events.redag";
  REDAG_CHECK(trace::write_trace(path, *trace).has_value(), "events.redag");
  const Result<trace::Trace> again = trace::read_trace(path);
  REDAG_CHECK(again.has_value() && again->events == trace->events, "what was written can be read");
}

}  // namespace redag::fuzz
