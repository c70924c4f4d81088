#include "invgrad/internal/logging.h"
#include "invgrad/proposal.h"

namespace invgrad {
namespace {

int OffsetOf(const ProblemState::Offsets& offsets, const double* block) {
  const auto found = offsets.find(block);
  CHECK(found != offsets.end()) << "A proposal reads or writes a pointer that "
                                   "is not a parameter block of "
                                   "the problem.";
  return found->second;
}

}  // namespace

const double* ProblemState::operator()(const double* block) const {
  const int offset = OffsetOf(*offsets_, block);
  return offset < 0 ? block : values_.data() + offset;
}

double* ProblemState::operator()(const double* block) {
  const int offset = OffsetOf(*offsets_, block);
  CHECK_GE(offset, 0) << "A proposal writes a constant parameter block.";
  return values_.data() + offset;
}

bool ProblemState::is_constant(const double* block) const {
  return OffsetOf(*offsets_, block) < 0;
}

}  // namespace invgrad
