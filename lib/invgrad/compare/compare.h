// The programs `compare`, `sweep` and `estimate` for problems of your own:
// methods side by side, from the same starts, with the same budgets, over seeds,
// grids and lists of problems. One file is a program (component `compare`;
// docs/tutorials/compare_methods.md):
//
//   int main(int argc, char** argv) {
//     invgrad::RegisterProblem<Shuttlecock>("shuttlecock", "q'' = ...", "page");
//     return invgrad::CompareMain(argc, argv);
//   }
//
// It has all flags of `compare` (docs/programs.md), which `--helpshort` lists;
// `--list` shows the problem with its options. problem.h says what a problem
// is; sample_data.h has the data that most problems have. A rule of your own is
// added in the same way (RegisterRule in rules.h).
//
// Fails:   the mains print what is wrong, and return the exit codes of
//          docs/programs.md.
#ifndef INVGRAD_COMPARE_COMPARE_H_
#define INVGRAD_COMPARE_COMPARE_H_

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#include "Eigen/Core"
#include "invgrad/compare/equation_problem.h"
#include "invgrad/compare/problem.h"
#include "invgrad/network.h"
#include "invgrad/option_set.h"

namespace invgrad {

// Compares methods on one problem. To be called once, from main. Without
// --problem it takes the problem that was registered first.
int CompareMain(int argc, char** argv);

// Trains or minimizes by every rule at every point of a grid of settings.
int SweepMain(int argc, char** argv);

// Compares methods on several least-squares problems: --problems, by default all
// that are registered. Tables have covariances, too, and the report has profiles
// over problems and seeds.
int EstimateMain(int argc, char** argv);

struct ProblemRow {
  std::string name;      // "oscillator_chain"
  std::string equation;  // one line
  std::string source;
  std::function<std::vector<OptionSet::Row>()> options;
  // `data`, if not null, replaces the generated data of a problem with a
  // network; for others it is an error. Returns false, with *error set, if a
  // setting or the data are not allowed.
  std::function<bool(const Settings& settings,
                     const Eigen::MatrixXd* data,
                     PhysicsProblem* problem,
                     std::string* error)>
      create;
  bool is_least_squares = false;  // whether `create` makes a ceres::Problem
};

// All registered problems. RegisterProblem invalidates iterators.
const std::deque<ProblemRow>& Problems();

// The row with this name, or null. It is valid until the program ends.
const ProblemRow* FindProblem(const std::string& name);

// Makes the problem of a specification "name:key=value:...". Returns false,
// with *error set, if it is invalid.
bool CreateProblem(const std::string& specification,
                   const Eigen::MatrixXd* data,
                   PhysicsProblem* problem,
                   std::string* error);

// Adds a row, at the beginning of main. CHECKs that the name is new and not
// empty, and has no space and none of the characters ":=,;/+>".
void RegisterProblem(ProblemRow row);

// For --torch_script: LoadTorchScript of torch_network.h. Without it the flag
// is refused.
using TorchScriptLoader = std::function<std::shared_ptr<const Network>(
    const std::string& path,
    const std::vector<std::int64_t>& input_shape,
    bool double_precision,
    std::string* error)>;
void SetTorchScriptLoader(TorchScriptLoader loader);

// Whether Definition::Create makes this kind of problem.
template <typename Definition, typename Problem>
constexpr bool kCreates = std::is_invocable_r_v<bool,
                                                decltype(&Definition::Create),
                                                const Definition,
                                                Problem*,
                                                std::string*>;

template <typename Definition>
bool CreateByDefinition(const Definition& definition,
                        const Eigen::MatrixXd* data,
                        PhysicsProblem* problem,
                        std::string* error) {
  constexpr bool kIsEquation = kCreates<Definition, EquationProblem>;
  if constexpr (kIsEquation || kCreates<Definition, LearningProblem>) {
    LearningProblem& learning = problem->learning.emplace();
    if (data != nullptr) learning.data = *data;
    if constexpr (kIsEquation) {
      EquationProblem equation;
      return definition.Create(&equation, error) &&
             CreateEquationProblem(equation, &learning, error);
    } else {
      return definition.Create(&learning, error);
    }
  } else {
    if (data != nullptr) {
      *error = "it has no data to replace";
      return false;
    }
    if constexpr (kCreates<Definition, PointProblem>) {
      return definition.Create(&problem->point.emplace(), error);
    } else {
      static_assert(kCreates<Definition, LeastSquaresProblem>,
                    "Create has an argument of another type: see problem.h");
      return definition.Create(&problem->least_squares.emplace(), error);
    }
  }
}

// The row of a struct of problem.h.
template <typename Definition>
ProblemRow MakeProblemRow(const std::string& name,
                          const std::string& equation,
                          const std::string& source) {
  const auto options = [] {
    Definition definition;
    OptionSet set;
    definition.Describe(&set);
    return set.rows();
  };
  const auto create = [](const Settings& settings,
                         const Eigen::MatrixXd* data,
                         PhysicsProblem* problem,
                         std::string* error) {
    Definition definition;
    OptionSet set;
    definition.Describe(&set);
    return set.SetAll(settings, error) &&
           CreateByDefinition(definition, data, problem, error);
  };
  return {name,
          equation,
          source,
          options,
          create,
          kCreates<Definition, LeastSquaresProblem>};
}

// Adds the row of a struct.
template <typename Definition>
void RegisterProblem(const std::string& name,
                     const std::string& equation,
                     const std::string& source) {
  RegisterProblem(MakeProblemRow<Definition>(name, equation, source));
}

}  // namespace invgrad

#endif  // INVGRAD_COMPARE_COMPARE_H_
