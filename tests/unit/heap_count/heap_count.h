// SPDX-License-Identifier: Apache-2.0
// Counter of heap calls, for tests of code that may not allocate: a program that links it replaces
// malloc, calloc, realloc, aligned_alloc and free. Builds with a sanitizer, which replaces them
// itself, do not define STICKSLIP_HEAP_IS_COUNTED.
#pragma once

#include <cstddef>

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define STICKSLIP_HEAP_IS_COUNTED 1
#endif

namespace stickslip::heap_count {

/// Starts counting the heap calls of the calling thread, from 0.
void start();

/// Stops counting; the number of allocations and releases since start().
std::size_t stop();

/// True between start() and stop() on the calling thread.
bool is_running();

/// Heap calls counted for one object that is created and destroyed: 2 in a program that counts.
std::size_t self_test();

}  // namespace stickslip::heap_count
