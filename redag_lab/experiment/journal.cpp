// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/journal.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <utility>

#include <fmt/format.h>

#include "redag/base/check.hpp"
#include "redag/trace/output_file.hpp"

namespace redag::experiment {
namespace {

using trace::file_error;

constexpr std::string_view kFormat = "redag.experiment.units/1";
constexpr std::string_view kColumns = "unit,result\n";

std::string header(std::string_view subject) { return fmt::format("# {} {}\n{}", kFormat, subject, kColumns); }

// Returns the text without a last line that was not finished.
std::string_view whole_lines(std::string_view text) { return text.substr(0, text.rfind('\n') + 1); }

Result<std::vector<FinishedUnit>> parse(std::string_view text, const std::string &path, const std::string &head) {
  if (!text.starts_with(head)) {
    return file_error(path, 1, "holds results of another plan or of another version of redag",
                      "expected '" + head.substr(0, head.find('\n')) + "'; choose another folder");
  }
  std::vector<FinishedUnit> units;
  int line = 2;
  for (std::string_view rest = text.substr(head.size()); !rest.empty();) {
    ++line;
    const std::string_view row = rest.substr(0, rest.find('\n'));
    rest.remove_prefix(row.size() + 1);
    FinishedUnit unit;
    const char *end = row.data() + row.size();
    const auto [stop, error] = std::from_chars(row.data(), end, unit.unit);
    if (error != std::errc() || stop == end || *stop != ',') {
      return file_error(path, line, "this line is not a finished unit",
                        "expected 'unit,result'; delete this line if it is damaged");
    }
    unit.result.assign(stop + 1, end);
    units.push_back(std::move(unit));
  }
  if (Result<void> united = sort_and_unite(units, path); !united) {
    return tl::unexpected<Diagnostics>(std::move(united.error()));
  }
  return units;
}

}  // namespace

Result<std::vector<FinishedUnit>> read_journal(const std::string &path, std::string_view subject) {
  const Result<std::string> text = trace::read_file(path);
  if (!text) return tl::unexpected<Diagnostics>(text.error());
  return parse(whole_lines(*text), path, header(subject));
}

Result<void> sort_and_unite(std::vector<FinishedUnit> &units, const std::string &file) {
  std::stable_sort(units.begin(), units.end(),
                   [](const FinishedUnit &a, const FinishedUnit &b) { return a.unit < b.unit; });
  const auto clash = std::adjacent_find(units.begin(), units.end(), [](const FinishedUnit &a, const FinishedUnit &b) {
    return a.unit == b.unit && a.result != b.result;
  });
  if (clash != units.end()) {
    return file_error(
        file, 0,
        fmt::format("unit {} has two results, '{}' and '{}'", clash->unit, clash->result, std::next(clash)->result),
        "a unit depends on the plan alone: were they run by different builds of redag?");
  }
  units.erase(std::unique(units.begin(), units.end()), units.end());
  return {};
}

Journal::Journal(Journal &&other) noexcept
    : path_(std::move(other.path_)),
      descriptor_(std::exchange(other.descriptor_, -1)),
      broken_(other.broken_),
      buffer_(std::move(other.buffer_)),
      last_write_(other.last_write_),
      last_sync_(other.last_sync_),
      found_(std::move(other.found_)) {}

Journal::~Journal() {
  if (descriptor_ < 0) return;
  static_cast<void>(sync());
  ::close(descriptor_);
}

tl::unexpected<Diagnostics> Journal::failure(std::string_view what) const {
  return file_error(path_, 0, fmt::format("{}: {}", what, std::strerror(errno)));
}

Result<Journal> Journal::open(std::string path, std::string_view subject) {
  REDAG_CHECK(subject.find('\n') == std::string_view::npos, "the subject is one line");
  const int descriptor = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_APPEND, 0666);
  Journal journal(std::move(path), descriptor);
  if (descriptor < 0) return journal.failure("cannot open");
  if (::flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
    if (errno != EWOULDBLOCK) return journal.failure("cannot lock");
    return file_error(journal.path_, 0, "another process is writing to this folder",
                      "wait for that process, or choose another folder");
  }
  if (Result<void> begun = journal.begin(subject); !begun) {
    return tl::unexpected<Diagnostics>(std::move(begun.error()));
  }
  return journal;
}

// Keeps the whole lines, and writes the header of an empty file.
Result<void> Journal::begin(std::string_view subject) {
  Result<std::string> text = trace::read_file(path_);
  if (!text) return tl::unexpected<Diagnostics>(std::move(text.error()));
  const std::size_t whole = whole_lines(*text).size();
  const std::string head = header(subject);
  if (head.starts_with(whole_lines(*text))) {  // new, or killed while writing the header
    if (::ftruncate(descriptor_, 0) != 0) return failure("cannot truncate");
    buffer_ = head;
    return sync();
  }
  Result<std::vector<FinishedUnit>> units = parse(whole_lines(*text), path_, head);
  if (!units) return tl::unexpected<Diagnostics>(std::move(units.error()));
  if (whole < text->size() && ::ftruncate(descriptor_, static_cast<off_t>(whole)) != 0) {
    return failure("cannot truncate");
  }
  found_ = std::move(*units);
  return {};
}

Result<void> Journal::append(std::uint64_t unit, std::string_view result) {
  REDAG_CHECK(result.find('\n') == std::string_view::npos, "a result is one line");
  fmt::format_to(std::back_inserter(buffer_), "{},{}\n", unit, result);
  const Clock::time_point now = Clock::now();
  if (now - last_sync_ >= kSyncEvery) return sync();
  if (now - last_write_ >= kWriteEvery) return write();
  return {};
}

Result<void> Journal::write() {
  last_write_ = Clock::now();
  std::string_view rest = buffer_;
  while (!broken_ && !rest.empty()) {
    const ssize_t written = ::write(descriptor_, rest.data(), rest.size());
    if (written >= 0) {
      rest.remove_prefix(static_cast<std::size_t>(written));
    } else if (errno != EINTR) {
      broken_ = true;
      return failure("cannot write");
    }
  }
  buffer_.clear();
  return {};
}

Result<void> Journal::sync() {
  if (Result<void> written = write(); !written) return written;
  last_sync_ = Clock::now();
  if (!broken_ && ::fdatasync(descriptor_) != 0 && errno != EINVAL) return failure("cannot write to disk");
  return {};
}

}  // namespace redag::experiment
