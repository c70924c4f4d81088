#include "problems/burgers_initial.h"

#include <cmath>
#include <utility>
#include <vector>

#include "glog/logging.h"
#include "invgrad/loss.h"
#include "problems/fields/advection.h"
#include "problems/fields/diffusion.h"

namespace invgrad {

using Eigen::VectorXd;

namespace {

constexpr int kNumCells = 128;
constexpr int kNumSteps = 16;

// The published target on [-1, 0]; on [0, 1] it is minus its mirror image.
constexpr double kPublishedTarget[kNumCells / 2] = {
    0.00861217, 0.0258467, 0.0431364, 0.0604911, 0.0779393, 0.0954779, 0.113119,
    0.13085,    0.14867,   0.166563,  0.184523,  0.202531,  0.220578,  0.238651,
    0.256739,   0.274832,  0.292918,  0.310994,  0.329048,  0.347079,  0.365073,
    0.383036,   0.40095,   0.418824,  0.436636,  0.454399,  0.472085,  0.489708,
    0.507239,   0.524701,  0.542067,  0.559358,  0.576547,  0.593651,  0.610645,
    0.627544,   0.644322,  0.66099,   0.677526,  0.693933,  0.710194,  0.726305,
    0.742251,   0.758021,  0.773603,  0.788978,  0.804137,  0.819047,  0.833706,
    0.848062,   0.862123,  0.875806,  0.889134,  0.901981,  0.914388,  0.92616,
    0.937365,   0.947687,  0.957227,  0.965437,  0.97241,   0.976738,  0.966948,
    0.659083,
};

// The displacements of the points of a line.
VectorXd AlongLine(const VectorXd& d) {
  VectorXd both = VectorXd::Zero(2 * d.size());
  both.head(d.size()) = d;
  return both;
}

}  // namespace

BurgersSimulator::BurgersSimulator(int num_cells,
                                   int num_steps,
                                   double diffusion,
                                   double courant)
    : num_cells_(num_cells),
      num_steps_(num_steps),
      diffusion_(diffusion),
      courant_(courant) {
  CHECK_GT(num_cells, 0);
  CHECK_GT(num_steps, 0);
}

bool BurgersSimulator::Value(const double* x,
                             const double* /*context*/,
                             double* y) const {
  const Lattice line = {1, num_cells_, Lattice::Outside::kPeriodic};
  VectorXd u = Eigen::Map<const VectorXd>(x, num_cells_);
  for (int t = 0; t < num_steps_; ++t) {
    const VectorXd v = DiffuseExplicitly(u, diffusion_);
    u = AdvectedField(line,
                      AdvectedField::Scheme::kSemiLagrangian,
                      v,
                      AlongLine(courant_ * v))
            .value();
  }
  Eigen::Map<VectorXd>(y, num_cells_) = u;
  return u.allFinite();
}

std::unique_ptr<const JacobianOperator> BurgersSimulator::Linearize(
    const double* x, const double* /*context*/, double* y) const {
  const Lattice line = {1, num_cells_, Lattice::Outside::kPeriodic};
  auto steps = std::make_shared<std::vector<AdvectedField>>();
  VectorXd u = Eigen::Map<const VectorXd>(x, num_cells_);
  for (int t = 0; t < num_steps_; ++t) {
    const VectorXd v = DiffuseExplicitly(u, diffusion_);
    steps->emplace_back(line,
                        AdvectedField::Scheme::kSemiLagrangian,
                        v,
                        AlongLine(courant_ * v));
    u = steps->back().value();
  }
  Eigen::Map<VectorXd>(y, num_cells_) = u;
  if (!u.allFinite()) return nullptr;
  const auto times = [steps, diffusion = diffusion_, courant = courant_](
                         const VectorXd& v, VectorXd* Jv) {
    *Jv = v;
    for (const AdvectedField& step : *steps) {
      *Jv = DiffuseExplicitly(*Jv, diffusion);
      *Jv = step.Tangent(*Jv, AlongLine(courant * *Jv));
    }
  };
  const auto transpose_times =
      [steps, diffusion = diffusion_, courant = courant_](const VectorXd& w,
                                                          VectorXd* Jtw) {
        const Eigen::Index n = w.size();
        *Jtw = w;
        for (auto step = steps->rbegin(); step != steps->rend(); ++step) {
          VectorXd v_bar = VectorXd::Zero(n);
          VectorXd d_bar = VectorXd::Zero(2 * n);
          step->Adjoint(*Jtw, &v_bar, &d_bar);
          *Jtw = DiffuseExplicitly(v_bar + courant * d_bar.head(n), diffusion);
        }
      };
  return std::make_unique<FunctionJacobian>(
      num_cells_, num_cells_, times, transpose_times);
}

void BurgersInitial::Describe(OptionSet* set) {
  set->Add("target",
           &target,
           {"published", "simulated"},
           "the state at t = 1/2: as listed in the source, or simulated from "
           "-sin(pi x)");
}

bool BurgersInitial::Create(PointProblem* problem,
                            std::string* /*error*/) const {
  constexpr double kDx = 2.0 / kNumCells;
  constexpr double kDt = 1.0 / 32.0;
  constexpr double kNu = 0.01 / (kNumCells * M_PI);
  problem->simulator = std::make_shared<BurgersSimulator>(
      kNumCells, kNumSteps, kNu * kDt / (kDx * kDx), kDt / kDx);
  problem->loss = std::make_shared<SquaredNormLoss>(kNumCells, 1.0 / kNumCells);
  problem->start = VectorXd::Zero(kNumCells);
  problem->target.resize(kNumCells);
  if (target == "published") {
    for (int i = 0; i < kNumCells / 2; ++i) {
      problem->target[i] = kPublishedTarget[i];
      problem->target[kNumCells - 1 - i] = -kPublishedTarget[i];
    }
    return true;
  }
  const VectorXd initial = VectorXd::NullaryExpr(kNumCells, [](Eigen::Index i) {
    return -std::sin(M_PI * ((i + 0.5) * kDx - 1.0));
  });
  CHECK(problem->simulator->Evaluate(
      initial.data(), nullptr, problem->target.data(), nullptr));
  problem->minimizer = initial;
  problem->minimum = 0.0;
  return true;
}

}  // namespace invgrad
