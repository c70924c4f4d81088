#include "problems/problems.h"

#include "fmt/core.h"
#include "problems/exponential.h"
#include "problems/heat.h"
#include "problems/linear_scale.h"
#include "problems/multimodal.h"
#include "problems/oscillator_chain.h"
#include "problems/oscillator_correction.h"
#include "problems/oscillator_tracking.h"
#include "problems/poisson.h"
#include "problems/poisson_pinn.h"
#include "problems/quantum_dipole.h"
#include "problems/random_polynomial.h"
#include "problems/regression_1d.h"
#include "problems/sine.h"
#include "problems/squared_component.h"
#include "problems/toy_network.h"

namespace invgrad {

namespace {

template <typename Definition>
std::vector<OptionSet::Row> OptionsOf() {
  typename Definition::Options options;
  OptionSet set;
  options.Describe(&set);
  return set.rows();
}

// The fields, if the settings are allowed.
template <typename Definition>
std::optional<typename Definition::Options> ReadOptions(
    const Settings& settings, std::string* error) {
  typename Definition::Options options;
  OptionSet set;
  options.Describe(&set);
  if (!set.SetAll(settings, error)) return std::nullopt;
  return options;
}

template <typename Definition>
ProblemRow Point(const char* name, const char* equation, const char* source) {
  const auto create = [name](const Settings& settings,
                             const Eigen::MatrixXd* data,
                             PhysicsProblem* problem,
                             std::string* error) {
    if (data != nullptr) {
      *error = fmt::format("{} has no data to replace", name);
      return false;
    }
    const auto options = ReadOptions<Definition>(settings, error);
    return options.has_value() &&
           Definition::Create(*options, &problem->point.emplace(), error);
  };
  return {name, equation, source, OptionsOf<Definition>, create};
}

template <typename Definition>
ProblemRow Learning(const char* name,
                    const char* equation,
                    const char* source) {
  const auto create = [](const Settings& settings,
                         const Eigen::MatrixXd* data,
                         PhysicsProblem* problem,
                         std::string* error) {
    const auto options = ReadOptions<Definition>(settings, error);
    return options.has_value() &&
           Definition::Create(
               *options, data, &problem->learning.emplace(), error);
  };
  return {name, equation, source, OptionsOf<Definition>, create};
}

}  // namespace

const std::vector<ProblemRow>& Problems() {
  static const auto& table = *new std::vector<ProblemRow>{
      Point<SquaredComponent>("squared_component",
                              "y = (x_0, x_1^2), L = |y|^2",
                              "PBDL physgrad-comparison"),
      Point<LinearScale>("linear_scale",
                         "y = (u_0 x_0, u_1 x_1), L = c (y_0 + y_1)",
                         "PBDL physgrad, units and sensitivity"),
      Point<SinePoint>("sine_point",
                       "y = (sin h_0, h_1), h = diag(10 / xi, 10 xi) R(phi) x, "
                       "L = 1/2 |y - y*|^2",
                       "SIP, sin_characterization; PBDL physgrad-nn"),
      Learning<ToyNetwork>(
          "toy_network",
          "y = (f_0, lambda f_1), y* = (sin 6a, cos 9a), L = 1/2 |y - y*|^2",
          "PBDL physgrad-hig"),
      Learning<OscillatorChain>(
          "oscillator_chain",
          "q'' = -q + coupling + u(t) on the last mass, L = |y(T) - y(0)|^2",
          "PBDL physgrad-hig-code (linear), HIG release (cubic)"),
      Learning<OscillatorTracking>(
          "oscillator_tracking",
          "u_t = f(s_t), L = dt sum_t |q_last - p|^2 + control_weight u_t^2",
          "closed-loop control of oscillator_chain"),
      Learning<OscillatorCorrection>(
          "oscillator_correction",
          "s_{t+1} = coarse(s_t) + dt f(s_t), L = 1/T sum_t |s_t - s*_t|^2",
          "the setting of Um et al., NeurIPS 2020, for oscillator_chain"),
      Learning<QuantumDipole>(
          "quantum_dipole",
          "i psi' = (-d_xx + u(t) x) psi, L = 1 - |<y*|psi(T)>|^2",
          "HIG release, Quantum_dipole"),
      Learning<Poisson>("poisson",
                        "y = laplace(x), x = 0 outside, L = 1/2 |y - y*|^2",
                        "HIG release, Poisson_problem"),
      Learning<PoissonPinn>(
          "poisson_pinn",
          "-Lap u = f, u = 0 at the boundary, u a network of the point, L = "
          "1/2 mean |r|^2",
          "KFAC for PINNs, NeurIPS 2024; ENGD, ICML 2023"),
      Learning<Heat1d>("heat_1d",
                       "y = exp(nu t laplace) x, periodic, L = 1/2 |y - y*|^2",
                       "SIP release, heat, in one dimension"),
      Learning<Heat>("heat",
                     "y = exp(nu t laplace) x, periodic, L = 1/2 |y - y*|^2",
                     "SIP release, heat; PBDL physgrad-code"),
      Point<HeatState>("heat_state",
                       "y = exp(nu t laplace) x, periodic, L = 1/2 |y - y*|^2",
                       "SIP release, heat, plot_heat_optim"),
      Learning<Sine>("sine",
                     "y = (sin h_0, h_1), h = diag(10 / xi, 10 xi) R(phi) x, "
                     "L = 1/2 |y - y*|^2",
                     "SIP, sin_characterization"),
      Learning<Exponential>("exponential",
                            "y = exp(x), L = 1/2 (y - y*)^2, y* in (e^-12, 1]",
                            "SIP, exp"),
      Learning<Multimodal>("multimodal",
                           "y = x^2, L = 1/2 (y - y*)^2, two pre-images",
                           "PBDL intro-teaser and physgrad-nn"),
      Learning<Regression1d>(
          "regression_1d",
          "y = f(a), y* = exp(-10 a^2) sin(2 a), standardized, L = |y - y*|^2",
          "Sven benchmark, sambt/sven-experiments; arXiv 2604.01279"),
      Learning<RandomPolynomial>(
          "random_polynomial",
          "y = f(a), y* a polynomial of degree 4 in a_0 .. a_5, standardized, "
          "L = |y - y*|^2",
          "Sven benchmark, sambt/sven-experiments; arXiv 2604.01279"),
  };
  return table;
}

const ProblemRow* FindProblem(const std::string& name) {
  for (const ProblemRow& row : Problems()) {
    if (row.name == name) return &row;
  }
  return nullptr;
}

bool CreateProblem(const std::string& specification,
                   const Eigen::MatrixXd* data,
                   PhysicsProblem* problem,
                   std::string* error) {
  std::vector<Specification> parsed;
  if (!ParseSpecifications(specification, &parsed, error)) return false;
  if (parsed.size() != 1) {
    *error = fmt::format(
        "one problem is wanted, not {}: '{}'", parsed.size(), specification);
    return false;
  }
  const ProblemRow* row = FindProblem(parsed[0].name);
  if (row == nullptr) {
    std::vector<std::string> names;
    for (const ProblemRow& known : Problems()) names.push_back(known.name);
    *error = UnknownNameMessage("problem", parsed[0].name, names);
    return false;
  }
  std::string why;
  if (!row->create(parsed[0].settings, data, problem, &why)) {
    *error = fmt::format("problem {}: {}", row->name, why);
    return false;
  }
  return true;
}

}  // namespace invgrad
