#include "pipeline/text/version.h"

namespace lamina::pipeline {

std::string_view version() { return LAMINA_VERSION; }

}  // namespace lamina::pipeline
