// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The observations of an experiment's runs, in a temporary file without a name. Those that were read last stay in
// memory: all of a small experiment, and a bounded number of a large one. Not thread-safe.
#pragma once

#include <cstdint>
#include <cstdio>
#include <list>
#include <memory>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "redag/base/result.hpp"
#include "redag_lab/experiment/observation.hpp"

namespace redag::experiment {

class ObservationLog {
 public:
  struct Place {
    std::uint64_t begin = 0;
    std::uint32_t bytes = 0;
  };

  /// `kept` is the number of observations in memory, beside the groups that were read last.
  explicit ObservationLog(std::size_t kept = 50'000) : kept_(kept) {}

  /// Adds an observation as one line, of the form of to_line(). Error: the file cannot be written.
  [[nodiscard]] Result<Place> add(std::string_view line);

  /// Returns the observations of a group, which has had the same number and places since it was read first. They stay
  /// valid until four other groups are read.
  [[nodiscard]] const std::vector<Observation> &read(std::size_t group, const std::vector<Place> &places);
  /// Forgets what was read of a group: it has changed.
  void forget(std::size_t group);

 private:
  struct Group {
    std::size_t number = 0;
    std::vector<Observation> runs;
  };
  struct Close {
    void operator()(std::FILE *file) const { static_cast<void>(std::fclose(file)); }
  };

  std::size_t kept_;
  std::unique_ptr<std::FILE, Close> file_;
  std::uint64_t size_ = 0;
  std::list<Group> groups_;  // in memory; the one that was read last is first
  std::unordered_map<std::size_t, std::list<Group>::iterator> found_;
  std::size_t in_memory_ = 0;  // observations
};

}  // namespace redag::experiment
