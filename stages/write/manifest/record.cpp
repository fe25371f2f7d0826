#include "stages/write/manifest/record.h"

namespace lamina {

void PathFacts::add(const PathFacts& other) {
  contours += other.contours;
  points += other.points;
  paths += other.paths;
  united += other.united > 0 ? 1 : 0;
  open += other.open;
  area_mm2 += other.area_mm2;
  bead_mm += other.bead_mm;
  stored_points += other.stored_points;
  totals.add(other.totals);
  laid.add(other.laid);
}

}  // namespace lamina
