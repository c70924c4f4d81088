// An estimation problem that is read from a file: parameters with a start, a
// ceres::Problem on them, a result file in the input's own format
// (uncompressed), pictures.
//
//   kind   file                        parameters           module
//   nist   .dat                        b                    nist_models.h
//   csv    .csv, .tsv; NIST's form     of a user's formula  formula.h
//   bal    .txt, .txt.bz2              cameras and points   bundle_adjustment.h
//   g2o    .g2o                        poses                pose_graph.h
#ifndef PROBLEMS_ESTIMATION_ESTIMATION_H_
#define PROBLEMS_ESTIMATION_ESTIMATION_H_

#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "Eigen/Core"
#include "ceres/evaluation_callback.h"
#include "ceres/ordered_groups.h"
#include "ceres/problem.h"
#include "invgrad/covariance.h"
#include "invgrad/minimize.h"
#include "invgrad/random.h"
#include "invgrad/separable.h"
#include "problems/estimation/pose_graph.h"
#include "problems/estimation/robust_loss.h"
#include "report/plot.h"

namespace invgrad {

struct EstimationTraits {
  std::string description;  // the sizes, on one line
  std::string
      linear_solver;      // the usual one, an option of Ceres' trust regions
  std::string extension;  // of the result file: ".dat"
  int num_starts = 1;
  // Of the starts, if these are drawn: one each. Empty: starts have numbers.
  std::vector<int> seeds = {};
  MinimizerOptions budget;  // the usual iterations and tolerances
  // The residuals are divided by their standard deviations. Otherwise a
  // covariance needs their estimated variance.
  bool has_unit_variance = false;
};

class Estimation {
 public:
  explicit Estimation(EstimationTraits traits) : traits_(std::move(traits)) {}
  virtual ~Estimation() = default;
  const EstimationTraits& traits() const { return traits_; }

  // Sets the parameters to a start, counted from 0.
  virtual void SetStart(int start) = 0;
  // Normal noise on the parameters that are estimated.
  virtual void Perturb(double sigma, NumpyRandom* random) = 0;

  // Returns a new problem, whose parameter blocks are members of this object.
  virtual std::unique_ptr<ceres::Problem> MakeProblem(
      const MakeLossFunction& make_loss) = 0;
  // Null: Ceres finds one.
  virtual std::shared_ptr<ceres::ParameterBlockOrdering> MakeOrdering() {
    return nullptr;
  }

  // Sets the parameters by chordal relaxation (chordal_relaxation.h), which may
  // cost more than the start. Returns false, and leaves them unchanged, if there
  // are no poses in a graph, or if it fails.
  virtual bool Relax() { return false; }

  // The parameters in which the residuals are proved to be affine.
  virtual std::vector<LinearBlock> LinearParameters() { return {}; }

  // For each parameter, the digits that agree with the certified value, if the
  // file has certified values.
  virtual std::optional<Eigen::VectorXd> Digits() const { return {}; }

  // The least cost, 0 if it is not known: --levels are above it.
  virtual double minimum() const { return 0.0; }

  // Whether a run is a solution, if that is known.
  virtual std::optional<bool> IsSolved(double /*initial_cost*/,
                                       double /*final_cost*/) const {
    return {};
  }

  // The cost of the constant that fits the data best, of a regression, without a
  // robust loss; NaN if it is not known.
  virtual double ConstantCost() const {
    return std::numeric_limits<double>::quiet_NaN();
  }

  // What makes the current parameters doubtful, if anything: of a regression,
  // that a constant explains the data as well.
  virtual std::string Doubt() const { return ""; }

  // The evaluation callback of the problem that was made last; null: none.
  virtual ceres::EvaluationCallback* evaluation_callback() { return nullptr; }
  // How often all residuals were evaluated since then, with or without
  // Jacobian; -1 if this is not counted.
  virtual long num_evaluations() const { return -1; }

  // The name of a parameter block in reports.
  virtual std::string BlockName(const double* values) const = 0;

  // The parameters, with standard deviations if there are any, on one line, if
  // a user named them.
  virtual std::string EstimateText(const Covariance* /*covariance*/) const {
    return "";
  }

  // The blocks whose standard deviations a report lists.
  virtual std::vector<Covariance::Pair> CovariancePairs(
      const ceres::Problem& problem) const {
    return MarginalPairs(problem);
  }

  // For each parameter, the digits that agree with its certified standard
  // deviation, if the file has them.
  virtual std::optional<Eigen::VectorXd> DeviationDigits(
      const Covariance& /*covariance*/) const {
    return {};
  }

  // Writes the current parameters, in the input's format.
  virtual bool Write(const std::string& path, std::string* error) const = 0;

  // Adds the current parameters to a picture, initially without panels: as
  // curves in a common panel, or as a new panel.
  virtual void Draw(const std::string& label,
                    std::vector<Plot>* panels) const = 0;

  // Adds a panel of the current parameters with two standard deviations, as a
  // band or as ellipses; none if that is not drawn.
  virtual void DrawCovariance(const std::string& /*label*/,
                              const Covariance& /*covariance*/,
                              std::vector<Plot>* /*panels*/) const {}

 private:
  const EstimationTraits traits_;
};

// The names of the kinds.
std::vector<std::string> EstimationKinds();

// The kind of files with this extension; empty: none.
std::string EstimationKindOf(const std::string& path);

// Whether a file of this kind (empty: by the extension) begins as its reader
// expects; it may be damaged farther on. True if it cannot be read, which its
// reader reports.
bool IsEstimationFile(const std::string& path, const std::string& kind);

// A user's own regression, for tables and NIST's files; empty: none.
struct RegressionOptions {
  // "y = b1*exp(-b2*x)": the response, of the columns, and the model, of columns
  // and of parameters, which are all other names. "y =" may be left out.
  std::string model;
  std::string start_values;  // "b1=1,b2=0.5"
  std::string bounds;        // "b1=0..10,b2=0.."
  std::string weights;       // of squared residuals: a formula of columns
  std::string deviations;    // of responses, instead: a formula of columns
};

struct ReadEstimationOptions {
  std::string kind;                        // empty: by the extension
  EdgeError edge_error = EdgeError::kG2o;  // of g2o
  RegressionOptions regression;            // of nist and csv
};

// Returns null, with *error set, if the file cannot be read.
using EstimationReader =
    std::unique_ptr<Estimation>(const std::string& path,
                                const ReadEstimationOptions& options,
                                std::string* error);
EstimationReader ReadEstimation;
// Of one kind.
EstimationReader ReadNistEstimation;
EstimationReader ReadFormulaEstimation;
EstimationReader ReadBalEstimation;
EstimationReader ReadPoseGraphEstimation;

}  // namespace invgrad

#endif  // PROBLEMS_ESTIMATION_ESTIMATION_H_
