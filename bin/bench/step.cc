// step/CASE/METHOD: the linear algebra of a half-inverse step for the four
// published sizes, a million weights, and two physics-informed networks with
// more points than weights (docs/results/speed.md). It goes from the Jacobian's
// factors (or, for a full SVD, from the dense J) to d, warm: the workspace is
// kept between steps.
//
//   gram, svd        the routes of spectral.h, with a rule's tolerances
//   step             linearization (network, physics, factors) and gram
//   parameter_gram   J^T J alone, from the factors
//   golub_kahan      golub_kahan.h
//   dgesdd, sgesdd   LAPACK's SVD of J in double and single precision
//
// step/dgemm is the speed of the arithmetic: GF/s of it and of gram, whose
// operations are m^2 sum(widths) + 4/3 m^3, or m n^2 + 4/3 n^3 if m > n.

#include <algorithm>
#include <functional>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "benchmark/benchmark.h"
#include "bin/bench/bench.h"
#include "bin/bench/lapack_svd.h"
#include "bin/support/learning_run.h"
#include "fmt/core.h"
#include "glog/logging.h"
#include "invgrad/internal/blas.h"
#include "invgrad/spectral.h"
#include "invgrad/spectral/golub_kahan.h"

namespace invgrad {
namespace {

struct CaseRow {
  std::string name;
  std::string problem;
  double truncation;  // the published one
  std::vector<std::string> methods;
  // Of a network in place of the problem's.
  std::vector<int> widths = {};
};

const std::vector<CaseRow>& CaseRows() {
  const std::vector<std::string> all = {
      "gram", "step", "svd", "dgesdd", "sgesdd"};
  const std::vector<std::string> parameter = {"gram", "parameter_gram"};
  static const auto& rows = *new std::vector<CaseRow>{
      {"linear_chain", "oscillator_chain", 1e-10, all},
      {"cubic_chain", "oscillator_chain:coupling=cubic", 1e-6, all},
      {"quantum_dipole", "quantum_dipole", 1e-5, all},
      {"poisson", "poisson", 1e-5, {"gram", "step", "dgesdd"}},
      {"poisson_few_kept", "poisson", 0.2, {"gram", "golub_kahan"}},
      {"million", "poisson", 1e-5, {"gram", "step"}, {64, 512, 1024, 416, 64}},
      {"equation_1341",
       "burgers_pinn:num_x=128",
       1e-6,
       parameter,
       {2, 20, 20, 20, 20, 1}},
      {"equation_3021",
       "burgers_pinn:num_x=128",
       1e-6,
       parameter,
       {2, 20, 20, 20, 20, 20, 20, 20, 20, 1}},
  };
  return rows;
}

// A batch of a problem, linearized at its initial weights.
struct Case {
  const CaseRow& row;
  SpectralFilter filter;
  std::shared_ptr<const Model> model;
  DataSet batch;
  Eigen::VectorXd weights;
  Linearization at_weights;

  explicit Case(const CaseRow& case_row)
      : row(case_row), filter(SpectralFilter::HalfInverse(row.truncation)) {
    LearningProblem problem;
    std::string error;
    CHECK(CreateLearningProblem(row.problem, &problem, &error)) << error;
    if (!row.widths.empty()) {
      problem.model = std::make_shared<Model>(problem.model->WithNetwork(
          DenseNetwork(row.widths,
                       problem.model->dense_network()->hidden_activation())));
    }
    model = problem.model;
    batch = problem.train.Range(0, BatchSize(problem, -1));
    weights = InitialWeights(problem, 1);
    Linearize(&at_weights);
  }

  void Linearize(Linearization* at) const {
    std::string error;
    CHECK(model->Linearize(
        weights, batch, LinearizationParts::Jacobian(), at, &error))
        << error;
  }
  const JacobianOperator& J() const { return *at_weights.jacobian; }
  const Eigen::VectorXd& g() const { return at_weights.loss_gradient; }

