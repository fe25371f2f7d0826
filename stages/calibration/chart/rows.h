// stages/calibration/chart/rows.h: where the rows of a head land, from all of its nozzles that were read.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

namespace lamina::calibration {

/// A length with its standard error, um. within_um  99 in 100 of them lie nearer to the truth (stages/calibration/robust.h)
struct Located {
  double um = 0, error_um = 0, within_um = 0;
};

/// How far each row lands from the first one: means of nozzles weighted by their errors and their scatter, without those far
/// from the row's median. Nozzle n is of row n % rows.
/// nozzles  along the scan; absent: not read
/// returns  one a row, of the first one 0; absent: no nozzle of it, or of the first one, was read
/// cost     O(nozzles log nozzles)
std::vector<std::optional<Located>> rows_of(const std::vector<std::optional<Located>>& nozzles, std::uint32_t rows);

}  // namespace lamina::calibration
