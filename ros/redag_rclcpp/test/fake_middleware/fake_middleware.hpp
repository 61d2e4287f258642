// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// Starts threads as a middleware does: in functions of a library, whose file is called libzenohc.so.
#pragma once

#include <functional>
#include <thread>

namespace fake_middleware {

enum class By { StdThread, PthreadCreate };

/// Runs `main` on a thread. Returns what joins it.
[[nodiscard]] std::function<void()> start(By by, std::function<void()> main);

}  // namespace fake_middleware
