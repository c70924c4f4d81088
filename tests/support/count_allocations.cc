#include "tests/support/count_allocations.h"

#include <dlfcn.h>

#include <cstddef>
#include <cstring>

namespace {

thread_local long num_allocations = 0;
thread_local bool counting = false;

void Count(void* caller) {
  if (!counting) return;
  Dl_info library;
  if (dladdr(caller, &library) == 0 ||
      std::strstr(library.dli_fname, "openblas") == nullptr) {
    ++num_allocations;
  }
}

}  // namespace

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__) || \
    !defined(__GLIBC__)
#define INVGRAD_COUNTS_MALLOC 0
#else
#define INVGRAD_COUNTS_MALLOC 1
// Whatever allocates in a program with glibc ends in one of these.
extern "C" {
// glibc's own names.
// NOLINTBEGIN(bugprone-reserved-identifier)
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* memory, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);
// NOLINTEND(bugprone-reserved-identifier)

void* malloc(std::size_t size) {
  Count(__builtin_return_address(0));
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) {
  Count(__builtin_return_address(0));
  return __libc_calloc(count, size);
}
void* realloc(void* memory, std::size_t size) {
  Count(__builtin_return_address(0));
  return __libc_realloc(memory, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  Count(__builtin_return_address(0));
  return __libc_memalign(alignment, size);
}
void* memalign(std::size_t alignment, std::size_t size) {
  Count(__builtin_return_address(0));
  return __libc_memalign(alignment, size);
}
}
#endif

namespace invgrad {

bool CountsAllocations() { return INVGRAD_COUNTS_MALLOC == 1; }

long CountAllocations(const std::function<void()>& function) {
  num_allocations = 0;
  counting = true;
  function();
  counting = false;
  return num_allocations;
}

}  // namespace invgrad
