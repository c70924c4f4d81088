// Preloaded: an OpenBLAS that chooses its oldest kernels unless OPENBLAS_CORETYPE
// says otherwise, as a real one does for a processor newer than itself.
#include <cstdlib>

extern "C" const char* openblas_get_corename() {
  const char* wanted = std::getenv("OPENBLAS_CORETYPE");
  return wanted == nullptr ? "Prescott" : wanted;
}
