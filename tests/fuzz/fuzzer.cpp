// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// libFuzzer's entry point for one target, whose name the build sets.
#include <cstddef>
#include <cstdint>

#include "tests/fuzz/targets.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t *data, std::size_t size);

int LLVMFuzzerTestOneInput(const std::uint8_t *data, std::size_t size) {
  redag::fuzz::REDAG_FUZZ_TARGET({reinterpret_cast<const char *>(data), size});
  return 0;
}
