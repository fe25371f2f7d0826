// Sections [bed], [layers] and [place].
#include "pipeline/job/keys.h"

namespace lamina::pipeline {
namespace {

constexpr Limits kSize{kLeastMm, kMostMm, " mm"}, kDpi{1, 25400, "", true};

// With a machine, absent bed and dpi come from the machine; jobs without one show the defaults of a bare bed.
template <auto Member, const auto& Bare>
JobKey of_bed(const KeyName& name, const Limits& limits) {
  JobKey key = field<Member>(name, limits);
  key.write_text = [](const JobKey&, const Job& job) {
    const auto& asked = job.*Member;
    return asked || !job.machine.profile.empty() ? value_text(asked) : value_text(Bare);
  };
  return key;
}

const JobKey kBedKeys[] = {
    of_bed<&Job::bed_mm, kBareBedMm>({"bed", "size_mm", "--bed", "WIDTHxDEPTH",
                                      "size of the bed in mm; the image covers all of it", decides::images | decides::contours},
                                     kSize),
    of_bed<&Job::dpi, kBareDpi>(
        {"bed", "dpi", "--dpi", "DPI|XxY", "pixels per inch along x and y, each 1 to 25400", decides::images}, kDpi),
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
