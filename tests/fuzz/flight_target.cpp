// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <zlib.h>

#include <cstring>
#include <filesystem>
#include <string>

#include "redag/base/check.hpp"
#include "redag/trace/flight_recorder.hpp"
#include "redag_analysis/metrics/summary.hpp"
#include "redag_analysis/metrics/trace_checker.hpp"
#include "tests/fuzz/scratch_file.hpp"
#include "tests/fuzz/targets.hpp"

namespace redag::fuzz {
namespace {

constexpr std::size_t kBlockBytes = 4096;

// Corrects the checksums, which random bytes rarely match.
std::string with_checksums(std::string_view input) {
  std::string blocks(input);
  for (std::size_t at = 0; at + kBlockBytes <= blocks.size(); at += kBlockBytes) {
    const auto *rest = reinterpret_cast<const unsigned char *>(blocks.data() + at + 4);
    const auto checksum = static_cast<std::uint32_t>(crc32(0, rest, kBlockBytes - 4));
    std::memcpy(blocks.data() + at, &checksum, sizeof(checksum));
  }
  return blocks;
}

// The first line is run.json, the rest is events.bin.
std::string record_of(std::string_view input) {
  const std::size_t line = input.find('\n');
  std::string folder = scratch_folder() + "/flight";
  std::filesystem::create_directory(folder);
  scratch_file("flight/run.json", input.substr(0, line));
  const std::string_view rest = line == std::string_view::npos ? std::string_view() : input.substr(line + 1);
  scratch_file("flight/events.bin", with_checksums(rest));
  return folder;
}

}  // namespace

void flight_target(std::string_view input) {
  const Result<trace::Recovered> recovered = trace::recover(record_of(input));
  if (!recovered) {
    REDAG_CHECK(!recovered.error().empty(), "a refusal says why");
    return;
  }
  (void)metrics::check_trace(recovered->trace, metrics::rules_for(recovered->trace.info));
  (void)metrics::check_trace(recovered->trace);
  (void)metrics::summarize(recovered->trace);
}

}  // namespace redag::fuzz
