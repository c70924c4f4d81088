// What the transforms of all grids share: FFTW executes plans in parallel, but
// creates and destroys only one at a time.
#ifndef PROBLEMS_FIELDS_FFTW_PLANNER_H_
#define PROBLEMS_FIELDS_FFTW_PLANNER_H_

#include <memory>
#include <mutex>

struct fftw_plan_s;

namespace invgrad {

// Held while a plan is created.
std::mutex& FftwPlannerMutex();

// Destroys the plan, under the mutex, with its last owner.
std::shared_ptr<fftw_plan_s> SharePlan(fftw_plan_s* plan);

}  // namespace invgrad

#endif  // PROBLEMS_FIELDS_FFTW_PLANNER_H_
