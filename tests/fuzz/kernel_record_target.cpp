// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <vector>

#include "redag/base/check.hpp"
#include "redag_analysis/metrics/kernel_record.hpp"
#include "redag_analysis/metrics/why_kernel.hpp"
#include "tests/fuzz/scratch_file.hpp"
#include "tests/fuzz/targets.hpp"

namespace redag::fuzz {
namespace {

// All rows, if the whole file can be read.
std::optional<std::vector<metrics::KernelRow>> rows_of(const metrics::KernelRecord &record) {
  Result<metrics::KernelReader> reader = record.read();
  REDAG_CHECK(reader.has_value(), "its first line was read before");
  std::vector<metrics::KernelRow> rows;
  for (;;) {
    const Result<std::optional<metrics::KernelRow>> row = reader->next();
    REDAG_CHECK(row || !row.error().empty(), "a refusal says why");
    if (!row) return std::nullopt;
    if (!*row) return rows;
    rows.push_back(**row);
  }
}

void follow(const metrics::KernelRecord &record, const std::vector<metrics::KernelRow> &rows) {
  metrics::KernelView view(record.read().value());
  REDAG_CHECK(view.read_until(kNever).has_value(), "all rows were read before");
  for (const metrics::KernelRow &row : rows) {
    const auto *const job = std::get_if<metrics::JobThread>(&row);
    if (job == nullptr) continue;
    Time at = 0;
    for (const auto &stretch : view.follow(job->thread, 0, kSecond)) {
      REDAG_CHECK(stretch.begin == at && stretch.end > at, "stretches without gaps");
      at = stretch.end;
    }
    REDAG_CHECK(at == kSecond, "stretches until the end");
  }
}

}  // namespace

void kernel_record_target(std::string_view input) {
  const Result<metrics::KernelRecord> record = metrics::KernelRecord::of(std::string(input), "kernel.jsonl");
  if (!record) {
    REDAG_CHECK(!record.error().empty(), "a refusal says why");
    return;
  }
  const auto rows = rows_of(*record);
  if (!rows) return;
  follow(*record, *rows);
  const std::string path = scratch_folder() + "/kernel.jsonl.gz";
  Result<metrics::KernelWriter> writer = metrics::KernelWriter::create(path, record->run());
  REDAG_CHECK(writer.has_value(), "kernel.jsonl.gz");
  for (const metrics::KernelRow &row : *rows) writer->add(row);
  REDAG_CHECK(writer->commit().has_value(), "kernel.jsonl.gz");
  const Result<metrics::KernelRecord> again = metrics::KernelRecord::open(path);
  REDAG_CHECK(again.has_value() && rows_of(*again).has_value(), "what was written can be read");
}

}  // namespace redag::fuzz
