// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

#include "tests/testing/repository.hpp"

namespace redag::testing {

std::filesystem::path repository() { return REDAG_SOURCE_DIR; }

}  // namespace redag::testing
