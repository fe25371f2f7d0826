#include "stages/program/head_grid.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace lamina::program {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kNmPerUm = 1000;
constexpr double kSlack = 1e-6;  // of a pixel: what rounding of angles may not decide

DotPitch pitch_of_nm(double nm) { return {1000, std::llround(nm * 1000)}; }

// Decimals of a few digits stay exact; others are rounded to picometres.
DotPitch exact_pitch(double dpi) { return is_exact_dpi(dpi) ? pitch_of_dpi(dpi) : pitch_of_nm(kNmPerInch / dpi); }

Error wrong(const Machine& machine, std::string_view key, const std::string& what) {
  return {Fault::kUsage, fmt::format("{}: {}: {}", machine.name.empty() ? "machine" : machine.name, key, what)};
}

/// Halves down, and a value within rounding of a half or a whole number counts as it.
double round_half_down(double value) { return std::ceil(value - 0.5 - kSlack); }

/// The grid of a machine in the making; each step adds to it, in this order.
class Builder {
 public:
  explicit Builder(const Machine& machine) : machine_(machine) {}

  Result<HeadGrid> build() {
    using Step = Status (Builder::*)();
    for (const Step step : {&Builder::check_head, &Builder::turn_head, &Builder::divide_scan, &Builder::make_image,
                            &Builder::aim_nozzles, &Builder::block_nozzles, &Builder::check_speed}) {
      if (Status status = (this->*step)(); !status) return status.error();
    }
    return std::move(grid_);
  }

 private:
  Status check_head();
  Status turn_head();  // the angle, and how far apart the lines are
  Status turn_to_dpi();
  Status turn_by_tilt();
  Status divide_scan();  // pixels along the scan
  Status make_image();
  Status aim_nozzles();    // where each is: u along the row, v behind it
  Status block_nozzles();  // what does not fire
  Status check_speed();

  const Machine& machine_;
  HeadGrid grid_;
  bool scan_x_ = machine_.mounting.scan_axis == ScanAxis::kX;
  double pitch_nm_ = machine_.head.pitch_um * kNmPerUm;  // of nozzles
  double angle_ = 0, sine_ = 0, cosine_ = 0;             // between row and scan
  DotPitch line_, position_;
};

