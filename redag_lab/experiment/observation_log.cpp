// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/observation_log.hpp"

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "redag/base/check.hpp"

namespace redag::experiment {
namespace {

constexpr std::size_t kGroupsThatStay = 5;

}  // namespace

Result<ObservationLog::Place> ObservationLog::add(std::string_view line) {
  if (file_ == nullptr) file_.reset(std::tmpfile());
  if (file_ == nullptr || std::fwrite(line.data(), 1, line.size(), file_.get()) != line.size()) {
    return make_error(fmt::format("cannot write a temporary file: {}", std::strerror(errno)));
  }
  const Place place{size_, static_cast<std::uint32_t>(line.size())};
  size_ += line.size();
  return place;
}

const std::vector<Observation> &ObservationLog::read(std::size_t group, const std::vector<Place> &places) {
  if (const auto known = found_.find(group); known != found_.end()) {
    groups_.splice(groups_.begin(), groups_, known->second);
    return groups_.front().runs;
  }
  Group &read = groups_.emplace_front();
  read.number = group;
  found_[group] = groups_.begin();
  REDAG_CHECK(places.empty() || std::fflush(file_.get()) == 0, "the temporary file can be written");
  std::string line;
  for (const Place &place : places) {
    line.resize(place.bytes);
    const ssize_t bytes = ::pread(::fileno(file_.get()), line.data(), line.size(), static_cast<off_t>(place.begin));
    REDAG_CHECK(bytes == static_cast<ssize_t>(line.size()), "the temporary file can be read");
    Result<Observation> seen = parse_observation(line);
    REDAG_CHECK(seen.has_value(), "it was parsed before it was added");
    read.runs.push_back(std::move(*seen));
  }
  in_memory_ += read.runs.size();
  while (in_memory_ > kept_ && groups_.size() > kGroupsThatStay) forget(groups_.back().number);
  return read.runs;
}

void ObservationLog::forget(std::size_t group) {
  const auto known = found_.find(group);
  if (known == found_.end()) return;
  in_memory_ -= known->second->runs.size();
  groups_.erase(known->second);
  found_.erase(known);
}

}  // namespace redag::experiment
