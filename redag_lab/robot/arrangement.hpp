// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Applies changes to running threads and interrupts, and takes them back. A file states how everything was, and is
// complete before the first change: whatever happens to this process, undo() finds all of it. One arrangement works on
// a file at a time (flock). Not thread-safe.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "redag/base/result.hpp"
#include "redag_lab/robot/changes.hpp"
#include "redag_lab/robot/system.hpp"

namespace redag::robot {

class Arrangement {
 public:
  /// Opens the file at `path`, which need not exist. Error: it cannot be read, or another process works on it.
  [[nodiscard]] static Result<Arrangement> open(const System &system, std::string path);

  Arrangement(Arrangement &&other) noexcept;
  Arrangement &operator=(Arrangement &&) = delete;
  Arrangement(const Arrangement &) = delete;
  Arrangement &operator=(const Arrangement &) = delete;
  ~Arrangement();

  /// Makes all changes or none: after an error, and once `stop` returns true, takes back those of this call. `stop` is
  /// asked before each change. Returns false if it was stopped.
  [[nodiscard]] Result<bool> apply(const Changes &changes, const std::function<bool()> &stop);

  struct Undone {
    std::size_t restored = 0;
    std::vector<std::string> remarks;  // what another hand has changed since, and is left as it is
  };
  /// Takes back every change that the file states, and removes the file. Threads that have ended are no error. Error:
  /// what cannot be restored, which then stays in the file.
  [[nodiscard]] Result<Undone> undo();

  [[nodiscard]] bool is_empty() const { return threads_.empty() && interrupts_.empty(); }

 private:
  Arrangement(const System &system, std::string path) : system_(system), path_(std::move(path)) {}

  [[nodiscard]] Result<void> load();
  [[nodiscard]] Result<void> save() const;
  void drop_ended();
  void remember(const Changes &changes);
  void revert(const Changes &changes);

  const System &system_;
  std::string path_;
  int lock_ = -1;
  std::vector<ThreadChange> threads_;  // `before` is what the thread had before any change
  std::vector<InterruptChange> interrupts_;
};

}  // namespace redag::robot
