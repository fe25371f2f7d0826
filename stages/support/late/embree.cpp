#include "stages/support/late/embree.h"

namespace lamina {

LAMINA_LATE_LIBRARY(LAMINA_EMBREE, LAMINA_EMBREE_FILE, load_embree)

}  // namespace lamina
