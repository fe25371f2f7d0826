#include "pipeline/report/replay_text.h"

#include <fmt/format.h>

#include "stages/support/text/readable.h"

namespace lamina::replay {

std::string time_text(double seconds, const std::string& machine) {
  return fmt::format("{} ({:.1f} s) on {}", readable_seconds(seconds), seconds, machine);
}

std::vector<std::string> totals_text(const Totals& totals) {
  const Count& count = totals.count;
  std::vector<std::string> lines;
  lines.push_back(fmt::format(
      "programs  {} layers replayed on {}: {}, {} drops in {} sweeps, as many as {:.3f} % of the bed has pixels",
      readable_count(totals.layers), totals.machine,
      totals.moved + totals.lost > 0 ? "every drop fired once but those of blocked nozzles" : "every drop fired once",
      readable_count(count.drops), readable_count(count.sweeps), 100 * totals.coverage));
  if (totals.moved + totals.lost > 0) {
    lines.push_back(fmt::format("blocked   {} pixels fired by a neighbouring nozzle, {} not at all, as recorded",
                                readable_count(totals.moved), readable_count(totals.lost)));
  }
  if (count.max_per_position > 1) {
    lines.push_back(fmt::format("at once   up to {} drops of a nozzle on a pixel in one sweep, within its frequency",
                                count.max_per_position) +
                    (count.added > 0 ? fmt::format(", which adds {} sweeps", readable_count(count.added)) : ""));
  }
  lines.push_back(
      fmt::format("offsets   drops land up to {:.2f} um along and {:.2f} um across the scan from the centre of their pixel",
                  count.farthest_along_um, count.farthest_across_um));
  const bool feeds = count.fed_mm[0] != 0 || count.fed_mm[1] != 0;
  lines.push_back(fmt::format("printing  {}: {:.1f} m scanned, {:.1f} m other travel{}",
                              time_text(count.seconds(), totals.machine), count.scan_mm / 1000, count.travel_mm / 1000,
                              feeds ? "" : "; the program does not move powder, its time is the profile's"));
  std::string material = fmt::format("material  {:.3f} ml of binder", totals.material.binder_mm3 / 1000);
  if (feeds) {
    material += fmt::format(", {:.2f} cm3 of powder fed (solid), {:.2f} and {:.2f} mm of the vats",
                            totals.material.powder_mm3 / 1000, count.fed_mm[0], count.fed_mm[1]);
  }
  lines.push_back(std::move(material));
  if (count.spits + count.wipes + count.refills > 0) {
    lines.push_back(fmt::format("head      fired off the bed {} times, {} drops; wiped {} times; {} pauses to fill vats",
                                readable_count(count.spits), readable_count(count.spat), readable_count(count.wipes),
                                readable_count(count.refills)));
  }
  return lines;
}

Json totals_json(const Totals& totals) {
  const Count& count = totals.count;
  return {{"machine", totals.machine},
          {"layers", totals.layers},
          {"drops", count.drops},
          {"vectors", count.vectors},
          {"sweeps", count.sweeps},
          {"drops_at_once", count.max_per_position},
          {"added_sweeps", count.added},
          {"moved", totals.moved},
          {"lost", totals.lost},
          {"coverage", totals.coverage},
          {"seconds", count.seconds()},
          {"scan_mm", count.scan_mm},
          {"travel_mm", count.travel_mm},
          {"fed_mm", count.fed_mm},
          {"spits", count.spits},
          {"spat_drops", count.spat},
          {"wipes", count.wipes},
          {"refills", count.refills},
          {"binder_mm3", totals.material.binder_mm3},
          {"powder_mm3", totals.material.powder_mm3},
          {"farthest_along_um", count.farthest_along_um},
          {"farthest_across_um", count.farthest_across_um}};
}

}  // namespace lamina::replay
