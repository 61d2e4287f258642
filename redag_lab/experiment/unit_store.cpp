// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/unit_store.hpp"

#include <fcntl.h>
#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <chrono>
#include <cstring>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "redag/base/check.hpp"
#include "redag/base/lock_guard.hpp"
#include "redag/base/mutex.hpp"
#include "redag/loader/text_file.hpp"

namespace redag::experiment {
namespace {

Time now() { return std::chrono::steady_clock::now().time_since_epoch() / std::chrono::nanoseconds(1); }

std::string row_of(std::uint64_t unit, std::string_view result) {
  const std::string fields = fmt::format("{},{}", unit, result);
  return fmt::format("{:016x},{}\n", checksum(fields), fields);
}

// Returns nothing for a row that is damaged.
std::optional<std::pair<std::uint64_t, std::string>> parse_row(std::string_view line) {
  const std::size_t unit_at = line.find(',') + 1;
  const std::size_t result_at = line.find(',', unit_at) + 1;
  if (unit_at == 0 || result_at == 0) return std::nullopt;
  std::uint64_t unit = 0;
  const auto [stop, bad] = std::from_chars(line.data() + unit_at, line.data() + result_at - 1, unit);
  std::string result(line.substr(result_at));
  if (bad != std::errc() || row_of(unit, result) != fmt::format("{}\n", line)) return std::nullopt;
  return std::pair(unit, std::move(result));
}

// Reads the rows of a file. Returns the length of its whole rows: a killed process can leave a part of one.
Result<std::size_t> read_rows(const std::string &file, const std::string &subject, const Accept &accept) {
  const Result<std::string> text = read_file(file);
  if (!text) return tl::unexpected<Diagnostics>(text.error());
  std::string_view rest = *text;
  for (std::size_t end = 0; (end = rest.find('\n')) != std::string_view::npos; rest.remove_prefix(end + 1)) {
    const std::string_view line = rest.substr(0, end);
    if (rest.size() == text->size()) {
      if (line == subject) continue;
      return file_error(file, 1, "holds results of another plan or of another version of redag",
                        fmt::format("expected '{}': choose another folder", subject));
    }
    const auto row = parse_row(line);
    if (!row) continue;
    if (const Result<void> accepted = accept(row->first, row->second); !accepted) {
      return tl::unexpected<Diagnostics>(accepted.error());
    }
  }
  return text->size() - rest.size();
}

}  // namespace

std::uint64_t checksum(std::string_view text) {
  std::uint64_t hash = 0xcbf29ce484222325ULL;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3ULL;
  return hash;
}

Result<UnitStore> UnitStore::open(const std::string &folder, const std::string &subject, const Accept &accept) {
  const std::string own = folder + "/units.csv";
  const auto failed = [&own](const char *what) {
    return file_error(own, 0, fmt::format("{}: {}", what, std::strerror(errno)));
  };
  const int descriptor = ::open(own.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
  if (descriptor < 0) return failed("cannot open");
  UnitStore store(own, descriptor);
  if (::flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
    if (errno != EWOULDBLOCK) return failed("cannot lock");
    return file_error(own, 0, "another process is writing to this file", "wait for it, or choose another folder");
  }
  const Result<std::size_t> whole = read_rows(own, subject, accept);
  if (!whole) return tl::unexpected<Diagnostics>(whole.error());
  if (::ftruncate(descriptor, static_cast<off_t>(*whole)) != 0) return failed("cannot write");
  if (*whole == 0) {
    if (const Result<void> begun = store.write(subject + "\n"); !begun) {
      return tl::unexpected<Diagnostics>(begun.error());
    }
  }
  return store;
}

UnitStore::UnitStore(UnitStore &&other) noexcept
    : path_(std::move(other.path_)), descriptor_(std::exchange(other.descriptor_, -1)), last_sync_(other.last_sync_) {}

UnitStore::~UnitStore() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

Result<void> UnitStore::write(std::string_view text) {
  while (!text.empty()) {
    const ssize_t written = ::write(descriptor_, text.data(), text.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return file_error(path_, 0, fmt::format("cannot write: {}", std::strerror(errno)));
    text.remove_prefix(static_cast<std::size_t>(written));
  }
  return {};
}

Result<void> UnitStore::append(std::uint64_t unit, const std::string &result) {
  REDAG_CHECK(result.find('\n') == std::string::npos, "a result is one line");
  if (Result<void> written = write(row_of(unit, result)); !written) return written;
  return now() - last_sync_ < 2 * kSecond ? Result<void>() : sync();
}

Result<void> UnitStore::sync() {
  last_sync_ = now();
  if (::fdatasync(descriptor_) == 0) return {};
  return file_error(path_, 0, fmt::format("cannot write to disk: {}", std::strerror(errno)));
}

Result<void> run_units(const std::vector<std::uint64_t> &units, std::uint32_t jobs, const std::atomic<bool> &stop,
                       const Evaluate &evaluate, const Accept &accept) {
  std::atomic<std::size_t> next{0};
  std::atomic<bool> failed{false};
  Mutex mutex;  // guards `done` and calls of `accept`
  Result<void> done;
  const auto work = [&] {
    while (!stop && !failed) {
      const std::size_t mine = next++;
      if (mine >= units.size()) return;
      const Result<std::string> result = evaluate(units[mine]);
      const LockGuard lock(mutex);
      if (!done) return;
      if (result) {
        done = accept(units[mine], *result);
      } else {
        done = tl::unexpected<Diagnostics>(result.error());
      }
      if (!done) failed = true;
    }
  };
  namespace tbb = oneapi::tbb;
  const tbb::global_control allow(tbb::global_control::max_allowed_parallelism, jobs);
  tbb::task_arena arena(static_cast<int>(jobs));
  arena.execute([&] {
    tbb::parallel_for(
        0U, jobs, [&](std::uint32_t) { work(); }, tbb::simple_partitioner());
  });
  return done;
}

}  // namespace redag::experiment
