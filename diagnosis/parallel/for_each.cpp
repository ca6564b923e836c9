// SPDX-License-Identifier: Apache-2.0
#include "diagnosis/parallel/for_each.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace stickslip::parallel {

int threads_for(int asked) {
  return asked > 0 ? asked : static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
}

void for_each(std::size_t count, int threads, const std::function<void(std::size_t)>& work) {
  const auto workers = std::min<std::size_t>(count, static_cast<std::size_t>(std::max(1, threads)));
  if (workers <= 1) {
    for (std::size_t i = 0; i < count; ++i) work(i);
    return;
  }
  std::atomic<std::size_t> next{0};
  std::exception_ptr failure;
  std::size_t failed = count;  // lowest index that threw
  std::mutex failure_mutex;
  {
    std::vector<std::jthread> pool;
    for (std::size_t t = 0; t < workers; ++t) {
      pool.emplace_back([&] {
        for (std::size_t i = next++; i < count; i = next++) {
          try {
            work(i);
          } catch (...) {
            const std::lock_guard lock(failure_mutex);
            if (i < failed) {
              failed = i;
              failure = std::current_exception();
            }
          }
        }
      });
    }
  }
  if (failure) std::rethrow_exception(failure);
}

}  // namespace stickslip::parallel
