// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_analysis/metrics/kernel_record.hpp"

#include <gtest/gtest.h>

#include <filesystem>

namespace redag::metrics {
namespace {

TEST(KernelRecord, IsReadAsItWasWritten) {
  KernelRecord record;
  record.run.created = "2026-01-31T12:00:00Z";
  record.run.command = "redag run --kernel";
  record.lost = 3;
  record.names = {{7, "redag-0"}, {8, "a \"name\"\\ [x]"}};
  record.own = {7};
  record.jobs = {{TaskId(1), 4, 7}};
  record.switches = {{-5, 0, 0, false, 7, 48}, {10, 1, 7, true, 8, 120}};
  record.interrupts = {{1, 2, 0, "eth0"}};
  const std::string path = (std::filesystem::temp_directory_path() / "redag_kernel_record_test.jsonl").string();
  ASSERT_TRUE(write_kernel_record(path, record).has_value());
  const Result<KernelRecord> again = read_kernel_record(path);
  std::filesystem::remove(path);
  ASSERT_TRUE(again.has_value()) << to_string(again.error());
  EXPECT_TRUE(*again == record);
}

TEST(KernelRecord, MistakesHaveTheirLine) {
  const std::string head = R"({"format":"redag.kernel/1","lost":0})"
                           "\n";
  const auto error = [&](const std::string &text) {
    const Result<KernelRecord> record = parse_kernel_record(text, "kernel.jsonl");
    return record ? std::string("none") : record.error().front().to_string();
  };
  EXPECT_EQ(error(head + "{\"end\":true}\n"), "none");
  EXPECT_EQ(error(head), "kernel.jsonl:1:1: error: the file is incomplete: its last line is missing");
  EXPECT_EQ(error(""), "kernel.jsonl: error: the file is incomplete: its last line is missing");
  EXPECT_NE(error("{}\n").find("kernel.jsonl:1:1: error: this is not a kernel's record"), std::string::npos);
  for (const char *bad : {"[]", "[1]", "[\"switch\",1,0,0,true,7]", "[\"switch\",1,0,0,1,7,8]", "[\"job\",-1,0,7]",
                          "[\"thread\",1,2,true]", "[\"interrupt\",2,1,0,\"x\"]",
                          "[\"switch\",9223372036854775807,0,0,true,7,8]", "nonsense"}) {
    EXPECT_NE(error(head + bad + "\n").find("kernel.jsonl:2:1: error: this line is no event"), std::string::npos)
        << bad;
  }
  const std::string late = "[\"switch\",5,0,0,true,7,8]\n[\"switch\",4,0,0,true,7,8]\n";
  EXPECT_NE(error(head + late).find("kernel.jsonl:3:1: "), std::string::npos);
}

}  // namespace
}  // namespace redag::metrics
