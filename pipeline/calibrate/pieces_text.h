// pipeline/calibrate/pieces_text.h: the instructions and the empty table of widths that go with test pieces.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "stages/segment/pieces.h"

namespace lamina::pipeline {

/// What to do with the pieces, step by step, as Markdown. extension  of the pieces' toolpaths
std::string steps_text(const std::vector<segment::TestPiece>& pieces, const segment::PieceRequest& request,
                       std::string_view extension);

/// The empty widths.csv (stages/segment/widths_table.h): one row per line of the pieces.
std::string widths_text(const segment::PieceRequest& request);

}  // namespace lamina::pipeline
