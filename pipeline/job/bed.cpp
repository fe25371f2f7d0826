#include "pipeline/job/keys.h"
#include "pipeline/text/key_text.h"

namespace lamina::pipeline {
namespace {

using Form = KeyForm;
using Text = std::string_view;

std::string read_dpi(std::string_view text, Job& job) {
  const auto pieces = split(text, ",x");
  if (pieces.size() > 2) return fmt::format("'{}' is not one or two numbers; write 1200 or 1200x600", text);
  std::array<std::int64_t, 2> dpi{};
  for (std::size_t i = 0; i < 2; ++i) {
    if (auto wrong = read_whole(pieces[std::min(i, pieces.size() - 1)], 1, 25400, dpi[i]); !wrong.empty()) return wrong;
  }
  job.dpi = dpi;
  job.machine.dpi_given = true;
  return {};
}

const JobKey kBedKeys[] = {
    {"bed", "size_mm", "--bed", "WIDTHxDEPTH", "size of the bed in mm; the image covers all of it", true,
     [](Text t, Job& j) {
       auto wrong = read_pair(t, kLeastMm, kMostMm, " mm", j.bed_mm);
       j.machine.bed_given = j.machine.bed_given || wrong.empty();
       return wrong;
     },
     // A machine has its own bed and dpi, unless others were asked of it.
     [](const Job& j) { return j.machine.profile.empty() || j.machine.bed_given ? write_list(j.bed_mm) : std::string(); },
     Form::kList},
    {"bed", "dpi", "--dpi", "DPI|XxY", "pixels per inch along x and y, each 1 to 25400", true, read_dpi,
     [](const Job& j) {
       return j.machine.profile.empty() || j.machine.dpi_given ? fmt::format("{},{}", j.dpi[0], j.dpi[1]) : std::string();
     },
     Form::kList},
    {"layers", "thickness_mm", "--layer", "MM", "thickness of a layer in mm", true,
     [](Text t, Job& j) { return read_number(t, kLeastMm, kMostMm, " mm", j.layer_mm); },
     [](const Job& j) { return number_text(j.layer_mm); }, Form::kBare},
};

const JobKey kPlaceKeys[] = {
    {"place", "gap_mm", "--gap", "MM", "between parts and copies that are arranged, in mm", true,
     [](Text t, Job& j) { return read_number(t, 0, kMostMm, " mm", j.gap_mm); },
     [](const Job& j) { return number_text(j.gap_mm); }, Form::kBare},
};

}  // namespace

std::span<const JobKey> bed_keys() { return kBedKeys; }
std::span<const JobKey> place_keys() { return kPlaceKeys; }

}  // namespace lamina::pipeline
