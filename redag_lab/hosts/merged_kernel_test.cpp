// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/hosts/merged_kernel.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace redag::hosts {
namespace {

namespace fs = std::filesystem;
using metrics::JobThread;
using metrics::KernelInterrupt;
using metrics::KernelLoss;
using metrics::KernelProcess;
using metrics::KernelRow;
using metrics::KernelSwitch;
using metrics::KernelThread;

constexpr int kSecondHost = 1 << 22;

class MergedKernel : public ::testing::Test {
 protected:
  ~MergedKernel() override { fs::remove_all(folder_); }

  // Adds a host, with a record unless there are no rows.
  void add(const std::string &name, Duration shift, std::uint32_t first_task, const std::vector<KernelRow> &rows) {
    const fs::path place = folder_ / name;
    fs::create_directories(place);
    trace::RunInfo info;
    info.provenance.command = "redag run " + name;
    const ClockStatement exact{.readings = {OffsetReading{}}};
    Host host{.name = name,
              .path = place / "events.redag",
              .info = info,
              .clock_by = "0",
              .clock = ClockOffset::of(exact, 0, 1, 0).value(),
              .shift = shift,
              .first_task = first_task};
    if (!rows.empty()) {
      metrics::KernelWriter writer =
          metrics::KernelWriter::create(place / metrics::kKernelFile, host.info.provenance).value();
      for (const KernelRow &row : rows) writer.add(row);
      ASSERT_TRUE(writer.commit());
    }
    merged_.hosts.push_back(std::move(host));
  }

  Result<std::vector<KernelRow>> merge(const std::function<bool()> &is_stopped = [] { return false; }) {
    const Result<std::vector<HostKernel>> kernels = open_kernel_records(merged_);
    if (!kernels) return tl::unexpected<Diagnostics>(kernels.error());
    const std::string path = folder_ / metrics::kKernelFile;
    metrics::KernelWriter writer = metrics::KernelWriter::create(path, {}).value();
    if (Result<void> written = merge_kernel_records(merged_, *kernels, is_stopped, writer); !written) {
      return tl::unexpected<Diagnostics>(written.error());
    }
    EXPECT_TRUE(writer.commit());
    metrics::KernelReader reader = metrics::KernelRecord::open(path).value().read().value();
    std::vector<KernelRow> rows;
    while (std::optional<KernelRow> row = reader.next().value()) rows.push_back(*std::move(row));
    return rows;
  }

  MergedRun merged_;
  const fs::path folder_ = fs::path(::testing::TempDir()) / ("redag_merged_kernel." + std::to_string(::getpid()));
};

TEST_F(MergedKernel, EachHostHasNumbersOfItsOwn) {
  merged_.info.end = 100;
  add("vision", 0, 0,
      {KernelProcess{7, "robot"}, KernelThread{7, "redag-0", 7}, JobThread{TaskId(1), 4, 7},
       KernelSwitch{10, 2, 0, false, 7, 48}, KernelSwitch{30, 2, 7, true, 9, 120}});
  add("arm", 0, 3, {});
  add("drive", -5, 5,
      {KernelProcess{7, "robot"}, KernelThread{7, "redag-0", 7}, KernelThread{9, "cc1plus-9", 0},
       JobThread{TaskId(1), 4, 7}, KernelSwitch{20, 0, 0, false, 7, 48}, KernelLoss{3},
       KernelInterrupt{21, 22, 1, "eth0"}, KernelSwitch{104, 0, 7, true, 9, 120}, KernelSwitch{105, 0, 9, true, 0, 120},
       KernelLoss{9}});
  const auto drive = [](int thread) { return 2 * kSecondHost + thread; };
  const Result<std::vector<KernelRow>> rows = merge();
  ASSERT_TRUE(rows) << to_string(rows.error());
  const std::vector<KernelRow> expected = {KernelProcess{7, "vision/robot"},
                                           KernelThread{7, "redag-0", 7},
                                           JobThread{TaskId(1), 4, 7},
                                           KernelSwitch{10, 2, 0, false, 7, 48},
                                           KernelProcess{drive(7), "drive/robot"},
                                           KernelThread{drive(7), "redag-0", drive(7)},
                                           KernelThread{drive(9), "drive/cc1plus-9", 0},
                                           JobThread{TaskId(6), 4, drive(7)},
                                           KernelSwitch{15, 3, 0, false, drive(7), 48},
                                           KernelLoss{3},
                                           KernelInterrupt{16, 17, 4, "drive/eth0"},
                                           KernelSwitch{30, 2, 7, true, 9, 120},
                                           KernelSwitch{99, 3, drive(7), true, drive(9), 120}};
  EXPECT_EQ(*rows, expected);
}

TEST_F(MergedKernel, DamageAndStopsAreErrors) {
  merged_.info.end = kNever;
  std::vector<KernelRow> rows;
  for (Time at = 0; at < 5000; ++at) rows.emplace_back(KernelSwitch{.time = at, .from = 1, .to = 2});
  add("vision", 0, 0, rows);
  EXPECT_FALSE(merge([] { return true; }));
  add("drive", 0, 1, {KernelSwitch{.time = 1, .cpu = 9999, .from = 1, .to = 2}});
  const Result<std::vector<KernelRow>> odd = merge();
  ASSERT_FALSE(odd);
  EXPECT_NE(to_string(odd.error()).find("no machine has a processor 9999"), std::string::npos);
  const fs::path file = folder_ / "drive" / metrics::kKernelFile;
  fs::resize_file(file, fs::file_size(file) - 1);
  const Result<std::vector<KernelRow>> cut = merge();
  ASSERT_FALSE(cut);
  EXPECT_NE(to_string(cut.error()).find(file.string()), std::string::npos);
}

}  // namespace
}  // namespace redag::hosts
