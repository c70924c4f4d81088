// Memory that a computation keeps between calls.
#ifndef INVGRAD_SPECTRAL_ROUTES_ALIGNED_BUFFER_H_
#define INVGRAD_SPECTRAL_ROUTES_ALIGNED_BUFFER_H_

#include <cstddef>
#include <memory>
#include <new>

namespace invgrad {

// Numbers on a cache-line boundary. Grows, never shrinks.
class AlignedBuffer {
 public:
  // At least `size` numbers, of any value. Earlier pointers become invalid if
  // it grows.
  double* Reserve(size_t size) {
    if (size > size_) {
      data_.reset();  // before the new one, which may need the room
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