Status Builder::check_head() {
  const auto& head = machine_.head;
  const auto& mount = machine_.mounting;
  grid_.scan_axis = mount.scan_axis;
  grid_.nozzles = head.nozzles;
  grid_.passes = mount.passes;
  grid_.overlap = mount.overlap_lines;
  grid_.joint_shift = mount.joint_shift_lines;
  grid_.first_swath = mount.first_swath;
  grid_.both_directions = machine_.motion.both_directions;
  grid_.head_drops = head.max_drops;
  grid_.drop_bits = head.max_drops <= 1 ? 1 : head.max_drops <= 3 ? 2 : 4;
  if (head.nozzles == 0 || head.nozzles > 65'535) return wrong(machine_, "head.nozzles", "give 1 to 65535");
  if (head.max_drops == 0 || head.max_drops > 15) return wrong(machine_, "head.max_drops", "give 1 to 15");
  if (grid_.words() * 64 * grid_.drop_bits > 65'536) {
    return wrong(machine_, "head.max_drops",
                 fmt::format("{} nozzles of {} bits of drops; {} nozzles of so many bits are planned, or 65535 of one drop",
                             head.nozzles, grid_.drop_bits, 65'536 / grid_.drop_bits));
  }
  if (!(head.pitch_um > 0)) {
    return wrong(machine_, "head.pitch_um", fmt::format("{:g} um between nozzles; give a pitch above 0", head.pitch_um));
  }
  if (mount.passes == 0) return wrong(machine_, "mounting.passes", "give at least 1");
  if (mount.overlap_lines > head.nozzles * mount.passes / 2) {
    return wrong(machine_, "mounting.overlap_lines",
                 fmt::format("{} of the {} lines of a swath; at most half of them can be shared", mount.overlap_lines,
                             head.nozzles * mount.passes));
  }
  if (const bool across = mount.scan_from == Side::kFront || mount.scan_from == Side::kBack; across == scan_x_) {
    return wrong(machine_, "mounting.scan_from",
                 scan_x_ ? "a scan along x begins left or right" : "a scan along y begins front or back");
  }
  if (const bool across = mount.nozzle_0 == Side::kLeft || mount.nozzle_0 == Side::kRight; across == scan_x_) {
    return wrong(machine_, "mounting.nozzle_0",
                 scan_x_ ? "with a scan along x nozzle 0 is at the back or front"
                         : "with a scan along y nozzle 0 is at the left or right");
  }
  return {};
}

Status Builder::turn_head() {
  if (Status status = machine_.mounting.dpi != 0 ? turn_to_dpi() : turn_by_tilt(); !status) return status;
  if (line_.nm() < 1000) return wrong(machine_, "head.pitch_um", "lines are less than 1 um apart");
  sine_ = std::abs(angle_ - kPi / 2) < 1e-12 ? 1 : std::sin(angle_);
  cosine_ = std::abs(angle_ - kPi / 2) < 1e-12 ? 0 : std::cos(angle_);
  grid_.angle_deg = angle_ * 180 / kPi;
  return {};
}

Status Builder::turn_to_dpi() {
  const auto& head = machine_.head;
  const auto& mount = machine_.mounting;
  const double passes = mount.passes;
  if (!(mount.dpi >= 1 && mount.dpi <= 25'400)) {
    return wrong(machine_, "mounting.dpi", fmt::format("{:g} is out of range; give 1 to 25400", mount.dpi));
  }
  line_ = exact_pitch(mount.dpi);
  const double sine = line_.nm() * passes / pitch_nm_;
  if (sine > 1 + kSlack) {
    return wrong(
        machine_, "mounting.dpi",
        fmt::format("{:g} dpi across the scan cannot be reached: nozzles {:g} um apart give at least {:.2f} dpi "
                    "in {} pass{}",
                    mount.dpi, head.pitch_um, kNmPerInch * passes / pitch_nm_, mount.passes, mount.passes == 1 ? "" : "es"));
  }
  angle_ = sine >= 1 ? kPi / 2 : std::asin(sine);
  return {};
}

Status Builder::turn_by_tilt() {
  const auto& mount = machine_.mounting;
  const double turned = scan_x_ ? mount.tilt_deg : 90 - mount.tilt_deg;
  angle_ = turned * kPi / 180;
  if (!(std::abs(turned) < 180)) {
    return wrong(machine_, "mounting.tilt_deg",
                 fmt::format("{:g} degrees against X is half a turn or more from a scan along {}; give the same row's angle "
                             "in the other direction",
                             mount.tilt_deg, scan_x_ ? "x" : "y"));
  }
  if (!(std::abs(std::sin(angle_)) > 0.01)) {
    return wrong(machine_, "mounting.tilt_deg",
                 fmt::format("{:g} degrees against X puts all nozzles on one line of a scan along {}; turn the head",
                             mount.tilt_deg, scan_x_ ? "x" : "y"));
  }
  if (angle_ < 0) angle_ = -angle_;
  line_ = pitch_of_nm(pitch_nm_ * std::sin(angle_) / mount.passes);
  return {};
}

Status Builder::divide_scan() {
  const auto& mount = machine_.mounting;
  const auto& motion = machine_.motion;
  position_ = line_;
  if (motion.ticks_per_pixel > 0) {
    if (!(motion.encoder_dpi >= 1 && motion.encoder_dpi <= 25'400)) {
      return wrong(machine_, "motion.ticks_per_pixel", "needs motion.encoder_dpi, the ticks an inch, 1 to 25400");
    }
    if (motion.ticks_per_pixel > 1000) return wrong(machine_, "motion.ticks_per_pixel", "give at most 1000");
    position_ = exact_pitch(motion.encoder_dpi);
    position_.span *= motion.ticks_per_pixel;
    if (position_.span > kMaxSpan) position_ = pitch_of_nm(position_.nm());
  } else if (mount.along_dpi != 0) {
    if (!(mount.along_dpi >= 1 && mount.along_dpi <= 25'400)) {
      return wrong(machine_, "mounting.along_dpi", fmt::format("{:g} is out of range; give 1 to 25400", mount.along_dpi));
    }
    position_ = exact_pitch(mount.along_dpi);
  }
  if (position_.nm() < 1000) return wrong(machine_, "mounting.along_dpi", "pixels along the scan are shorter than 1 um");
  if (motion.lag_unit == LagUnit::kTick) {
    if (motion.ticks_per_pixel == 0) {
      return wrong(machine_, "motion.lag_unit", "tick needs motion.ticks_per_pixel; use pixel otherwise");
    }
    grid_.steps_per_pixel = motion.ticks_per_pixel;
  }
  grid_.line_nm = line_.nm();
  grid_.position_nm = position_.nm();
  grid_.lag_pixels = pitch_nm_ * cosine_ / position_.nm();
  return {};
}

Status Builder::make_image() {
  const auto& mount = machine_.mounting;
  const auto axis = [&](const DotPitch& pitch, double mm_long, PixelAxis& made) {
    if (!(mm_long > 0 && mm_long <= 2147)) return false;
    made = PixelAxis(pitch, nm_of(mm_long));
    return true;
  };
  if (!axis(scan_x_ ? position_ : line_, machine_.bed.size_mm[0], grid_.image.x) ||
      !axis(scan_x_ ? line_ : position_, machine_.bed.size_mm[1], grid_.image.y)) {
    return wrong(machine_, "bed.size_mm", "give sides above 0 and up to 2147 mm");
  }
  grid_.lines = scan_x_ ? grid_.image.rows() : grid_.image.columns();
  grid_.positions = scan_x_ ? grid_.image.columns() : grid_.image.rows();
  grid_.lines_from_end = mount.nozzle_0 == Side::kFront || mount.nozzle_0 == Side::kRight;
  grid_.positions_from_end = mount.scan_from == Side::kRight || mount.scan_from == Side::kBack;
  return {};
}

Status Builder::aim_nozzles() {
  const auto& head = machine_.head;
  const double passes = machine_.mounting.passes;
  const std::size_t rows = head.row_offset_um.size();
  if (rows == 0) return wrong(machine_, "head.row_offset_um", "give one offset a row, as [0]");
  std::vector<double> behind(head.nozzles);  // nm
  for (std::uint32_t i = 0; i < head.nozzles; ++i) {
    const double along_row = machine_.mounting.first_leads ? i : double(head.nozzles - 1) - i;
    const double offset = head.row_offset_um[i % rows] * kNmPerUm;
    behind[i] = along_row * pitch_nm_ * cosine_ + offset * sine_;
    const double off_line = i * pitch_nm_ * sine_ - offset * cosine_ - i * passes * line_.nm();
    grid_.worst_line_nm = std::max(grid_.worst_line_nm, std::abs(off_line));
  }
  if (grid_.worst_line_nm > line_.nm() / 4) {
    return wrong(machine_, rows > 1 ? "head.row_offset_um" : "mounting.dpi",
                 fmt::format("a nozzle is {:.1f} um off its line, more than a quarter of a pixel; use another angle",
                             grid_.worst_line_nm / kNmPerUm));
  }
  const double minimum = *std::min_element(behind.begin(), behind.end());
  const double step = grid_.step_nm();
  std::vector<std::int64_t> steps(head.nozzles);
  for (std::uint32_t i = 0; i < head.nozzles; ++i) {
    steps[i] = static_cast<std::int64_t>(round_half_down((behind[i] - minimum) / step));
    grid_.worst_position_nm =
        std::max(grid_.worst_position_nm, std::abs((behind[i] - minimum) - static_cast<double>(steps[i]) * step));
    if (steps[i] > 100'000'000) return wrong(machine_, "head.row_offset_um", "a nozzle lags by metres");
  }
  for (const std::int64_t lag : steps) {
    grid_.lag.push_back(static_cast<std::uint32_t>(lag));
    grid_.max_lag = std::max(grid_.max_lag, grid_.lag.back());
  }
  return {};
}

Status Builder::block_nozzles() {
  const auto& head = machine_.head;
  grid_.blocked = head.blocked;
  std::sort(grid_.blocked.begin(), grid_.blocked.end());
  grid_.blocked.erase(std::unique(grid_.blocked.begin(), grid_.blocked.end()), grid_.blocked.end());
  grid_.blocked_rule = head.blocked_rule;
  if (head.blocked.size() > head.nozzles || grid_.blocked.size() >= head.nozzles) {
    return wrong(machine_, "head.blocked",
                 fmt::format("{} blocked nozzles of {}; one at least has to fire", head.blocked.size(), head.nozzles));
  }
  if (!grid_.blocked.empty() && grid_.blocked.back() >= head.nozzles) {
    return wrong(machine_, "head.blocked",
                 fmt::format("there is no nozzle {}; they count from 0 to {}", grid_.blocked.back(), head.nozzles - 1));
  }
  return {};
}

Status Builder::check_speed() {
  const auto& head = machine_.head;
  const auto& motion = machine_.motion;
  const double frequency = motion.scan_speed_mm_s * kNmPerMm / grid_.position_nm;
  if (!(motion.scan_speed_mm_s > 0)) return wrong(machine_, "motion.scan_speed_mm_s", "give a speed above 0");
  if (frequency > head.highest_frequency_hz * (1 + 1e-9)) {
    return wrong(machine_, "motion.scan_speed_mm_s",
                 fmt::format("{:g} mm/s fires a nozzle {:.0f} times a second, it can {:.0f}; scan at {:.1f} mm/s or slower",
                             motion.scan_speed_mm_s, frequency, head.highest_frequency_hz,
                             std::floor(head.highest_frequency_hz * grid_.position_nm / kNmPerMm * 10) / 10));
  }
  // Drops of a pixel follow each other before the next place.
  const double fits = std::floor(head.highest_frequency_hz / frequency * (1 + 1e-9));
  grid_.sweep_drops = static_cast<std::uint32_t>(std::clamp(fits, 1.0, static_cast<double>(head.max_drops)));
  return {};
}

}  // namespace

Result<HeadGrid> make_head_grid(const Machine& machine) { return Builder(machine).build(); }

void warn_of_fixed_stitching(const Machine& machine, const HeadGrid& grid, std::vector<Warning>& warnings) {
  const std::uint32_t apart = grid.swath_lines() - grid.overlap;
  if (grid.joint_shift == 0 || grid.joint_shift % apart != 0) return;
  warnings.push_back({"stitching", fmt::format("{}: mounting.joint_shift_lines: {} lines are whole swaths of {}, so the stitch "
                                               "lines of all layers coincide; give a number that repeats late, as {}",
                                               machine.name, grid.joint_shift, apart, std::max(1u, apart * 3 / 8))});
}

Status require_dpi(Machine& machine, const HeadGrid& grid, const std::array<double, 2>& dpi) {
  const auto refuse = [](const std::string& what) { return Error{Fault::kUsage, "bed.dpi: " + what}; };
  const bool scan_x = machine.mounting.scan_axis == ScanAxis::kX;
  const double across = dpi[scan_x ? 1 : 0], along = dpi[scan_x ? 0 : 1];
  // What a request may differ by: whole dpi are rounded, decimals have two digits or more.
  const auto rounding = [](double requested) { return requested == std::floor(requested) ? 0.5 : 0.006; };
  const double head = kNmPerInch / (grid.line_nm * grid.passes);
  const double passes = std::round(across / head);
  // The last nozzle may be a quarter of a pixel off.
  const bool decimal = across != std::floor(across);
  if (passes < 1 || passes > 64 || std::abs(across / head - passes) * grid.nozzles > 0.25 ||
      (decimal && std::abs(across - head * passes) > rounding(across) * passes)) {
    return refuse(fmt::format(
        "{:g} dpi across the scan: the head of {} reaches {:.2f} and its multiples; change the tilt or the requested dpi",
        across, machine.name, head));
  }
  machine.mounting.passes = static_cast<std::uint32_t>(passes);
  if (machine.mounting.dpi != 0) machine.mounting.dpi = std::round(head * passes * 1e6) / 1e6;
  const double square = kNmPerInch / grid.line_nm * passes / grid.passes;
  if (machine.motion.ticks_per_pixel > 0) {
    const double ticks = std::round(machine.motion.encoder_dpi / along);
    if (ticks < 1 || std::abs(machine.motion.encoder_dpi / ticks - along) > rounding(along)) {
      return refuse(
          fmt::format("{:g} dpi along the scan: the encoder of {} has {:g} ticks an inch; use an integer fraction of it", along,
                      machine.name, machine.motion.encoder_dpi));
    }
    machine.motion.ticks_per_pixel = static_cast<std::uint32_t>(ticks);
  } else if (std::abs(along - square) > (decimal ? rounding(along) * passes : rounding(along))) {
    machine.mounting.along_dpi = along;
  } else {
    machine.mounting.along_dpi = 0;
  }
  return {};
}

}  // namespace lamina::program
