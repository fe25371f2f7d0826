#include "stages/data/handles/embree.h"

namespace lamina {

LAMINA_EMBREE(LAMINA_LATE_DEFINED)

Status load_embree() {
  static const Status loaded =
      load_library(LAMINA_EMBREE_FILE, std::initializer_list<LateFunction>{LAMINA_EMBREE(LAMINA_LATE_NAMED)});
  return loaded;
}

}  // namespace lamina
