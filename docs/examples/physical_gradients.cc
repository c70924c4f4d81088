// What the book says about gradients, Newton's method, inverse gradients and
// physical gradients, on problems with known answers: the tables of sections 7
// to 16 of docs/results/physical_gradients.md.
//
// Problems:   scalar functions, a pendulum, two oscillators, Lorenz' equations
//             and small networks, in physical_gradients.h and
//             physical_gradients_in_time.h.
// Expect:     one table for each section, in about five seconds.
//
// Exits with 0 if the physical gradient is exact where the book says so: the
// change of y in section 8 and the convergence in section 12.

#include "physical_gradients.h"

#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "Eigen/Core"
#include "glog/logging.h"
#include "invgrad/blas_threads.h"
#include "physical_gradients_in_time.h"

namespace {

using namespace physical_gradients;  // NOLINT: the program prints it

void PrintRow(const char* name, const std::vector<double>& values) {
  std::printf("%-45s", name);
  for (const double value : values) std::printf(" %10.4g", value);
  std::printf("\n");
}

void PrintFallOfLoss() {
  std::printf("7. Fall of the loss over eta, y = c x\n");
  for (const bool is_linear : {true, false}) {
    std::printf("%-45s c =  0.1, 1, 10, and the power of c\n",
                is_linear ? "L = y" : "L = (y - 1)^2 / 2");
    const auto print = [is_linear](const char* name, const std::string& text) {
      std::vector<double> falls;
      for (const double c : {0.1, 1.0, 10.0}) {
        falls.push_back(FallOfLoss(text, c, is_linear));
      }
      falls.push_back(0.5 * std::log10(falls[2] / falls[0]));
      PrintRow(name, falls);
    };
    for (const NamedMethod& method : kMethods) {
      // Its Hessian is zero.
      if (is_linear && &method == &kMethods[kNewton]) continue;
      print(method.name, method.text);
    }
    print("Adam", "adam:step_size=");
  }
}

// Returns whether the physical gradient's does not depend on y(x).
bool PrintChangesOfY() {
  std::printf("8. Change of y, L = (sqrt y(x) - 3)^2 / 2, from y = 1\n");
  bool is_exact = true;
  for (const double eta : {1e-4, 1.0}) {
    std::printf("eta = %-39g y = x, 10 x, exp x, x^3\n", eta);
    for (int method = 0; method < kNumMethods; ++method) {
      std::vector<double> changes;
      changes.reserve(kNumInner);
      for (int function = 0; function < kNumInner; ++function) {
        changes.push_back(ChangeOfY(method, function, eta) / eta);
      }
      PrintRow(kMethods[method].name, changes);
      if (method == kPhysicalGradient) {
        for (const double change : changes) {
          is_exact = is_exact && std::abs(change / changes[0] - 1.0) < 1e-9;
        }
      }
    }
  }
  return is_exact;
}

void PrintNormalization() {
  std::printf(
      "9. Errors of a normalized pendulum after 2, 4, 8, 16 steps, after the "
      "best linear map\n");
  for (const bool is_linear : {false, true}) {
    for (const bool is_between : {false, true}) {
      std::vector<double> errors;
      for (const int num_steps : {2, 4, 8, 16}) {
        errors.push_back(
            ErrorsByNormalization(is_linear, is_between, num_steps).after_map);
      }
      const std::string name =
          std::string(is_linear ? "q'' = -q" : "q'' = -sin q") +
          (is_between ? ", between the steps" : ", after the last");
      PrintRow(name.c_str(), errors);
    }
  }
}

void PrintStepsByTime() {
  std::printf(
      "10. Largest over smallest step of the time steps: gradient "
      "descent, half-inverse, Gauss-Newton\n");
  const VectorXd state = Eigen::Vector4d(0.5, 0.7, 0.6, 0.5);
  const auto print =
      [&](const char* name, const Oscillators& oscillators, int num_steps) {
        const MatrixXd J = JacobianOf(oscillators, num_steps, state);
        PrintRow(name,
                 {Ratio(StepByTime(J, -1.0)),
                  Ratio(StepByTime(J, 0.5)),
                  Ratio(StepByTime(J, 1.0))});
      };
  print("linear, 24 steps", {}, 24);
  print("cubic, 96 steps", {0.125, 0.0, 1.0, 3.0}, 96);
  for (const double friction : {0.5, 1.0, 2.0}) {
    print(WithNumber("linear, friction ", friction).c_str(),
          {0.5, 0.2, 0.0, 1.0, friction},
          24);
  }
}

void PrintNoise() {
  std::printf("11. Error of a step, y = x + 0.01 sin kx: median, largest\n");
  for (const double k : {1.0, 10.0, 30.0, 100.0, 300.0, 1000.0}) {
    std::printf("k = %g\n", k);
    const auto print = [k](const char* name, const std::string& text) {
      const StepErrors errors = NoiseErrors(text, k);
      PrintRow(name, {errors.median, errors.largest});
    };
    for (int method = 0; method < kNumMethods; ++method) {
      print(kMethods[method].name, MethodText(method, 1.0));
    }
    print("the same, numerical inverse",
          "newton/numerical/gradient_descent:step_size=1");
  }
}

// Returns whether the physical gradient needs one step.
bool PrintConvergence() {
  constexpr int kNumSteps = 6;
  struct Run {
    const char* name;
    std::string text;
  };
  const std::vector<Run> runs = {
      {"gradient descent, eta 0.1", MethodText(kGradientDescent, 0.1)},
      {"half-inverse, eta 0.5", MethodText(kHalfInverse, 0.5)},
      {"Newton", MethodText(kNewton, 1.0)},
      {"inverse gradient", MethodText(kInverseGradient, 1.0)},
      {"physical gradient, eta 0.5", MethodText(kPhysicalGradient, 0.5)},
      {"physical gradient", MethodText(kPhysicalGradient, 1.0)}};
  bool is_exact = true;
  for (const bool is_square : {false, true}) {
    std::printf("12. |x_k - x*|, k = 0 .. 6, %s\n",
                is_square ? "y = x^2, y* = 0" : "y = exp x, y* = e");
    for (const Run& run : runs) {
      const std::vector<double> distances =
          is_square
              ? Distances(SquareSetting(), 1.0, 0.0, run.text, kNumSteps)
              : Distances(
                    ExpSetting(std::exp(1.0)), 0.8, 1.0, run.text, kNumSteps);
      PrintRow(run.name, distances);
      if (&run == &runs.back()) is_exact = is_exact && distances[1] < 1e-15;
    }
  }
  return is_exact;
}

void PrintLocalInverses() {
  std::printf(
      "13. Error of local inverses, change of y = 1, 1/2, .. 1/32, and its "
      "order\n");
  const auto print = [](const char* name,
                        const std::string& text,
                        int num_steps) {
    std::vector<double> errors;
    for (int i = 0; i <= 5; ++i) {
      errors.push_back(LocalInverseError(text, num_steps, std::pow(0.5, i)));
    }
    errors.push_back(std::log2(errors[4] / errors[5]));
    PrintRow(name, errors);
  };
  print("gradient descent, eta 0.1", MethodText(kGradientDescent, 0.1), 1);
  print("half-inverse, eta 0.5", MethodText(kHalfInverse, 0.5), 1);
  print("inverse gradient, 1 step", "gauss_newton", 1);
  print("2 steps", "gauss_newton", 2);
  print("3 steps", "gauss_newton", 3);
  print("Newton on L, 1 step", MethodText(kNewton, 1.0), 1);
  print("2 steps", MethodText(kNewton, 1.0), 2);
}

// The number of targets of which |P(x) - P(x*)| is below 0.01.
void PrintChaos() {
  constexpr int kNumTargets = 10;
  constexpr int kNumIterations = 100;
  constexpr double kReached = 0.01;
  const std::vector<Vector3d> solutions = LorenzStates(kNumTargets);
  const std::vector<double> times = {
      0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0};
  std::printf(
      "14. Targets of 10 that are reached after so many Lyapunov times\n");
  PrintRow("", times);
  const auto print = [&](const char* name, const auto& miss) {
    std::vector<double> counts;
    for (const double time : times) {
      double count = 0.0;
      for (const Vector3d& solution : solutions) {
        if (miss(solution, Lorenz::NumSteps(time)) < kReached) count += 1.0;
      }
      counts.push_back(count);
    }
    PrintRow(name, counts);
  };
  for (const char* method : {"ceres_steepest_descent",
                             "half_inverse:step_size=auto:rho=1",
                             "gauss_newton",

                             "ceres_lm",
                             "newton/numerical/gradient_descent:step_size=1"}) {
    print(method, [method](const Vector3d& solution, int num_steps) {
      return LorenzMiss(solution, num_steps, method, kNumIterations);
    });
  }
  print("equations backwards", [](const Vector3d& solution, int num_steps) {
    return LorenzMiss(solution, num_steps, /*is_exact=*/false);
  });
  print("steps inverted", [](const Vector3d& solution, int num_steps) {
    return LorenzMiss(solution, num_steps, /*is_exact=*/true);
  });
}

void PrintEqualSamples() {
  const char* const rules[] = {"gauss_newton:truncation=0",
                               "gauss_newton",
                               "gauss_newton:truncation=1e-3",
                               "half_inverse:truncation=0",
                               "half_inverse"};
  for (const double conflict : {0.0, 0.1}) {
    std::printf("16. Length of the step, loss after it; second target + %g\n",
                conflict);
    for (const double distance : {0.1, 1e-2, 1e-3, 1e-5, 1e-7, 1e-9, 0.0}) {
      std::printf("distance %g\n", distance);
      for (const char* rule : rules) {
        const TwoSampleStep step = StepOfTwoSamples(rule, distance, conflict);
        PrintRow(rule, {step.length, step.loss});
      }
    }
  }
}

}  // namespace

int main(int /*argc*/, char** argv) {
  google::InitGoogleLogging(argv[0]);
  invgrad::SetBlasThreads(1);
  PrintFallOfLoss();
  const bool changes_of_y = PrintChangesOfY();
  PrintNormalization();
  PrintStepsByTime();
  PrintNoise();
  const bool converges = PrintConvergence();
  PrintLocalInverses();
  PrintChaos();
  PrintEqualSamples();
  const bool is_exact = changes_of_y && converges;
  std::printf("the physical gradient is %s\n",
              is_exact ? "exact" : "not exact");
  return is_exact ? 0 : 1;
}
