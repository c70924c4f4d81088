// The cost of a model over a data set as a function of Ceres: L(theta) and its
// gradient by one backward pass, for Ceres' line searches.
//
// Fails:   Evaluate returns false where the model does.
#ifndef INVGRAD_CERES_MODEL_FUNCTION_H_
#define INVGRAD_CERES_MODEL_FUNCTION_H_

#include "ceres/first_order_function.h"
#include "invgrad/data.h"
#include "invgrad/model.h"

namespace invgrad {

class ModelFunction final : public ceres::FirstOrderFunction {
 public:
  // Model and data must outlive the function.
  ModelFunction(const Model* model, const DataSet* data);
  bool Evaluate(const double* parameters,
                double* cost,
                double* gradient) const override;
  int NumParameters() const override { return model_->num_weights(); }

 private:
  const Model* model_;
  const DataSet* data_;
};

}  // namespace invgrad

#endif  // INVGRAD_CERES_MODEL_FUNCTION_H_
