#include <utility>

#include "fmt/core.h"
#include "problems/estimation/estimation.h"
#include "problems/estimation/nist_file.h"
#include "problems/estimation/nist_models.h"
#include "problems/estimation/regression_estimation.h"

namespace invgrad {

std::unique_ptr<Estimation> ReadNistEstimation(
    const std::string& path,
    const ReadEstimationOptions& /*options*/,
    std::string* error) {
  NistData data;
  if (!ReadNistFile(path, &data, error)) {
    if (!IsEstimationFile(path, "nist")) {
      *error += "; or, for a table of your own, --model=\"FORMULA\"";
    }
    return nullptr;
  }
  std::string why;
  const NistModel* model = FindNistModel(data, &why);
  if (model == nullptr) {
    *error = path + ": " + why;
    return nullptr;
  }
  if (model->log_response && data.responses.minCoeff() <= 0.0) {
    *error = path + ": a response is not positive; its logarithm is needed";
    return nullptr;
  }
  if (!HasCertifiedSum(
          data, data.responses, SumOfSquares(*model, data, data.certified))) {
    *error = fmt::format(
        "{}: the certified parameters do not give the certified sum of "
        "squares: "
        "a number is cut off, or the model is not {}",
        path,
        model->formula);
    return nullptr;
  }
  EstimationTraits traits;
  traits.description = fmt::format("{} observations, {} parameters; {}",
                                   data.responses.size(),
                                   data.num_parameters(),
                                   model->formula);
  traits.extension = ".dat";
  Regression regression;
  regression.title = data.name;
  regression.y_label = model->log_response ? "log y" : "y";
  regression.shows_logarithms = model->log_response;
  regression.responses = data.responses;
  regression.predictors = data.predictors;
  regression.weights.setOnes(data.responses.size());
  regression.starts = data.starts;
  regression.linear = model->linear;
  regression.certified = data.certified;
  regression.certified_deviations = data.standard_deviations;
  regression.value = model->value;
  regression.make_cost = [model](const double* x, double y, double /*one*/) {
    return model->make_cost(x, y);
  };
  regression.write = NistWriter(data);
  return MakeRegressionEstimation(std::move(traits), std::move(regression));
}

}  // namespace invgrad
