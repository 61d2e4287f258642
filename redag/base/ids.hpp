// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Typed indices. An id is an index into the array that owns what it names. The tag keeps a task's index from being used
// as a DAG's. Plain values.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>

namespace redag {

template <class Tag>
struct Id {
  std::uint32_t value = kNoneValue;

  static constexpr std::uint32_t kNoneValue = std::numeric_limits<std::uint32_t>::max();

  constexpr Id() = default;
  constexpr explicit Id(std::size_t index) : value(static_cast<std::uint32_t>(index)) {}

  [[nodiscard]] static constexpr Id none() { return Id{}; }
  [[nodiscard]] constexpr bool valid() const { return value != kNoneValue; }

  friend constexpr auto operator<=>(const Id &, const Id &) = default;  // NOLINT(modernize-use-nullptr): a false alarm
};

using TaskId = Id<struct TaskTag>;      // index of a task in its workload: DAG by DAG, task by task
using DagId = Id<struct DagTag>;        // index of a DAG in its workload
using WorkerId = Id<struct WorkerTag>;  // one of the platform's m processors
using DeviceId = Id<struct DeviceTag>;  // index of a device in its platform
using JobSlot = Id<struct JobTag>;      // storage of a live job; reused once the job has ended

}  // namespace redag

template <class Tag>
struct std::hash<redag::Id<Tag>> {
  std::size_t operator()(redag::Id<Tag> id) const noexcept { return std::hash<std::uint32_t>{}(id.value); }
};
