// Includes the parts of invgrad that most programs use. Include it to begin
// with, or single headers for shorter compile times.
//
//   rules.h            update rules by name
//   update_callback.h  their steps inside ceres::Solve
//   minimize.h         a rule or a minimizer of Ceres on a ceres::Problem
//   train.h            training of a network in front of a simulator, with
//                      autodiff_simulator.h and random.h
//   rank_report.h      what a ceres::Problem does not determine
//   covariance.h       how exactly it determines the rest
//   blas_threads.h     one thread for OpenBLAS
//
// Every header of this folder is public; include others directly.
#ifndef INVGRAD_INVGRAD_H_
#define INVGRAD_INVGRAD_H_

#include "invgrad/autodiff_simulator.h"
#include "invgrad/blas_threads.h"
#include "invgrad/covariance.h"
#include "invgrad/minimize.h"
#include "invgrad/random.h"
#include "invgrad/rank_report.h"
#include "invgrad/rules.h"
#include "invgrad/train.h"
#include "invgrad/update_callback.h"
#include "invgrad/version.h"

#endif  // INVGRAD_INVGRAD_H_
