#include "stages/segment/design/job_text.h"

#include <fmt/format.h>

#include <filesystem>

#include "stages/support/text/number_text.h"
#include "stages/support/text/toml.h"

namespace lamina::segment {
namespace {

std::string segment_text(const Settings& keys) {
  return fmt::format(
      "on = true\nrule = \"aligned\"\nthick_mm = {}\nthin_mm = {}\ncontinuous_lines = {}\nspacing_sc_mm = {}\n"
      "spacing_cc_mm = {}\nthick_extrusion_percent = {}\nthick_speed_percent = {}\nthin_speed_percent = {}\n",
      number_text(keys.thick_mm), number_text(keys.thin_mm), keys.continuous, number_text(*keys.spacing_sc_mm),
      number_text(*keys.spacing_cc_mm), number_text(keys.thick_extrusion), number_text(*keys.thick_speed),
      number_text(keys.thin_speed));
}

}  // namespace

std::string designed_job_text(const std::string& machine, const ExtruderProfile& used, const Settings& keys) {
  const Calibration& calibration = used.calibration;
  std::string profile = machine;
  if (machine.ends_with(".toml") || machine.find('/') != std::string::npos)
    profile = std::filesystem::absolute(machine).string();
  const std::string speed = used.machine.speed.print_mm_s == calibration.speed_mm_s
                                ? std::string()
                                : fmt::format("[extrude]\nprint_mm_s = {}\n\n", number_text(calibration.speed_mm_s));
  return speed + fmt::format(
                     "[layers]\nthickness_mm = {}\n\n[machine]\nprofile = {}\n\n"
                     "[fill]\npattern = \"raster\"\nwidth_mm = {}\nwalls = 1\nangle_deg = 90\nangle_step_deg = 0\n\n"
                     "[segment]\n{}",
                     number_text(calibration.height_mm), toml_string(profile), number_text(calibration.width_mm),
                     segment_text(keys));
}

std::string designed_job_text(const std::string& machine, const ExtruderProfile& used, const std::vector<DesignRange>& ranges) {
  std::string text = designed_job_text(machine, used, ranges.back().keys);
  for (const DesignRange& range : ranges) {
    text += fmt::format("\n[[segment.range]]\nfrom_mm = {}\nto_mm = {}\n{}", number_text(range.from_mm),
                        number_text(range.to_mm), segment_text(range.keys));
  }
  return text;
}

std::string heights_text(double from_mm, double to_mm) {
  return fmt::format("{} to {} mm", number_text(from_mm), number_text(to_mm));
}

}  // namespace lamina::segment
