#include "problems/equations/evolutions.h"

#include <vector>

#include "invgrad/core/specification.h"
#include "invgrad/option_set.h"
#include "problems/equations/allen_cahn.h"
#include "problems/equations/burgers.h"
#include "problems/equations/korteweg_de_vries.h"
#include "problems/equations/two_solitons.h"

namespace invgrad {
namespace {

template <typename Definition>
bool Create(const Settings& settings,
            EvolutionProblem* evolution,
            std::string* error) {
  Definition definition;
  OptionSet set;
  definition.Describe(&set);
  if (!set.SetAll(settings, error)) return false;
  evolution->end = Definition::kEnd;
  evolution->start = Definition::Start;
  evolution->in_window = [definition](const TimeWindow& window) {
    return definition.InWindow(window);
  };
  return true;
}

struct Row {
  const char* name;  // as in Problems()
  bool (*create)(const Settings&, EvolutionProblem*, std::string*);
};
constexpr Row kRows[] = {{"burgers_pinn", Create<BurgersPinn>},
                         {"kdv_pinn", Create<KortewegDeVriesPinn>},
                         {"two_solitons_pinn", Create<TwoSolitonsPinn>},
                         {"allen_cahn_pinn", Create<AllenCahnPinn>}};

}  // namespace

bool CreateEvolution(const std::string& specification,
                     EvolutionProblem* evolution,
                     std::string* error) {
  std::vector<Specification> parsed;
  if (!ParseSpecifications(specification, &parsed, error)) return false;
  if (parsed.size() != 1) {
    *error = "expected one problem";
    return false;
  }
  std::vector<std::string> names;
  for (const Row& row : kRows) {
    if (parsed[0].name == row.name) {
      return row.create(parsed[0].settings, evolution, error);
    }
    names.emplace_back(row.name);
  }
  *error = UnknownNameMessage("equation of evolution", parsed[0].name, names);
  return false;
}

}  // namespace invgrad
