// SPDX-License-Identifier: Apache-2.0
// Parallel loop over independent pieces of work.
#pragma once

#include <cstddef>
#include <functional>

namespace stickslip::parallel {

/// Number of threads for an option value: 0 is one per core.
int threads_for(int asked);

/// Runs `work(i)` for i in [0, count) on `threads` threads. The work of one i must not depend on
/// that of another. Once all threads have ended, rethrows the exception of the lowest i that threw,
/// independent of the number of threads.
void for_each(std::size_t count, int threads, const std::function<void(std::size_t)>& work);

}  // namespace stickslip::parallel
