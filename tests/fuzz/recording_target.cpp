// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "redag/base/check.hpp"
#include "redag/loader/workload_yaml.hpp"
#include "redag_lab/import/model.hpp"
#include "redag_lab/import/recording.hpp"
#include "tests/fuzz/targets.hpp"

namespace redag::fuzz {
namespace {

constexpr std::array<std::string_view, 8> kNames = {"", "/", "/a", "/b", "lidar", "a: b\n# c", "reentrant", "\xff\x01"};
constexpr std::size_t kBytes = 8;  // of an event

lab::RosEvent event_of(std::string_view bytes, Time &now) {
  const auto byte = [&](std::size_t at) { return static_cast<std::uint8_t>(bytes[at]); };
  lab::RosEvent event;
  event.kind = static_cast<lab::RosEvent::Kind>(byte(0) % (static_cast<int>(lab::RosEvent::Kind::Switch) + 1));
  now += Time{byte(1)} << (byte(2) % 32);
  event.time = now;
  event.process = byte(2) >> 7U;
  event.thread = byte(3) % 4;
  event.handle = byte(4) % 16;
  event.other = byte(5) % 16;
  event.third = byte(5) / 16;
  event.value = (std::int64_t{byte(6)} - 16) << (byte(7) % 48);
  event.name = kNames[byte(7) % kNames.size()];
  event.space = kNames[byte(6) % kNames.size()];
  event.program = "robot";
  return event;
}

}  // namespace

void recording_target(std::string_view input) {
  lab::Recording recording;
  Time now = 0;
  for (; input.size() >= kBytes; input.remove_prefix(kBytes)) recording.add(event_of(input, now));
  for (const auto &[process, record] : recording.processes()) {
    const Result<lab::ImportedWorkload> imported = lab::import_workload(recording, process);
    if (!imported) {
      REDAG_CHECK(!imported.error().empty(), "a refusal says why");
      continue;
    }
    const Result<LoadedWorkload> loaded = parse_workload(lab::to_yaml(*imported), "fuzz.yaml");
    REDAG_CHECK(loaded && loaded->workload == imported->workload, "the file is read as it was meant");
  }
}

}  // namespace redag::fuzz
