#include "invgrad/compare/compare.h"

#include <utility>

#include "bin/support/training_flags.h"
#include "fmt/core.h"
#include "invgrad/core/specification.h"
#include "invgrad/internal/logging.h"

namespace invgrad {
namespace {

std::deque<ProblemRow>& Table() {
  static auto& table = *new std::deque<ProblemRow>;
  return table;
}

}  // namespace

const std::deque<ProblemRow>& Problems() { return Table(); }

const ProblemRow* FindProblem(const std::string& name) {
  for (const ProblemRow& row : Table()) {
    if (row.name == name) return &row;
  }
  return nullptr;
}

void RegisterProblem(ProblemRow row) {
  CHECK(!row.name.empty() &&
        row.name.find_first_of(":=,;/+> \t\n") == std::string::npos)
      << "'" << row.name << "' cannot be the name of a problem.";
  CHECK(FindProblem(row.name) == nullptr)
      << "There is already a problem '" << row.name << "'.";
  CHECK(row.options != nullptr && row.create != nullptr)
      << "The row of problem '" << row.name << "' is incomplete.";
  Table().push_back(std::move(row));
}

bool CreateProblem(const std::string& specification,
                   const Eigen::MatrixXd* data,
                   PhysicsProblem* problem,
                   std::string* error) {
  std::vector<Specification> parsed;
  if (!ParseSpecifications(specification, &parsed, error)) return false;
  if (parsed.size() != 1) {
    *error = fmt::format("one problem is wanted, not {}: '{}'",
                         parsed.size(),
                         Printable(specification));
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
  if (data != nullptr && data->size() == 0) {
    why = fmt::format("data must not be empty, found shape ({}, {})",
                      data->rows(),
                      data->cols());
  } else if (row->create(parsed[0].settings, data, problem, &why)) {
    return true;
  }
  *error = fmt::format("problem {}: {}", row->name, why);
  return false;
}

}  // namespace invgrad
