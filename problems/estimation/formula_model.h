// The model of a regression that a user's formula gives, as Ceres' cost function.
#ifndef PROBLEMS_ESTIMATION_FORMULA_MODEL_H_
#define PROBLEMS_ESTIMATION_FORMULA_MODEL_H_

#include <algorithm>
#include <memory>
#include <vector>

#include "Eigen/Core"
#include "ceres/dynamic_autodiff_cost_function.h"
#include "problems/estimation/formula.h"

namespace invgrad {

// A formula of predictors x and parameters b.
struct FormulaModel {
  Formula formula;
  // Of each variable: k is x_k, and -1 - k is b_k.
  std::vector<int> sources;

  // `b`: of a type with operator[].
  template <typename T, typename Parameters>
  T Evaluate(const double* x, const Parameters& b) const {
    std::vector<T> values;
    values.reserve(sources.size());
    for (const int source : sources) {
      values.push_back(source >= 0 ? T(x[source]) : T(b(-1 - source)));
    }
    return formula.Evaluate(values);
  }
};

// weight (y - formula).
struct FormulaResidual {
  std::shared_ptr<const FormulaModel> model;
  std::vector<double> x;
  double y;
  double weight;

  // A parameter block each.
  template <typename T>
  bool operator()(T const* const* b, T* residual) const {
    const auto parameter = [b](int k) { return *b[k]; };
    residual[0] = weight * (y - model->Evaluate<T>(x.data(), parameter));
    return true;
  }
};

// One residual; n parameter blocks of size 1. The caller owns it.
inline ceres::CostFunction* MakeFormulaCost(
    const std::shared_ptr<const FormulaModel>& model,
    Eigen::Index n,
    const double* x,
    double y,
    double weight) {
  const auto p = std::count_if(model->sources.begin(),
                               model->sources.end(),
                               [](int source) { return source >= 0; });
  auto* cost = new ceres::DynamicAutoDiffCostFunction<FormulaResidual>(
      new FormulaResidual{model, {x, x + p}, y, weight});
  for (Eigen::Index k = 0; k < n; ++k) cost->AddParameterBlock(1);
  cost->SetNumResiduals(1);
  return cost;
}

}  // namespace invgrad

#endif  // PROBLEMS_ESTIMATION_FORMULA_MODEL_H_
