// stages/formats/g4/codes.h: the code words of T.6, as the encoder names them.
#pragma once

#include "stages/geometry/t6_codes.h"

namespace lamina::write::g4 {

using namespace lamina::t6;

}  // namespace lamina::write::g4
