// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "redag_lab/experiment/shard.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>

#include <fmt/format.h>

namespace redag::experiment {
namespace {

std::optional<std::uint32_t> number(const Variables &variable, const char *name) {
  const char *text = variable(name);
  if (text == nullptr) return std::nullopt;
  const std::string_view digits = text;
  std::uint32_t value = 0;
  const auto [stop, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error != std::errc() || stop != digits.data() + digits.size()) return std::nullopt;
  return value;
}

struct Place {
  const char *index;  // from 0
  const char *count;
};
// srun sets the first pair for its tasks, and not for a batch script, of which there is one whatever --ntasks says.
constexpr std::array<Place, 3> kPlaces = {Place{"SLURM_PROCID", "SLURM_STEP_NUM_TASKS"},
                                          Place{"OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"},
                                          Place{"PMI_RANK", "PMI_SIZE"}};

}  // namespace

Result<Shard> shard_of_environment(const Variables &variable) {
  Shard shard;
  bool found = false;
  const auto id = number(variable, "SLURM_ARRAY_TASK_ID");
  const auto count = number(variable, "SLURM_ARRAY_TASK_COUNT");
  if (id && count) {
    const std::uint32_t first = number(variable, "SLURM_ARRAY_TASK_MIN").value_or(1);
    const std::uint32_t last = number(variable, "SLURM_ARRAY_TASK_MAX").value_or(first + *count - 1);
    const std::uint32_t step = std::max(1U, number(variable, "SLURM_ARRAY_TASK_STEP").value_or(1));
    const bool even = *id >= first && *id <= last && (*id - first) % step == 0 && (last - first) / step + 1 == *count;
    if (!even) {
      return make_error(fmt::format("task {} of a Slurm array with gaps cannot tell which share is its own", *id),
                        "give it with --shard i/n, such as --shard $SLURM_ARRAY_TASK_ID/100");
    }
    shard = {(*id - first) / step + 1, *count};
    found = true;
  }
  for (const Place &place : kPlaces) {
    const auto index = number(variable, place.index);
    const auto size = number(variable, place.count);
    if (!index || !size || *index >= *size) continue;
    shard = {(shard.index - 1) * *size + *index + 1, shard.count * *size};
    found = true;
    break;
  }
  if (found) return shard;
  return make_error("'auto' is the share of a task of Slurm or a rank of mpirun, and this process is neither",
                    "start it with sbatch --array, srun or mpirun, or give i/n, such as 1/4");
}

Result<Shard> parse_shard(std::string_view text) {
  Shard shard;
  const char *end = text.data() + text.size();
  const auto [slash, bad_index] = std::from_chars(text.data(), end, shard.index);
  if (bad_index == std::errc() && slash != end && *slash == '/') {
    const auto [stop, bad_count] = std::from_chars(slash + 1, end, shard.count);
    if (bad_count == std::errc() && stop == end && shard.index >= 1 && shard.index <= shard.count) return shard;
  }
  return make_error(fmt::format("'{}' is not a shard", text), "write i/n with 1 <= i <= n, such as 1/4; or auto");
}

std::string to_string(const Shard &shard) { return fmt::format("{}/{}", shard.index, shard.count); }

}  // namespace redag::experiment
