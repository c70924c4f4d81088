// A temporary array whose memory the thread reuses.
//
// For functions that are called once a sample: only the first call allocates.
// Nested and recursive uses get separate arrays.
//
// Shapes:  size() elements, not initialized.
#ifndef INVGRAD_INTERNAL_SCRATCH_H_
#define INVGRAD_INTERNAL_SCRATCH_H_

#include <cstddef>
#include <utility>
#include <vector>

namespace invgrad {

template <typename T>
class Scratch {
 public:
  explicit Scratch(std::size_t size) {
    std::vector<std::vector<T>>& free = Free();
    if (!free.empty()) {
      memory_.swap(free.back());
      free.pop_back();
    }
    if (memory_.size() < size) memory_.resize(size);
    size_ = size;
  }
  ~Scratch() { Free().push_back(std::move(memory_)); }
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;

  T* data() { return memory_.data(); }
  std::size_t size() const { return size_; }
  T& operator[](std::size_t i) { return memory_[i]; }

 private:
  static std::vector<std::vector<T>>& Free() {
    thread_local std::vector<std::vector<T>> free;
    return free;
  }

  std::vector<T> memory_;
  std::size_t size_ = 0;
};

}  // namespace invgrad

#endif  // INVGRAD_INTERNAL_SCRATCH_H_
