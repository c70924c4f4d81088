// The peak of the memory that libtorch allocates in this thread while the
// object lives, in addition to what it had.
#ifndef INVGRAD_TORCH_PEAK_MEMORY_H_
#define INVGRAD_TORCH_PEAK_MEMORY_H_

#include <algorithm>
#include <cstdint>
#include <memory>

#include "c10/core/Allocator.h"
#include "c10/util/ThreadLocalDebugInfo.h"

namespace invgrad {

class PeakMemory {
  // Of all memory in use: int64_t, and size_t in later versions of libtorch.
  template <typename Total>
  static Total TotalOf(void (c10::MemoryReportingInfoBase::*)(
      void*, int64_t, Total, Total, c10::Device));
  using Total =
      decltype(TotalOf(&c10::MemoryReportingInfoBase::reportMemoryUsage));

 public:
  PeakMemory()
      : counter_(std::make_shared<Counter>()),
        guard_(c10::DebugInfoKind::PROFILER_STATE, counter_) {}

  double bytes() const { return static_cast<double>(counter_->peak); }

 private:
  struct Counter final : c10::MemoryReportingInfoBase {
    void reportMemoryUsage(void* /*pointer*/,
                           int64_t size,
                           Total /*allocated*/,
                           Total /*reserved*/,
                           c10::Device /*device*/) override {
      current += size;
      peak = std::max(peak, current);
    }
    bool memoryProfilingEnabled() const override { return true; }
    int64_t current = 0;
    int64_t peak = 0;
  };

  std::shared_ptr<Counter> counter_;
  c10::DebugInfoGuard guard_;
};

}  // namespace invgrad

#endif  // INVGRAD_TORCH_PEAK_MEMORY_H_