  // The operations of the Gram matrix.
  double GramFlops() const {
    const double m = J().rows();
    const double n = J().cols();
    if (m > n) return m * n * n;
    const std::vector<int>& widths = model->dense_network()->widths();
    return m * m * std::accumulate(widths.begin() + 1, widths.end(), 0.0);
  }
  // With its reduction.
  double StepFlops() const {
    const double size = std::min(J().rows(), J().cols());
    return GramFlops() + 4.0 / 3.0 * size * size * size;
  }
};

// The case of the row; the last one is kept.
const Case& CaseOf(const CaseRow& row) {
  static std::unique_ptr<const Case> last;
  if (last == nullptr || &last->row != &row) {
    last.reset();
    last = std::make_unique<const Case>(row);
  }
  return *last;
}

// Returns the label of the line.
using Step = std::function<std::string(const Case&)>;

std::string Label(int rank, double estimated_error) {
  return fmt::format("rank {}, error < {:.1e}", rank, estimated_error);
}

// A step by `route`; with its linearization if `is_whole`.
Step RouteStep(SpectralRoute route, bool is_whole = false) {
  auto workspace = std::make_shared<SpectralWorkspace>();
  return [route, is_whole, workspace](const Case& at) {
    Linearization linearization;
    if (is_whole) at.Linearize(&linearization);
    const Linearization& here = is_whole ? linearization : at.at_weights;
    SpectralStepOptions options = SpectralStepOptions::ForTraining();
    options.route = route;
    Eigen::VectorXd d;
    SpectralStepSummary summary;
    return SpectralStep(*here.jacobian,
                        here.loss_gradient,
                        at.filter,
                        options,
                        workspace.get(),
                        &d,
                        &summary)
               ? Label(summary.rank, summary.estimated_error)
               : summary.message;
  };
}

Step ParameterGramStep() {
  auto gram = std::make_shared<Eigen::MatrixXd>();
  return [gram](const Case& at) {
    at.J().ParameterGram(gram.get());
    return std::string();
  };
}

Step KrylovStep() {
  auto basis = std::make_shared<Eigen::MatrixXd>();
  return [basis](const Case& at) {
    GolubKahanOptions options;
    options.tolerance = 1e-6;
    options.max_iterations = std::min(at.J().rows(), at.J().cols());
    Eigen::VectorXd d;
    GolubKahanSummary summary;
    GolubKahanStep(
        at.J(), at.g(), at.filter, options, basis.get(), &d, &summary);
    return summary.converged ? Label(summary.rank, summary.estimated_error)
                             : summary.message;
  };
}

// A full SVD of the dense J; steps reuse its arrays.
template <typename Svd>
Step SvdStep() {
  return [J = typename Svd::Matrix(),
          svd = Svd()](const Case& at) mutable -> std::string {
    if (J.size() == 0) {
      Eigen::MatrixXd dense;
      at.J().ToDense(&dense);
      J = dense.cast<typename Svd::Matrix::Scalar>();
    }
    CHECK(svd.Compute(J));
    const Eigen::VectorXd d = FilteredStep(svd, at.filter, at.g());
    benchmark::DoNotOptimize(d.data());
    return "";
  };
}

Step MakeStep(const std::string& method) {
  if (method == "gram") return RouteStep(SpectralRoute::kGram);
  if (method == "step") return RouteStep(SpectralRoute::kGram, true);
  if (method == "svd") return RouteStep(SpectralRoute::kSvd);
  if (method == "parameter_gram") return ParameterGramStep();
  if (method == "golub_kahan") return KrylovStep();
  if (method == "dgesdd") return SvdStep<LapackSvd<double>>();
  CHECK_EQ(method, "sgesdd");
  return SvdStep<LapackSvd<float>>();
}

// A rate, in the columns of Google Benchmark.
benchmark::Counter Rate(const benchmark::State& state, double flops) {
  return {1e-9 * flops * static_cast<double>(state.iterations()),
          benchmark::Counter::kIsRate};
}

// The factors and the first use of the workspace are not measured; they are
// negligible for a step of minutes, which is measured cold.
void MeasureStep(const CaseRow& row,
                 const std::string& method,
                 bool is_slow,
                 benchmark::State* state) {
  const Case& at = CaseOf(row);
  const Step step = MakeStep(method);
  std::string label;
  if (!is_slow) label = step(at);
  for (auto _ : *state) label = step(at);
  state->SetLabel(label);
  if (method == "gram") {
    state->counters["GF/s"] = Rate(*state, at.StepFlops());
  } else if (method == "parameter_gram") {
    state->counters["GF/s"] = Rate(*state, at.GramFlops());
  }
}

void MeasureGemm(benchmark::State& state) {
  constexpr int kSize = 1024;
  const Eigen::MatrixXd A = Eigen::MatrixXd::Random(kSize, kSize);
  Eigen::MatrixXd C(kSize, kSize);
  for (auto _ : state) Gemm(Op::kNone, Op::kTranspose, 1.0, A, A, 0.0, C);
  state.counters["GF/s"] = Rate(state, 2.0 * kSize * kSize * kSize);
}

}  // namespace

bool AddStepBenchmarks(std::string* /*error*/) {
  AddBenchmark("step/dgemm", "", MeasureGemm);
  for (const CaseRow& row : CaseRows()) {
    const std::string prefix = "step/" + row.name + "/";
    for (const std::string& method : row.methods) {
      const bool is_slow = row.name == "poisson" && method == "dgesdd";
      auto* added = AddBenchmark(prefix + method,
                                 method == "gram" ? "" : prefix + "gram",
                                 [=, &row](auto& state) {
                                   MeasureStep(row, method, is_slow, &state);
                                 });
      if (is_slow) added->Iterations(1);
    }
  }
  return true;
}

}  // namespace invgrad
