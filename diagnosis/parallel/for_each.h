// Independent pieces of work, shared by the cores.
#pragma once

#include <cstddef>
#include <functional>

namespace stickslip::parallel {

/// How many threads `asked` stands for: 0 is one per core.
int threads_for(int asked);

/// Runs `work(i)` for i in [0, count) on so many threads. The work of one i must not depend on
/// another. Once all threads have ended, rethrows the exception of the lowest i that threw: the
/// same whatever the number of threads.
void for_each(std::size_t count, int threads, const std::function<void(std::size_t)>& work);

}  // namespace stickslip::parallel
