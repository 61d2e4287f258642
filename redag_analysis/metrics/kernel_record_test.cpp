// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/kernel_record.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <vector>

#include "redag/trace/output_file.hpp"

namespace redag::metrics {
namespace {

// All rows, or the first error.
Result<std::vector<KernelRow>> rows_of(const Result<KernelRecord> &record) {
  if (!record) return tl::unexpected<Diagnostics>(record.error());
  Result<KernelReader> reader = record->read();
  if (!reader) return tl::unexpected<Diagnostics>(reader.error());
  std::vector<KernelRow> rows;
  for (;;) {
    const Result<std::optional<KernelRow>> row = reader->next();
    if (!row) return tl::unexpected<Diagnostics>(row.error());
    if (!*row) return rows;
    rows.push_back(**row);
  }
}

class KernelRecordFile : public ::testing::Test {
 protected:
  void SetUp() override {
    run_.created = "2026-01-31T12:00:00Z";
    run_.command = "redag run --kernel";
    Result<KernelWriter> writer = KernelWriter::create(path_, run_);
    ASSERT_TRUE(writer) << to_string(writer.error());
    for (const KernelRow &row : rows_) writer->add(row);
    for (int i = 0; i < 3'000; ++i) {
      rows_.emplace_back(KernelSwitch{.time = 10 + i, .cpu = i % 2, .from = 7 + i % 3, .to = 7 + i % 5});
      writer->add(rows_.back());
    }
    const Result<void> written = writer->commit();
    ASSERT_TRUE(written) << to_string(written.error());
  }
  ~KernelRecordFile() override { std::filesystem::remove(path_); }

  Provenance run_;
  std::vector<KernelRow> rows_{KernelProcess{7, "robot"},
                               KernelThread{7, "redag-0", 7},
                               KernelThread{8, "a \"name\"\\ [x]", 0},
                               JobThread{TaskId(1), 4, 7},
                               KernelLoss{3},
                               KernelSwitch{-5, 0, 0, false, 7, 48},
                               KernelInterrupt{1, 2, 0, "eth0"},
                               KernelSwitch{10, 1, 7, true, 8, 120}};
  const std::string path_ =
      (std::filesystem::path(::testing::TempDir()) / ("redag_kernel_record." + std::to_string(::getpid()))).string();
};

TEST_F(KernelRecordFile, IsReadAsItWasWritten) {
  const Result<KernelRecord> record = KernelRecord::open(path_);
  ASSERT_TRUE(record) << to_string(record.error());
  EXPECT_EQ(record->run(), run_);
  for (int round = 0; round < 2; ++round) {
    const Result<std::vector<KernelRow>> rows = rows_of(record);
    ASSERT_TRUE(rows) << to_string(rows.error());
    EXPECT_EQ(*rows, rows_);
  }
  EXPECT_LT(std::filesystem::file_size(path_), 8 * rows_.size()) << "this is hardly compressed";
}

TEST_F(KernelRecordFile, IsOfItsRunAlone) {
  const std::string folder = path_ + ".folder";
  std::filesystem::create_directory(folder);
  trace::RunInfo info;
  const auto found = [&] {
    const Result<std::optional<KernelRecord>> record = KernelRecord::beside(folder + "/events.redag", info);
    EXPECT_TRUE(record) << to_string(record.error());
    return record && *record;
  };
  EXPECT_FALSE(found());
  std::filesystem::copy_file(path_, folder + "/kernel.jsonl.gz");
  EXPECT_FALSE(found());
  info.provenance = run_;
  EXPECT_TRUE(found());
  std::filesystem::remove_all(folder);
}

// A cut or changed file is refused, or a change that gzip's checksum finds at the end.
TEST_F(KernelRecordFile, DamageIsFound) {
  const std::string bytes = trace::read_file(path_).value();
  for (std::size_t size = 0; size < bytes.size(); size += 1 + bytes.size() / 97) {
    const auto rows = rows_of(KernelRecord::of(bytes.substr(0, size), "kernel.jsonl.gz"));
    ASSERT_FALSE(rows) << size;
    EXPECT_EQ(rows.error().front().file, "kernel.jsonl.gz");
  }
  for (std::size_t at = 10; at < bytes.size(); at += 1 + bytes.size() / 97) {
    std::string changed = bytes;
    changed[at] = static_cast<char>(changed[at] ^ 0x10);
    EXPECT_FALSE(rows_of(KernelRecord::of(changed, "kernel.jsonl.gz"))) << at;
  }
  EXPECT_FALSE(rows_of(KernelRecord::of(bytes + "more", "kernel.jsonl.gz")));
}

TEST(KernelRecord, MistakesHaveTheirLine) {
  const std::string head = R"({"format":"redag.kernel/2"})"
                           "\n";
  const auto error = [&](const std::string &text) {
    const auto rows = rows_of(KernelRecord::of(text, "kernel.jsonl"));
    return rows ? std::string("none") : rows.error().front().to_string();
  };
  EXPECT_EQ(error(head + "{\"end\":true}\n"), "none");
  EXPECT_EQ(error(head + "{\"end\":true}"), "none");
  EXPECT_EQ(error(head), "kernel.jsonl:2:1: error: the file is incomplete: its last line is missing");
  EXPECT_NE(error(head + "{\"end\":true}\n[]\n").find("kernel.jsonl:3:1: error: there is text"), std::string::npos);
  for (const char *none : {"", "x", "{}\n", "{\"format\":\"redag.kernel/1\"}\n"}) {
    EXPECT_NE(error(none).find("kernel.jsonl:1:1: error: this is not a kernel's record"), std::string::npos) << none;
  }
  for (const char *bad : {"[]", "[1]", "[\"switch\",1,0,0,true,7]", "[\"switch\",1,0,0,1,7,8]", "[\"job\",-1,0,7]",
                          "[\"thread\",1,2,0]", "[\"thread\",1,\"x\",true]", "[\"process\",0,\"x\"]", "[\"lost\",-1]",
                          "[\"interrupt\",2,1,0,\"x\"]", "[\"switch\",9223372036854775807,0,0,true,7,8]", "nonsense"}) {
    EXPECT_NE(error(head + bad + "\n").find("kernel.jsonl:2:1: error: this line is no event"), std::string::npos)
        << bad;
  }
  const std::string late = "[\"switch\",5,0,0,true,7,8]\n[\"switch\",4,0,0,true,7,8]\n";
  EXPECT_NE(error(head + late).find("kernel.jsonl:3:1: "), std::string::npos);
  EXPECT_NE(error(head + std::string(1 << 20, 'x')).find("too long"), std::string::npos);
}

}  // namespace
}  // namespace redag::metrics
