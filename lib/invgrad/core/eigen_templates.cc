#include "invgrad/core/eigen_templates.h"

namespace Eigen {

INVGRAD_EIGEN_DECOMPOSITIONS()

#ifdef INVGRAD_EIGEN_PRODUCTS
namespace internal {
INVGRAD_EIGEN_PRODUCTS()
}
#endif

}  // namespace Eigen
