// Sections [machine] and [dose].
#include "pipeline/job/keys.h"
#include "pipeline/job/profiles/printer.h"

namespace lamina::pipeline {
namespace {

using raster::BeadEnds;

std::string read_rule(std::string_view text, std::optional<VatRule>& rule) {
  VatRule read{};
  std::string wrong = read::read_vat_rule(text, read);
  if (wrong.empty()) rule = read;
  return wrong;
}
std::string rule_text(const std::optional<VatRule>& rule) { return rule ? read::vat_rule_text(*rule) : std::string(); }

constexpr Word<std::uint32_t> kLevels[] = {{"off", 0}, {"2", 2}, {"4", 4}, {"16", 16}};

constexpr Word<BeadEnds> kBeadEnds[] = {{"round", BeadEnds::kRound}, {"square", BeadEnds::kSquare}};

const JobKey kMachineKeys[] = {
    text<check_path, &Job::machine, &MachineRequest::profile>(
        {"machine", "profile", "--machine", "NAME|FILE",
         "write the print program of this machine, and take bed and dpi from it; lamina machines lists them",
         decides::images | decides::moves}),
    custom<Job, read::read_presets, read::presets_text, &Job::machine, &MachineRequest::presets>(
        {"machine", "presets", "--preset", "NAME|FILE,...",
         "powder, binder and process that change the machine's profile, in their order; lamina machines lists them",
         decides::images},
        Form::kStrings),
    field<&Job::machine, &MachineRequest::scan_speed_mm_s>(
        {"machine", "scan_speed_mm_s", "--scan-speed", "MM/S", "of the head over the bed, instead of the machine's",
         decides::images},
        {1e-3, 1e6, " mm/s"}),
    field<&Job::machine, &MachineRequest::blocked>(
        {"machine", "blocked", "--blocked", "N,N,...", "nozzles that do not fire, from 0, instead of the machine's",
         decides::images},
        {0, 65'534}),
    custom<Job, read_rule, rule_text, &Job::machine, &MachineRequest::vat_rule>(
        {"machine", "vat_rule", "--vat-rule", "RULE",
         "vat that feeds a layer of two powders, instead of the machine's; refuse: there must be none", decides::images},
        Form::kString)
        .with_words(read::vat_rule_words),
};

const JobKey kDoseKeys[] = {
    field<&Job::dose, &DoseRequest::bleed_um>(
        {"dose", "bleed_um", "--bleed", "UM|XxY",
         "leave out pixels nearer to the edge than binder spreads, along x and y; negative: set as far beyond it",
         decides::images},
        kBleedUm),
    field<&Job::dose, &DoseRequest::hole_bleed_um>({"dose", "hole_bleed_um", "--hole-bleed", "UM|XxY",
                                                    "the same at the edges of holes, if it differs there", decides::images},
                                                   kBleedUm),
    field<&Job::dose, &DoseRequest::first_bleed_um>(
        {"dose", "first_bleed_um", "--first-bleed", "UM|XxY", "the same at all edges of the first layers, if it differs there",
         decides::images},
        kBleedUm),
    field<&Job::dose, &DoseRequest::first_layers>(
        {"dose", "first_layers", "--first-layers", "N", "that --first-bleed is of", decides::images}, {1, 1'000'000})
        .shown_if([](const Job& job) { return job.dose.first_layers != DoseRequest().first_layers; }),
    field<&Job::dose, &DoseRequest::shell_mm>(
        {"dose", "shell_mm", "--shell", "MM",
         "depth below the edge of a layer that gets all its binder (with --core or --fill)", decides::images},
        {0, 1000, " mm"}),
    field<&Job::dose, &DoseRequest::core>(
        {"dose", "core", "--core", "SHARE", "of the pixels inside of the shell that is jetted, 0 to 1", decides::images},
        {0, 1}),
    structure<read_saturation, saturation_text, &Job::dose, &DoseRequest::saturation_percent>(
        {"dose", "saturation_percent", "--saturation", "PERCENT|FORMULA",
         "of the voids of the powder that binder fills, by as many drops a pixel as it takes; of x, y, z in mm",
         decides::images}),
    structure<read_saturation, saturation_text, &Job::dose, &DoseRequest::core_saturation_percent>(
        {"dose", "core_saturation_percent", "--core-saturation", "PERCENT|FORMULA",
         "the same inside of the shell (with --saturation and --shell)", decides::images}),
    structure<read_saturation_ranges, saturation_ranges_text, &Job::dose, &DoseRequest::saturation_ranges>(
        {"dose", "saturation_range", "", "[{...}]", "other saturations between two heights above the bed", decides::images}),
    word<kLevels, &Job::levels>({"dose", "levels", "--levels", "2|4|16|off",
                                 "of drops by how full a voxel is, exactly, instead of by its centre alone", decides::images})
        .with_form(Form::kBare)
        .shown_if([](const Job& job) { return job.levels > 0; }),
    field<&Job::dose, &DoseRequest::dithered>({"dose", "dithered", "--no-dither", "",
                                               "round drops to whole ones (with --levels or --saturation)", decides::images,
                                               "false"}),
    word<kBeadEnds, &Job::dose, &DoseRequest::bead_ends>(
        {"dose", "bead_ends", "--bead-ends", "round|square",
         "of the beads that fill a part, and of their thick and thin stretches", decides::images})
        .shown_if([](const Job& job) { return job.dose.bead_ends != BeadEnds::kRound; }),
};

}  // namespace

std::span<const JobKey> machine_keys() { return kMachineKeys; }
std::span<const JobKey> dose_keys() { return kDoseKeys; }

}  // namespace lamina::pipeline
