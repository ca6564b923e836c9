// SPDX-License-Identifier: Apache-2.0
#include "tests/unit/heap_count/heap_count.h"

#ifdef STICKSLIP_HEAP_IS_COUNTED

namespace {
thread_local bool running = false;
thread_local std::size_t calls = 0;

void count() {
  if (running) ++calls;
}
}  // namespace

// Names of glibc.
// NOLINTBEGIN(bugprone-reserved-identifier)
extern "C" {
void* __libc_malloc(std::size_t size);
void __libc_free(void* pointer);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* pointer, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);

void* malloc(std::size_t size) {
  count();
  return __libc_malloc(size);
}
void free(void* pointer) {
  if (pointer != nullptr) count();
  __libc_free(pointer);
}
void* calloc(std::size_t number, std::size_t size) {
  count();
  return __libc_calloc(number, size);
}
void* realloc(void* pointer, std::size_t size) {
  count();
  return __libc_realloc(pointer, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  count();
  return __libc_memalign(alignment, size);
}
}
// NOLINTEND(bugprone-reserved-identifier)

namespace stickslip::heap_count {

void start() {
  calls = 0;
  running = true;
}

std::size_t stop() {
  running = false;
  return calls;
}

bool is_running() { return running; }

std::size_t self_test() {
  start();
  int* volatile one = new int(1);  // volatile: an unused pair is optimised away
  delete one;
  return stop();
}

}  // namespace stickslip::heap_count

#endif
