#include "problems/problems.h"

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "invgrad/compare/compare.h"
#include "problems/burgers_control.h"
#include "problems/burgers_initial.h"
#include "problems/equations/allen_cahn.h"
#include "problems/equations/burgers.h"
#include "problems/equations/convection.h"
#include "problems/equations/heat.h"
#include "problems/equations/heat_4d.h"
#include "problems/equations/helmholtz.h"
#include "problems/equations/korteweg_de_vries.h"
#include "problems/equations/poisson_box.h"
#include "problems/equations/reaction.h"
#include "problems/equations/two_solitons.h"
#include "problems/equations/wave.h"
#include "problems/exponential.h"
#include "problems/heat.h"
#include "problems/linear_scale.h"
#include "problems/more_garbow_hillstrom_problem.h"
#include "problems/multimodal.h"
#include "problems/navier_stokes/navier_stokes_network.h"
#include "problems/oscillator_chain.h"
#include "problems/oscillator_correction.h"
#include "problems/oscillator_tracking.h"
#include "problems/plume_initial.h"
#include "problems/poisson.h"
#include "problems/poisson_inverse.h"
#include "problems/poisson_pinn.h"
#include "problems/quantum_dipole.h"
#include "problems/regression.h"
#include "problems/sine.h"
#include "problems/squared_component.h"
#include "problems/torch/torch_networks.h"
#include "problems/toy_network.h"

