// stages/segment/widths_table.h: widths.csv, which people fill in with what they measure on test pieces (pieces.h).
#pragma once

#include <string>
#include <vector>

#include "stages/data/status.h"
#include "stages/segment/measured.h"
#include "stages/segment/pieces.h"

namespace lamina::segment {

/// The table to be filled in: a row for each line of the pieces.
std::string widths_text(const PieceRequest& request);

/// The rows of a filled in table. errors  kInput: file, line, column, what is wrong
Result<std::vector<Measured>> read_widths(const std::string& path);

}  // namespace lamina::segment
