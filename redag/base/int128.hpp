// SPDX-FileCopyrightText: The ReDAG-RT developers
// SPDX-License-Identifier: Apache-2.0

// 128-bit integers for exact intermediate products: a compiler extension (GCC and Clang), named in one place.
#pragma once

namespace redag {

__extension__ using Int128 = __int128;
__extension__ using Uint128 = unsigned __int128;

}  // namespace redag
