#include "problems/fields/fftw_planner.h"

#include <fftw3.h>

namespace invgrad {

std::mutex& FftwPlannerMutex() {
  static auto& mutex = *new std::mutex;
  return mutex;
}

std::shared_ptr<fftw_plan_s> SharePlan(fftw_plan_s* plan) {
  return {plan, [](fftw_plan unused) {
            const std::lock_guard<std::mutex> lock(FftwPlannerMutex());
            fftw_destroy_plan(unused);
          }};
}

}  // namespace invgrad
