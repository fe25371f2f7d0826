// stages/segment/widths_table.h: widths.csv, the table of widths measured on test pieces (pieces.h).
#pragma once

#include <string>
#include <vector>

#include "stages/data/status.h"
#include "stages/segment/measured.h"

namespace lamina {
class FileReader;
}

namespace lamina::segment {

/// The rows of a completed table. errors  kInput: file, line, column, reason
Result<std::vector<Measured>> read_widths(const std::string& path);
Result<std::vector<Measured>> read_widths(FileReader& file);

}  // namespace lamina::segment
