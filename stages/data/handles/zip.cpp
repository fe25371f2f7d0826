#include "stages/data/handles/zip.h"

namespace lamina {

LAMINA_ZIP(LAMINA_LATE_DEFINED)

Status load_zip() {
  static const Status loaded =
      load_library(LAMINA_ZIP_FILE, std::initializer_list<LateFunction>{LAMINA_ZIP(LAMINA_LATE_NAMED)});
  return loaded;
}

}  // namespace lamina
