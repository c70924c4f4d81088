// A buffer that a computation reuses between calls.
#ifndef INVGRAD_SPECTRAL_ROUTES_ALIGNED_BUFFER_H_
#define INVGRAD_SPECTRAL_ROUTES_ALIGNED_BUFFER_H_

#include <cstddef>
#include <memory>
#include <new>

namespace invgrad {

// Aligned to a cache line. Grows, never shrinks.
class AlignedBuffer {
 public:
  // At least `size` uninitialized numbers. Invalidates earlier pointers if the
  // buffer grows.
  double* Reserve(size_t size) {
    if (size > size_) {
      data_.reset();  // frees memory before the new allocation
      data_.reset(static_cast<double*>(
          ::operator new(size * sizeof(double), kAlignment)));
      size_ = size;
    }
    return data_.get();
  }
  const double* data() const { return data_.get(); }

 private:
  static constexpr std::align_val_t kAlignment{64};
  struct Delete {
    void operator()(double* data) const { ::operator delete(data, kAlignment); }
  };

  size_t size_ = 0;
  std::unique_ptr<double, Delete> data_;
};

}  // namespace invgrad

#endif  // INVGRAD_SPECTRAL_ROUTES_ALIGNED_BUFFER_H_
