#include "stages/program/head_grid.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace lamina::program {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kNmPerUm = 1000;
constexpr double kSlack = 1e-6;  // of a pixel: what rounding of angles may not decide

/// Along one axis: whole dots in a span of nm.
struct Pitch {
  std::int64_t dots = 0, span = 0;
  double nm() const { return static_cast<double>(span) / static_cast<double>(dots); }
};

Pitch pitch_of_nm(double nm) { return {1000, std::llround(nm * 1000)}; }

// Whole dpi stay exact; others are rounded to picometres.
Pitch pitch_of_dpi(double dpi) {
  if (dpi == std::floor(dpi)) return {static_cast<std::int64_t>(dpi), kNmPerInch};
  return pitch_of_nm(kNmPerInch / dpi);
}

Error wrong(const Machine& machine, std::string_view key, const std::string& what) {
  return {Fault::kUsage, fmt::format("{}: {}: {}", machine.name.empty() ? "machine" : machine.name, key, what)};
}

/// Halves down, and what rounding left beside a half or a whole number counts as it.
double round_half_down(double value) { return std::ceil(value - 0.5 - kSlack); }

}  // namespace

Result<HeadGrid> make_head_grid(const Machine& machine) {
  const auto& head = machine.head;
  const auto& mount = machine.mounting;
  const auto& motion = machine.motion;
  const bool scan_x = mount.scan_axis == ScanAxis::kX;
  HeadGrid grid;
  grid.scan_axis = mount.scan_axis;
  grid.nozzles = head.nozzles;
  grid.passes = mount.passes;
  grid.overlap = mount.overlap_lines;
  grid.first_swath = mount.first_swath;
  grid.both_directions = motion.both_directions;

  if (head.nozzles == 0 || head.nozzles > 65'535) return wrong(machine, "head.nozzles", "give 1 to 65535");
  if (!(head.pitch_um > 0)) {
    return wrong(machine, "head.pitch_um", fmt::format("{:g} um between nozzles; give a pitch above 0", head.pitch_um));
  }
  if (mount.passes == 0) return wrong(machine, "mounting.passes", "give at least 1");
  if (mount.overlap_lines > head.nozzles * mount.passes / 2) {
    return wrong(machine, "mounting.overlap_lines",
                 fmt::format("{} of the {} lines of a swath; at most half of them can be shared", mount.overlap_lines,
                             head.nozzles * mount.passes));
  }
  if (const bool across = mount.scan_from == Side::kFront || mount.scan_from == Side::kBack; across == scan_x) {
    return wrong(machine, "mounting.scan_from",
                 scan_x ? "a scan along x begins left or right" : "a scan along y begins front or back");
  }
  if (const bool across = mount.nozzle_0 == Side::kLeft || mount.nozzle_0 == Side::kRight; across == scan_x) {
    return wrong(
        machine, "mounting.nozzle_0",
        scan_x ? "with a scan along x nozzle 0 lies back or front" : "with a scan along y nozzle 0 lies left or right");
  }

  // --- the angle, and how far apart the lines are
  const double pitch_nm = head.pitch_um * kNmPerUm;
  const double passes = mount.passes;
  double angle = 0;  // between row and scan
  Pitch line;
  if (mount.dpi != 0) {
    if (!(mount.dpi >= 1 && mount.dpi <= 25'400)) {
      return wrong(machine, "mounting.dpi", fmt::format("{:g} is out of range; give 1 to 25400", mount.dpi));
    }
    line = pitch_of_dpi(mount.dpi);
    const double sine = line.nm() * passes / pitch_nm;
    if (sine > 1 + kSlack) {
      return wrong(
          machine, "mounting.dpi",
          fmt::format("{:g} dpi across the scan cannot be reached: nozzles {:g} um apart give at least {:.2f} dpi "
                      "in {} pass{}",
                      mount.dpi, head.pitch_um, kNmPerInch * passes / pitch_nm, mount.passes, mount.passes == 1 ? "" : "es"));
    }
    angle = sine >= 1 ? kPi / 2 : std::asin(sine);
  } else {
    const double turned = scan_x ? mount.tilt_deg : 90 - mount.tilt_deg;
    angle = turned * kPi / 180;
    if (!(std::abs(turned) < 180)) {
      return wrong(machine, "mounting.tilt_deg",
                   fmt::format("{:g} degrees against X is half a turn or more from a scan along {}; give the same row's angle "
                               "in the other direction",
                               mount.tilt_deg, scan_x ? "x" : "y"));
    }
    if (!(std::abs(std::sin(angle)) > 0.01)) {
      return wrong(machine, "mounting.tilt_deg",
                   fmt::format("{:g} degrees against X puts all nozzles on one line of a scan along {}; turn the head",
                               mount.tilt_deg, scan_x ? "x" : "y"));
    }
    if (angle < 0) angle = -angle;
    line = pitch_of_nm(pitch_nm * std::sin(angle) / passes);
  }
  if (line.nm() < 1000) return wrong(machine, "head.pitch_um", "lines are less than 1 um apart");
  const double sine = std::abs(angle - kPi / 2) < 1e-12 ? 1 : std::sin(angle);
  const double cosine = std::abs(angle - kPi / 2) < 1e-12 ? 0 : std::cos(angle);
  grid.angle_deg = angle * 180 / kPi;

  // --- pixels along the scan
  Pitch place = line;
  if (motion.ticks_per_pixel > 0) {
    if (!(motion.encoder_dpi >= 1 && motion.encoder_dpi <= 25'400)) {
      return wrong(machine, "motion.ticks_per_pixel", "needs motion.encoder_dpi, the ticks an inch, 1 to 25400");
    }
    if (motion.ticks_per_pixel > 1000) return wrong(machine, "motion.ticks_per_pixel", "give at most 1000");
    place = pitch_of_dpi(motion.encoder_dpi);
    place.span *= motion.ticks_per_pixel;
  } else if (mount.along_dpi != 0) {
    if (!(mount.along_dpi >= 1 && mount.along_dpi <= 25'400)) {
      return wrong(machine, "mounting.along_dpi", fmt::format("{:g} is out of range; give 1 to 25400", mount.along_dpi));
    }
    place = pitch_of_dpi(mount.along_dpi);
  }
  if (place.nm() < 1000) return wrong(machine, "mounting.along_dpi", "pixels along the scan are shorter than 1 um");
  if (motion.lag_unit == LagUnit::kTick) {
    if (motion.ticks_per_pixel == 0) {
      return wrong(machine, "motion.lag_unit", "tick needs motion.ticks_per_pixel; use pixel otherwise");
    }
    grid.steps_per_pixel = motion.ticks_per_pixel;
  }
  grid.line_nm = line.nm();
  grid.place_nm = place.nm();
  grid.lag_pixels = pitch_nm * cosine / place.nm();

  // --- the image
  const auto axis = [&](const Pitch& pitch, double mm_long, PixelAxis& made) {
    if (!(mm_long > 0 && mm_long <= 2147)) return false;
    made = PixelAxis(pitch.dots, nm_of(mm_long), pitch.span);
    return true;
  };
  if (!axis(scan_x ? place : line, machine.bed.size_mm[0], grid.image.x) ||
      !axis(scan_x ? line : place, machine.bed.size_mm[1], grid.image.y)) {
    return wrong(machine, "bed.size_mm", "give sides above 0 and up to 2147 mm");
  }
  grid.lines = scan_x ? grid.image.rows() : grid.image.columns();
  grid.places = scan_x ? grid.image.columns() : grid.image.rows();
  grid.lines_from_end = mount.nozzle_0 == Side::kFront || mount.nozzle_0 == Side::kRight;
  grid.places_from_end = mount.scan_from == Side::kRight || mount.scan_from == Side::kBack;

  // --- where each nozzle is: u along the row, v behind it
  const std::size_t rows = head.row_offset_um.size();
  if (rows == 0) return wrong(machine, "head.row_offset_um", "give one offset a row, as [0]");
  std::vector<double> behind(head.nozzles);  // nm
  for (std::uint32_t i = 0; i < head.nozzles; ++i) {
    const double along_row = mount.first_leads ? i : double(head.nozzles - 1) - i;
    const double offset = head.row_offset_um[i % rows] * kNmPerUm;
    behind[i] = along_row * pitch_nm * cosine + offset * sine;
    const double off_line = i * pitch_nm * sine - offset * cosine - i * passes * line.nm();
    grid.worst_line_nm = std::max(grid.worst_line_nm, std::abs(off_line));
  }
  if (grid.worst_line_nm > line.nm() / 4) {
    return wrong(machine, rows > 1 ? "head.row_offset_um" : "mounting.dpi",
                 fmt::format("a nozzle lies {:.1f} um beside its line, more than a quarter of a pixel; use another angle",
                             grid.worst_line_nm / kNmPerUm));
  }
  const double least = *std::min_element(behind.begin(), behind.end());
  const double step = grid.step_nm();
  std::vector<std::int64_t> steps(head.nozzles);
  for (std::uint32_t i = 0; i < head.nozzles; ++i) {
    steps[i] = static_cast<std::int64_t>(round_half_down((behind[i] - least) / step));
    grid.worst_place_nm = std::max(grid.worst_place_nm, std::abs((behind[i] - least) - static_cast<double>(steps[i]) * step));
    if (steps[i] > 100'000'000) return wrong(machine, "head.row_offset_um", "a nozzle lags behind by metres");
  }
  for (const std::int64_t lag : steps) {
    grid.lag.push_back(static_cast<std::uint32_t>(lag));
    grid.most_lag = std::max(grid.most_lag, grid.lag.back());
  }

  // --- what does not fire
  grid.blocked = head.blocked;
  std::sort(grid.blocked.begin(), grid.blocked.end());
  grid.blocked.erase(std::unique(grid.blocked.begin(), grid.blocked.end()), grid.blocked.end());
  grid.blocked_rule = head.blocked_rule;
  if (head.blocked.size() > head.nozzles || grid.blocked.size() >= head.nozzles) {
    return wrong(machine, "head.blocked",
                 fmt::format("{} blocked nozzles of {}; one at least has to fire", head.blocked.size(), head.nozzles));
  }
  if (!grid.blocked.empty() && grid.blocked.back() >= head.nozzles) {
    return wrong(machine, "head.blocked",
                 fmt::format("there is no nozzle {}; they count from 0 to {}", grid.blocked.back(), head.nozzles - 1));
  }

  // --- speed
  const double frequency = motion.scan_speed_mm_s * kNmPerMm / grid.place_nm;
  if (!(motion.scan_speed_mm_s > 0)) return wrong(machine, "motion.scan_speed_mm_s", "give a speed above 0");
  if (frequency > head.highest_frequency_hz * (1 + 1e-9)) {
    return wrong(machine, "motion.scan_speed_mm_s",
                 fmt::format("{:g} mm/s fires a nozzle {:.0f} times a second, it can {:.0f}; scan at {:.1f} mm/s or slower",
                             motion.scan_speed_mm_s, frequency, head.highest_frequency_hz,
                             std::floor(head.highest_frequency_hz * grid.place_nm / kNmPerMm * 10) / 10));
  }
  return grid;
}

std::string explain(const Machine& machine, const HeadGrid& grid) {
  std::string text;
  const auto line = [&](std::string_view name, const std::string& value) { text += fmt::format("{:<12}{}\n", name, value); };
  const auto dpi = [](double nm) { return kNmPerInch / nm; };
  const std::uint32_t swaths = grid.swaths(0), sweeps = swaths * grid.passes;
  const double sweep_mm = static_cast<double>(grid.steps()) * grid.step_nm() / kNmPerMm + 2 * machine.motion.ramp_mm;
  const double scan_s = sweeps * sweep_mm / machine.motion.scan_speed_mm_s;
  const double back_s = machine.motion.both_directions ? 0 : sweeps * sweep_mm / machine.motion.travel_speed_mm_s;
  const double roll_s =
      2 * std::abs(machine.powder.roller_mm[1] - machine.powder.roller_mm[0]) / machine.powder.roller_speed_mm_s;
  line("machine", fmt::format("{}: {}", machine.name, machine.description));
  line("bed", machine.bed.shape == BedShape::kRound
                  ? fmt::format("round, {:g} mm, parts up to {:g} mm high", machine.bed.size_mm[0], machine.bed.build_height_mm)
                  : fmt::format("{:g} x {:g} mm, parts up to {:g} mm high", machine.bed.size_mm[0], machine.bed.size_mm[1],
                                machine.bed.build_height_mm));
  line("head", fmt::format("{} nozzles {:g} um apart ({:.2f} npi) in {} row{}, {:g} pl a drop{}", grid.nozzles,
                           machine.head.pitch_um, dpi(machine.head.pitch_um * kNmPerUm), machine.head.row_offset_um.size(),
                           machine.head.row_offset_um.size() == 1 ? "" : "s", machine.head.drop_pl,
                           grid.blocked.empty() ? "" : fmt::format(", {} blocked", grid.blocked.size())));
  line("angle", fmt::format("{:.4f} degrees between the nozzles and the scan along {}", grid.angle_deg,
                            grid.scan_axis == ScanAxis::kX ? "x" : "y"));
  line("across", fmt::format("{:.3f} dpi, lines {:.4f} um apart{}", dpi(grid.line_nm), grid.line_nm / kNmPerUm,
                             grid.passes > 1 ? fmt::format(" in {} interlaced passes", grid.passes) : ""));
  line("along", fmt::format("{:.3f} dpi, pixels of {:.4f} um{}", dpi(grid.place_nm), grid.place_nm / kNmPerUm,
                            grid.steps_per_pixel > 1
                                ? fmt::format(" in {} steps of {:.4f} um", grid.steps_per_pixel, grid.step_nm() / kNmPerUm)
                                : ""));
  line("lag", fmt::format("{:.6f} pixels a nozzle, {} steps in all; drops land up to {:.2f} um along and {:.2f} um across "
                          "from the centre of their pixel",
                          grid.lag_pixels, grid.most_lag, grid.worst_place_nm / kNmPerUm, grid.worst_line_nm / kNmPerUm));
  line("swath", fmt::format("{} lines, {:.3f} mm wide{}", grid.swath_lines(), grid.swath_lines() * grid.line_nm / kNmPerMm,
                            grid.overlap > 0 ? fmt::format(", {} of them shared with the next", grid.overlap) : ""));
  line("layer",
       fmt::format("{} x {} pixels, {} bytes as bits; {} swaths, {} sweeps of {} steps, {} bytes of vectors",
                   grid.image.columns(), grid.image.rows(), (std::uint64_t{grid.image.columns()} + 7) / 8 * grid.image.rows(),
                   swaths, sweeps, grid.steps(), std::uint64_t{sweeps} * grid.steps() * ((grid.nozzles + 7) / 8)));
  line("speed", fmt::format("{:g} mm/s, at most {:.1f} mm/s at {:g} Hz", machine.motion.scan_speed_mm_s,
                            machine.head.highest_frequency_hz * grid.place_nm / kNmPerMm, machine.head.highest_frequency_hz));
  line("time", fmt::format("{:.1f} s a full layer: scan {:.1f} s, return {:.1f} s, roller {:.1f} s", scan_s + back_s + roll_s,
                           scan_s, back_s, roll_s));
  line("dialect", machine.dialect);
  return text;
}

}  // namespace lamina::program
