#include "stages/support/late/zip.h"

namespace lamina {

LAMINA_LATE_LIBRARY(LAMINA_ZIP, LAMINA_ZIP_FILE, load_zip)

}  // namespace lamina
