// Sections [bed], [layers] and [place].
#include "pipeline/job/keys.h"

namespace lamina::pipeline {
namespace {

constexpr Limits kSize{kLeastMm, kMostMm, " mm"}, kDpi{1, 25400, "", true};

std::string read_bed(std::string_view text, Job& job) {
  auto wrong = read_value(text, kSize, job.bed_mm);
  job.machine.bed_given = job.machine.bed_given || wrong.empty();
  return wrong;
}
std::string write_bed(const Job& job) { return value_text(job.bed_mm); }

std::string read_dpi(std::string_view text, Job& job) {
  auto wrong = read_value(text, kDpi, job.dpi);
  job.machine.dpi_given = job.machine.dpi_given || wrong.empty();
  return wrong;
}
std::string write_dpi(const Job& job) { return value_text(job.dpi); }

// A machine has its own bed and dpi, unless others were asked of it.
const JobKey kBedKeys[] = {
    custom<Job, read_bed, write_bed>({"bed", "size_mm", "--bed", "WIDTHxDEPTH",
                                      "size of the bed in mm; the image covers all of it", decides::images | decides::contours},
                                     Form::kList)
        .shown_if([](const Job& job) { return job.machine.profile.empty() || job.machine.bed_given; }),
    custom<Job, read_dpi, write_dpi>(
        {"bed", "dpi", "--dpi", "DPI|XxY", "pixels per inch along x and y, each 1 to 25400", decides::images}, Form::kList)
        .shown_if([](const Job& job) { return job.machine.profile.empty() || job.machine.dpi_given; }),
    field<&Job::layer_mm>({"layers", "thickness_mm", "--layer", "MM", "thickness of a layer in mm", decides::all}, kSize),
};

const JobKey kPlaceKeys[] = {
    field<&Job::gap_mm>({"place", "gap_mm", "--gap", "MM", "between parts and copies that are arranged, in mm", decides::all},
                        {0, kMostMm, " mm"}),
};

}  // namespace

std::span<const JobKey> bed_keys() { return kBedKeys; }
std::span<const JobKey> place_keys() { return kPlaceKeys; }

}  // namespace lamina::pipeline
