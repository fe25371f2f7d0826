#include "pipeline/report/machine_text.h"

#include <fmt/format.h>

#include <cmath>

#include "stages/data/units.h"
#include "stages/support/text/readable.h"

namespace lamina::program {
namespace {

/// The speed at which all drops of a pixel fit into one sweep, not above it.
double whole_drops_mm_s(const Machine& machine, const HeadGrid& grid) {
  return std::floor(machine.head.highest_frequency_hz / grid.head_drops * grid.position_nm / kNmPerMm * 10) / 10;
}

/// "every 4 layers and 30 s"; empty without any.
std::string how_often(std::uint32_t layers, double seconds) {
  std::string text = layers == 0 ? "" : layers == 1 ? "every layer" : fmt::format("every {} layers", layers);
  if (seconds > 0) text += fmt::format("{}{:g} s", text.empty() ? "every " : " and ", seconds);
  return text;
}

std::string maintenance_text(const Machine& machine, const FullLayer& full) {
  const auto& maintenance = machine.maintenance;
  const std::string shots = how_often(maintenance.spit_layers, maintenance.spit_seconds),
                    wipes = how_often(maintenance.wipe_layers, maintenance.wipe_seconds);
  std::string text = shots.empty() ? "" : "fired off the bed " + shots;
  if (!wipes.empty()) text += (text.empty() ? "wiped " : ", wiped ") + wipes;
  return text + fmt::format(": {:.2f} s of a full layer and {:.0f} drops, averaged over layers", full.maintenance_seconds,
                            full.spat_drops);
}

}  // namespace

std::string sweeps_text(const Machine& machine, const HeadGrid& grid, const DropSweeps& sweeps) {
  const std::uint32_t count = grid.sweeps_for(sweeps.max_drops);
  std::string text =
      fmt::format("{} over a position for up to {} drop{} a pixel", count, sweeps.max_drops, sweeps.max_drops == 1 ? "" : "s");
  if (grid.sweep_drops == grid.head_drops) return text + fmt::format(", up to {} in each", grid.sweep_drops);
  text += fmt::format(": {:g} Hz allow {} of the head's {} drops at {:g} mm/s, all of them at {:.1f} mm/s",
                      machine.head.highest_frequency_hz, grid.sweep_drops, grid.head_drops, machine.motion.scan_speed_mm_s,
                      whole_drops_mm_s(machine, grid));
  if (sweeps.added == 0) return text;
  return text + fmt::format("; that adds {} sweep{}, {}", readable_count(sweeps.added), sweeps.added == 1 ? "" : "s",
                            readable_seconds(sweeps.added_seconds));
}

std::string explain(const Machine& machine, const HeadGrid& grid, const std::optional<FullLayer>& full) {
  std::string text;
  const auto line = [&](std::string_view name, const std::string& value) { text += fmt::format("{:<12}{}\n", name, value); };
  const auto dpi = [](double nm) { return kNmPerInch / nm; };
  const std::uint64_t sweeps = full ? full->sweeps : std::uint64_t{grid.swaths(0)} * grid.passes;
  line("machine", fmt::format("{}: {}", machine.name, machine.description));
  line("bed", machine.bed.shape == BedShape::kRound
                  ? fmt::format("round, {:g} mm, parts up to {:g} mm high", machine.bed.size_mm[0], machine.bed.build_height_mm)
                  : fmt::format("{:g} x {:g} mm, parts up to {:g} mm high", machine.bed.size_mm[0], machine.bed.size_mm[1],
                                machine.bed.build_height_mm));
  line("head", fmt::format("{} nozzles {:g} um apart ({:.2f} npi) in {} row{}, {:g} pl a drop{}{}", grid.nozzles,
                           machine.head.pitch_um, dpi(machine.head.pitch_um * 1000.0), machine.head.row_offset_um.size(),
                           machine.head.row_offset_um.size() == 1 ? "" : "s", machine.head.drop_pl,
                           grid.head_drops > 1 ? fmt::format(", up to {} on a pixel in one sweep", grid.head_drops) : "",
                           grid.blocked.empty() ? "" : fmt::format(", {} blocked", grid.blocked.size())));
  line("angle", fmt::format("{:.4f} degrees between the nozzles and the scan along {}", grid.angle_deg,
                            grid.scan_axis == ScanAxis::kX ? "x" : "y"));
  line("across", fmt::format("{:.3f} dpi, lines {:.4f} um apart{}", dpi(grid.line_nm), grid.line_nm / 1000.0,
                             grid.passes > 1 ? fmt::format(" in {} interlaced passes", grid.passes) : ""));
  line("along", fmt::format("{:.3f} dpi, pixels of {:.4f} um{}", dpi(grid.position_nm), grid.position_nm / 1000.0,
                            grid.steps_per_pixel > 1
                                ? fmt::format(" in {} steps of {:.4f} um", grid.steps_per_pixel, grid.step_nm() / 1000.0)
                                : ""));
  line("lag", fmt::format("{:.6f} pixels a nozzle, {} steps in all; drops land up to {:.2f} um along and {:.2f} um across "
                          "from the centre of their pixel",
                          grid.lag_pixels, grid.max_lag, grid.worst_position_nm / 1000.0, grid.worst_line_nm / 1000.0));
  line("swath", fmt::format("{} lines, {:.3f} mm wide{}", grid.swath_lines(), grid.swath_lines() * grid.line_nm / kNmPerMm,
                            grid.overlap > 0 ? fmt::format(", {} of them shared with the next", grid.overlap) : "") +
                    (grid.joint_shift > 0 ? fmt::format(", {} lines further back in each layer", grid.joint_shift) : ""));
  line("layer",
       fmt::format("{} x {} pixels, {} bytes as bits; {} swaths, {} sweeps of up to {} steps, {} bytes of vectors",
                   grid.image.columns(), grid.image.rows(), (std::uint64_t{grid.image.columns()} + 7) / 8 * grid.image.rows(),
                   grid.swaths(0), sweeps, grid.steps(), sweeps * grid.steps() * ((grid.nozzles + 7) / 8)));
  line("speed",
       fmt::format("{:g} mm/s, at most {:.1f} mm/s at {:g} Hz", machine.motion.scan_speed_mm_s,
                   machine.head.highest_frequency_hz * grid.position_nm / kNmPerMm, machine.head.highest_frequency_hz));
  if (grid.head_drops > 1) {
    line("drops", grid.sweep_drops == grid.head_drops
                      ? fmt::format("all {} of a pixel in one sweep at that speed, as {} bits", grid.head_drops, grid.drop_bits)
                      : fmt::format("{} of {} of a pixel in one sweep at that speed, as {} bits; all at {:.1f} mm/s",
                                    grid.sweep_drops, grid.head_drops, grid.drop_bits, whole_drops_mm_s(machine, grid)));
  }
  line("time", full ? fmt::format("{:.1f} s a full layer of {:g} mm, {:.1f} s an empty one (powder, pauses)", full->seconds,
                                  full->thickness_mm, full->empty_seconds) +
                          (full->drops_seconds > 0
                               ? fmt::format(", {:.1f} s one of {} drops on every pixel", full->drops_seconds, grid.head_drops)
                               : "")
                    : "unknown: the program of a full layer is too long");
  if (full && (machine.maintenance.spits() || machine.maintenance.wipes()))
    line("maintenance", maintenance_text(machine, *full));
  line("dialect", machine.dialect);
  return text;
}

}  // namespace lamina::program