namespace invgrad {
namespace {

// The first one is the default of --problem.
void RegisterSystems() {
  RegisterProblem<OscillatorChain>(
      "oscillator_chain",
      "q'' = -q + coupling + u(t) on the last mass, L = |y(T) - y(0)|^2",
      "PBDL physgrad-hig-code (linear), HIG release (cubic)");
  RegisterProblem<SquaredComponent>("squared_component",
                                    "y = (x_0, x_1^2), L = |y|^2",
                                    "PBDL physgrad-comparison");
  RegisterProblem<LinearScale>("linear_scale",
                               "y = (u_0 x_0, u_1 x_1), L = c (y_0 + y_1)",
                               "PBDL physgrad, units and sensitivity");
  RegisterProblem<SinePoint>(
      "sine_point",
      "y = (sin h_0, h_1), h = diag(10 / xi, 10 xi) R(phi) x, "
      "L = 1/2 |y - y*|^2",
      "SIP, sin_characterization; PBDL physgrad-nn");
  RegisterProblem<ToyNetwork>(
      "toy_network",
      "y = (f_0, lambda f_1), y* = (sin 6a, cos 9a), L = 1/2 |y - y*|^2",
      "PBDL physgrad-hig");
  RegisterProblem<OscillatorTracking>(
      "oscillator_tracking",
      "u_t = f(s_t), L = dt sum_t |q_last - p|^2 + control_weight u_t^2",
      "closed-loop control of oscillator_chain");
  RegisterProblem<OscillatorCorrection>(
      "oscillator_correction",
      "s_{t+1} = coarse(s_t) + dt f(s_t), L = 1/T sum_t |s_t - s*_t|^2",
      "the setting of Um et al., NeurIPS 2020, for oscillator_chain");
  RegisterProblem<BurgersControl>(
      "burgers_control",
      "u_t + u u_x = nu u_xx + f(u_t, t, u*), L = 1/n |u_T - u*|^2 + "
      "control_weight dt / n sum_t |f_t|^2",
      "PBDL diffphys-control, reinflearn-code; ICLR 2020");
  RegisterProblem<QuantumDipole>(
      "quantum_dipole",
      "i psi' = (-d_xx + u(t) x) psi, L = 1 - |<y*|psi(T)>|^2",
      "HIG release, Quantum_dipole");
  RegisterProblem<Poisson>("poisson",
                           "y = laplace(x), x = 0 outside, L = 1/2 |y - y*|^2",
                           "HIG release, Poisson_problem");
  RegisterProblem<PoissonInverse>(
      "poisson_inverse",
      "laplace(y) = x, y = 0 outside, L = 1/2 |y - y*|^2",
      "SIP release, poisson");
}

void RegisterEquations() {
  RegisterProblem<BurgersPinn>(
      "burgers_pinn",
      "u_t + u u_x = nu u_xx, u = g + d N, L = 1/2 mean R^2",
      "Raissi et al., J. Comput. Phys. 378 (2019)");
  RegisterProblem<KortewegDeVriesPinn>(
      "kdv_pinn",
      "u_t + u u_x + mu^2 u_xxx = 0, u = g + d N, L = 1/2 mean R^2",
      "Zabusky, Kruskal, Phys. Rev. Lett. 15 (1965)");
  RegisterProblem<TwoSolitonsPinn>(
      "two_solitons_pinn",
      "u_t + u u_x + u_xxx = 0, u = g + d N, L = 1/2 mean R^2 + "
      "w/2 mean (u_x - u*_x)^2 at x = 20",
      "Urban et al., J. Comput. Phys. 523 (2025)");
  RegisterProblem<AllenCahnPinn>(
      "allen_cahn_pinn",
      "u_t = D u_xx + 5 (u - u^3), u = g + d N, L = 1/2 mean R^2",
      "Raissi et al., J. Comput. Phys. 378 (2019)");
  RegisterProblem<ConvectionPinn>(
      "convection_pinn",
      "u_t + beta u_x = 0, u = g + t N, L = 1/2 mean R^2",
      "Rathore et al., ICML 2024");
  RegisterProblem<ReactionPinn>(
      "reaction_pinn",
      "u_t = rho u (1 - u), u = g + t N, L = 1/2 mean R^2",
      "Rathore et al., ICML 2024");
  RegisterProblem<WavePinn>("wave_pinn",
                            "u_tt = c^2 u_xx, u = g + d N, L = 1/2 mean R^2",
                            "Rathore et al., ICML 2024");
  RegisterProblem<HeatPinn>("heat_pinn",
                            "u_t = u_xx / 4, u = g + d N, L = 1/2 mean R^2",
                            "KFAC for PINNs, NeurIPS 2024");
  RegisterProblem<Heat4dPinn>(
      "heat_4d_pinn",
      "u_t = laplace(u) / 4, u = g + t N, L = 1/2 mean R^2 + "
      "w/2 mean (u - u*)^2 at the faces",
      "KFAC for PINNs, NeurIPS 2024");
  RegisterProblem<PoissonBoxPinn<5>>(
      "poisson_5d_pinn",
      "-laplace(u) = f, L = 1/2 mean R^2 + w/2 mean (u - "
      "u*)^2 at the faces",
      "KFAC for PINNs, NeurIPS 2024");
  RegisterProblem<PoissonBoxPinn<10>>(
      "poisson_10d_pinn",
      "laplace(u) = 0, L = 1/2 mean R^2 + w/2 mean (u - u*)^2 at the faces",
      "KFAC for PINNs, NeurIPS 2024");
  RegisterProblem<HelmholtzPinn>(
      "helmholtz_pinn",
      "laplace(u) + k^2 u = q, u = d N, L = 1/2 mean R^2",
      "Wang et al., SIAM J. Sci. Comput. 43 (2021)");
  RegisterProblem<PoissonPinn>(
      "poisson_pinn",
      "-Lap u = f, u = 0 at the boundary, u a network of the point, L = "
      "1/2 mean |r|^2",
      "KFAC for PINNs, NeurIPS 2024; ENGD, ICML 2023");
}

void RegisterFieldsAndFunctions() {
  RegisterProblem<HeatNetwork<1>>(
      "heat_1d",
      "y = exp(nu t laplace) x, periodic, L = 1/2 |y - y*|^2",
      "SIP release, heat, in one dimension");
  RegisterProblem<HeatNetwork<2>>(
      "heat",
      "y = exp(nu t laplace) x, periodic, L = 1/2 |y - y*|^2",
      "SIP release, heat; PBDL physgrad-code");
  RegisterProblem<HeatState>(
      "heat_state",
      "y = exp(nu t laplace) x, periodic, L = 1/2 |y - y*|^2",
      "SIP release, heat, plot_heat_optim");
  RegisterProblem<NavierStokesNetwork>(
      "navier_stokes",
      "du/dt + u grad u = -grad p, u(0) = x, dm/dt + "
      "u grad m = 0, y = m(2)",
      "SIP release, fluid");
  RegisterProblem<BurgersInitial>(
      "burgers_initial",
      "y = u(1/2) of Burgers' equation from u(0) = x, L = 1/n |y - y*|^2",
      "PBDL diffphys-code-burgers");
  RegisterProblem<PlumeInitial>(
      "plume_initial",
      "y = s(20) of a buoyant plume from u(0) = x, L = 1/2 |y - y*|^2",
      "PBDL diffphys-code-ns");
  RegisterProblem<Sine>(
      "sine",
      "y = (sin h_0, h_1), h = diag(10 / xi, 10 xi) R(phi) x, "
      "L = 1/2 |y - y*|^2",
      "SIP, sin_characterization");
  RegisterProblem<Exponential>(
      "exponential",
      "y = exp(x), L = 1/2 (y - y*)^2, y* in (e^-12, 1]",
      "SIP, exp");
  RegisterProblem<Multimodal>("multimodal",
                              "y = x^2, L = 1/2 (y - y*)^2, two pre-images",
                              "PBDL intro-teaser and physgrad-nn");
  RegisterProblem<Regression1d>(
      "regression_1d",
      "y = f(a), y* = exp(-10 a^2) sin(2 a), standardized, L = |y - y*|^2",
      "Sven benchmark, sambt/sven-experiments; arXiv 2604.01279");
  RegisterProblem<RandomPolynomial>(
      "random_polynomial",
      "y = f(a), y* a polynomial of degree 4 in a_0 .. a_5, standardized, "
      "L = |y - y*|^2",
      "Sven benchmark, sambt/sven-experiments; arXiv 2604.01279");
}

}  // namespace

void RegisterProblems() {
  RegisterSystems();
  RegisterEquations();
  RegisterFieldsAndFunctions();
  RegisterProblem<MoreGarbowHillstromProblem>(
      "more_garbow_hillstrom",
      "L = 1/2 sum_i r_i(x)^2, nineteen functions with known minima",
      "More, Garbow, Hillstrom, ACM TOMS 7 (1981)");
  SetTorchScriptLoader([](const std::string& path,
                          const std::vector<std::int64_t>& input_shape,
                          bool double_precision,
                          std::string* error) {
    const TorchNetworks* const networks = LoadTorchNetworks(error);
    return networks == nullptr
               ? nullptr
               : networks->load_torch_script(
                     path, input_shape, double_precision, error);
  });
}

}  // namespace invgrad
