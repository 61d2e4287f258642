// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// The files of the repository. Pure.
#pragma once

#include <filesystem>

namespace redag::testing {

// The folder of the sources that this build was made from, for tests of the files that the repository ships.
std::filesystem::path repository();

}  // namespace redag::testing
