// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <cstddef>
#include <cstring>
#include <span>
#include <string>

#include "redag/base/check.hpp"
#include "redag/live/page.hpp"
#include "redag/live/reader.hpp"
#include "tests/fuzz/scratch_file.hpp"
#include "tests/fuzz/targets.hpp"

namespace redag::fuzz {
namespace {

using live::page::FrameHeader;
using live::page::Header;

// Corrects the checksum, which random bytes rarely match.
void complete(std::string &page) {
  Header header{};
  if (page.size() < sizeof(header)) return;
  std::memcpy(&header, page.data(), sizeof(header));
  const std::uint64_t offset = header.slot_offset + header.sequence % 2 * header.slot_size;
  FrameHeader frame{};
  if (offset > page.size() || page.size() - offset < sizeof(frame)) return;
  std::memcpy(&frame, page.data() + offset, sizeof(frame));
  const std::uint64_t size = header.frame_header_size + std::uint64_t{frame.dags} * header.dag_row_size +
                             std::uint64_t{frame.tasks} * header.task_row_size;
  if (size < sizeof(frame) || size > page.size() - offset) return;
  frame.sequence = header.sequence;
  std::memcpy(page.data() + offset, &frame, sizeof(frame));
  const auto bytes = std::as_bytes(std::span(page)).subspan(offset, size);
  frame.checksum = live::page::checksum(bytes.subspan(sizeof(frame.checksum)));
  std::memcpy(page.data() + offset, &frame.checksum, sizeof(frame.checksum));
}

}  // namespace

void live_page_target(std::string_view input) {
  std::string bytes(input);
  complete(bytes);
  const int tries = 1;  // no writer changes the page meanwhile
  const Result<live::Page> page = live::read_page(scratch_file("redag.1.0", bytes), tries);
  if (!page) {
    REDAG_CHECK(!page.error().empty(), "a refusal says why");
    return;
  }
  for (const live::TaskFrame &task : page->frame.tasks) {
    REDAG_CHECK(task.dag < page->frame.dags.size(), "a task is of a DAG that is there");
  }
  for (const live::DeviceFrame &device : page->frame.devices) {
    REDAG_CHECK(device.used <= device.slots, "a device has the slots that it uses");
    for (const std::uint32_t task : device.tasks) {
      REDAG_CHECK(task < page->frame.tasks.size(), "a device serves a task that is there");
    }
  }
}

}  // namespace redag::fuzz
