// python/words.h: the program's errors in the words of the module.
#pragma once

#include <string>

namespace lamina::python {

/// A message as somebody reads it who has keys and arguments instead of options: --thickness is 'heights.thickness_mm',
/// --overwrite is overwrite=True, and "--set bed.dpi=x" the key alone. Names of files and unknown options stay.
std::string in_python(const std::string& message);

}  // namespace lamina::python
