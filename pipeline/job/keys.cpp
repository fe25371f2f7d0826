#include "pipeline/job/keys.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <vector>

#include "pipeline/job/errors.h"
#include "pipeline/job/file.h"
#include "pipeline/job/profiles/extruder.h"
#include "pipeline/job/profiles/printer.h"
#include "stages/data/units.h"
#include "stages/dose/field.h"
#include "stages/formats/image_format.h"
#include "stages/formats/slice_format.h"
#include "stages/geometry/isa.h"
#include "stages/heights/heights.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {

namespace {

/// The names of a section's keys on which the bytes of the same products depend.
struct SectionKeys {
  std::string_view section;
  unsigned decides;
  constexpr KeyName operator()(std::string_view name, std::string_view flag, std::string_view value, std::string_view meaning,
                               std::string_view switch_text = {}) const {
    return {section, name, flag, value, meaning, decides, switch_text};
  }
};
constexpr SectionKeys heights_key{"heights", decides::all}, image_key{"image", decides::images},
    printer_key{"machine", decides::images}, dose_key{"dose", decides::images},
    slice_key{"slice", decides::contours | decides::moves}, part_key{"part", decides::all}, images_key{"part", decides::images};

// --- [bed], [layers], [placement]

constexpr Limits kSize{kMinMm, kMaxMm, " mm"}, kDpi{.low = 1, .high = kMaxDpi, .one_for_all = true, .digits = kDpiDigits};

// With a machine, absent bed and dpi come from the machine; jobs without one show the defaults of a bare bed.
template <auto Member, const auto& Bare>
JobKey of_bed(const KeyName& name, const Limits& limits) {
  JobKey key = field<Member>(name, limits);
  key.write_text = [](const JobKey&, const Job& job) {
    const auto& requested = job.*Member;
    return requested || !job.machine.profile.empty() ? value_text(requested) : value_text(Bare);
  };
  return key;
}

const JobKey kBedKeys[] = {
    of_bed<&Job::bed_mm, kBareBedMm>({"bed", "size_mm", "--bed", "WIDTHxDEPTH",
                                      "bed size in mm; layer images cover the whole bed", decides::images | decides::contours},
                                     kSize),
    of_bed<&Job::dpi, kBareDpi>(
        {"bed", "dpi", "--dpi", "DPI|XxY", "resolution in pixels per inch along x and y, 1 to 25400", decides::images}, kDpi),
    field<&Job::margin_mm>({"bed", "margin_mm", "--margin", "MM",
                            "margin of the bed in mm that arranging keeps free; default: the machine's, else 0", decides::all},
                           {0, kMaxMm, " mm"}),
    field<&Job::layer_mm>({"layers", "thickness_mm", "--layer", "MM", "layer thickness in mm", decides::all}, kSize),
};

const JobKey kPlacementKeys[] = {
    field<&Job::gap_mm>(
        {"placement", "gap_mm", "--gap", "MM", "distance between arranged parts and copies in mm", decides::all},
        {0, kMaxMm, " mm"}),
};

// --- [heights]

using heights::Facets;
using heights::Mode;

constexpr Word<Mode> kModes[] = {{"uniform", Mode::kUniform},
                                 {"angle", Mode::kAngle},
                                 {"cusp", Mode::kCusp},
                                 {"stepwise", Mode::kStepwise},
                                 {"optimal", Mode::kOptimal}};
constexpr Word<Facets> kFacets[] = {{"range", Facets::kRange}, {"plane", Facets::kPlane}};
constexpr Word<heights::CuspOf> kCuspsOf[] = {{"printed", heights::CuspOf::kPrinted}, {"nominal", heights::CuspOf::kNominal}};
constexpr Word<heights::Peaks> kPeaks[] = {{"flats", heights::Peaks::kFlats}, {"facets", heights::Peaks::kFacets}};
constexpr Word<Containment> kContainments[] = {
    {"across", Containment::kAcross}, {"inside", Containment::kInside}, {"outside", Containment::kOutside}};

std::string read_thickness_text(std::string_view text, std::string& thickness_mm) {
  const auto set = heights::read_thicknesses(text);
  if (!set) return set.error().message;
  thickness_mm = text;
  return {};
}

std::string read_time_model(std::string_view text, std::array<double, 2>& model) {
  std::vector<double> read;
  if (auto wrong = read_value(text, {0, 1e6, " s", false, 1, 2}, read); !wrong.empty()) return wrong + "; write 12 or 12,0.03";
  model = {read[0], read.size() > 1 ? read[1] : 0};
  return {};
}
std::string write_time_model(const std::array<double, 2>& model) {
  return model[0] > 0 || model[1] > 0 ? value_text(model) : std::string();
}

using Request = HeightsRequest;
constexpr auto kHeights = &Job::heights;
constexpr Limits kLength{kMinMm, kMaxMm, " mm"}, kArea{0, 1e9, " mm2"};

const JobKey kHeightsKeys[] = {
    word<kModes, kHeights, &Request::mode>(heights_key(
        "mode", "--heights", "MODE", "layer heights: uniform, angle, cusp, stepwise, optimal (docs/theory/heights.md)")),
    custom<Job, read_thickness_text, same_text, kHeights, &Request::thickness_mm>(
        heights_key("thickness_mm", "--thickness", "SET|RANGE",
                    "thicknesses in mm: set 0.1,0.2 or range 0.05..0.3[:0.001]; default: --layer"),
        Form::kString),
    field<kHeights, &Request::cusp_mm>(
        heights_key("cusp_mm", "--cusp", "MM", "max step on slopes in mm, for cusp, stepwise and optimal"), kLength),
    word<kCuspsOf, kHeights, &Request::cusp_of>(heights_key("cusp_of", "--cusp-of", "printed|nominal",
                                                            "with --shrink: steps as printed, or nominal (after shrinkage)")),
    field<kHeights, &Request::adapt_angle_deg>(
        heights_key("adapt_angle_deg", "--adapt-angle", "DEG",
                    "angle: min slope in degrees for thinner layers; 0: wall, 90: horizontal"),
        {0, 90, " degrees"}),
    field<kHeights, &Request::peak_angle_deg>(
        heights_key("peak_angle_deg", "--peak-angle", "DEG", "min angle in degrees of facets that count as horizontal faces"),
        {45, 90, " degrees"}),
    field<kHeights, &Request::normal_tolerance>(
        heights_key("normal_tolerance", "", "", "tolerance of a facet's normal in comparisons of angles"), {0, 0.1}),
    word<kFacets, kHeights, &Request::facets>(
        heights_key("facets", "--facets", "range|plane", "facets that decide a layer: reaching into it, or cut by its planes")),
    field<kHeights, &Request::min_facet_mm2>(
        heights_key("facet_mm2", "--facet-area", "MM2", "min area in mm2 of facets that affect layers"), kArea),
    word<kPeaks, kHeights, &Request::peaks>(
        heights_key("peaks", "--peaks", "flats|facets", "angle: peaks from horizontal faces, or from all horizontal facets")),
    field<kHeights, &Request::cover_top>(
        heights_key("cover_top", "--cover-top", "", "angle, optimal: end the last layer at or above the top", "true")),
    field<kHeights, &Request::flats>(
        heights_key("flats", "--no-flats", "", "optimal: ignore horizontal faces and tops, only limit the step", "false")),
    field<kHeights, &Request::min_flat_mm2>(
        heights_key("flat_mm2", "--flat-area", "MM2", "min area in mm2 of horizontal faces; smaller ones are ignored"), kArea),
    field<kHeights, &Request::flat_tolerance_um>(
        heights_key("flat_tolerance_um", "--flat-tolerance", "UM", "height tolerance of horizontal faces in micrometres"),
        {0, 1000, " um"}),
    custom<Job, read_time_model, write_time_model, kHeights, &Request::time_model>(
        heights_key("time_model", "--time-model", "S[,S]", "optimal: minimise time; seconds per layer and per mm2 of section"),
        Form::kList),
    word<kContainments, kHeights, &Request::containment>(heights_key("containment", "--containment", "across|inside|outside",
                                                                     "layer steps across, inside or outside the true surface")),
    field<kHeights, &Request::per_part>(
        heights_key("per_part", "--per-part", "", "separate layers for each part within common slabs (extrusion)", "true")),
};

// --- [image]

constexpr Word<FillRule> kFillRules[] = {
    {"nonzero", FillRule::kNonzero}, {"positive", FillRule::kPositive}, {"evenodd", FillRule::kEvenOdd}};
constexpr Word<ImageContent> kImageContents[] = {
    {"auto", ImageContent::kAuto}, {"geometry", ImageContent::kGeometry}, {"drops", ImageContent::kDrops}};
constexpr Word<Mirror> kMirrors[] = {{"none", Mirror::kNone}, {"x", Mirror::kX}, {"y", Mirror::kY}, {"xy", Mirror::kXY}};

std::vector<std::string_view> image_formats() {
  std::vector<std::string_view> ids;
  for (const auto& format : formats::image_formats()) ids.push_back(format.id);
  for (const auto& format : formats::level_formats()) ids.push_back(format.id);
  return ids;
}

std::string check_image_format(std::string_view text) {
  return !formats::extension_of(text) ? formats::unknown_format(text) : std::string();
}

std::string check_title(std::string_view) { return {}; }

const JobKey kImageKeys[] = {
    text<check_image_format, &Job::format>(image_key("format", "--format", "FORMAT", "file format of layer images"))
        .with_words(image_formats),
    word<kFillRules, &Job::fill_rule>({"image", "fill", "--fill-rule", "RULE",
                                       "solid regions of overlapping shells: nonzero, positive or evenodd", decides::all}),
    word<kMirrors, &Job::mirror>(
        image_key("mirror", "--mirror", "x|y|xy|none", "mirror images: x swaps left and right, y front and back")),
    word<kImageContents, &Job::image_content>(
        image_key("content", "--images", "geometry|drops|auto", "with a machine: images of the geometry, or of its drops"))
        .shown_if([](const Job& job) { return job.image_content != ImageContent::kAuto; }),
    text<check_title, &Job::title>(
        image_key("title", "--title", "NAME", "job title, written to TIFF tags with layer and height")),
};

// --- [machine], [program], [dose]

/// A target of which each component is optional.
struct RangeTarget {
  std::optional<Saturation> percent, core;
};

constexpr Key<RangeTarget> kRangeKeys[] = {
    structure<read_saturation, saturation_text, &RangeTarget::percent>({"saturation_range", "saturation_percent"}),
    structure<read_saturation, saturation_text, &RangeTarget::core>({"saturation_range", "core_saturation_percent"}),
};

std::string read_saturation_ranges(const TomlValue& list, std::vector<SaturationRange>& ranges, TextPosition& at) {
  if (auto wrong = check_tables(list, "from_mm, to_mm and saturation_percent"); !wrong.empty()) return wrong;
  std::vector<SaturationRange> read;
  for (TomlValue table : list.value) {
    SaturationRange& range = read.emplace_back();
    at = table.position;
    if (auto wrong = take_ends(table, range.from_mm, range.to_mm, at); !wrong.empty()) return wrong;
    RangeTarget target;
    if (auto wrong = read_table<RangeTarget>(table, "saturation_range", kRangeKeys, target, at); !wrong.empty()) return wrong;
    if (!target.percent) return fmt::format("{}: saturation_percent is missing", range_name(range.from_mm, range.to_mm));
    range.percent = *target.percent;
    range.core_percent = target.core;
  }
  ranges = std::move(read);
  return {};
}

std::string saturation_ranges_text(const std::vector<SaturationRange>& ranges) {
  std::string text;
  for (const auto& [from, to, percent, core] : ranges) {
    text += fmt::format("{}{{ from_mm = {}, to_mm = {}, saturation_percent = {}", text.empty() ? "" : ", ", number_text(from),
                        number_text(to), saturation_text(percent));
    if (core) text += fmt::format(", core_saturation_percent = {}", saturation_text(core));
    text += " }";
  }
  return text.empty() ? text : fmt::format("[{}]", text);
}

using raster::BeadEnds;

std::string read_rule(std::string_view text, std::optional<VatRule>& rule) {
  VatRule read{};
  std::string wrong = read_vat_rule(text, read);
  if (wrong.empty()) rule = read;
  return wrong;
}
std::string rule_text(const std::optional<VatRule>& rule) { return rule ? vat_rule_text(*rule) : std::string(); }

constexpr Word<std::uint32_t> kLevels[] = {{"off", 0}, {"2", 2}, {"4", 4}, {"16", 16}};

constexpr Word<BeadEnds> kBeadEnds[] = {{"round", BeadEnds::kRound}, {"square", BeadEnds::kSquare}};

const JobKey kMachineKeys[] = {
    text<check_path, &Job::machine, &MachineRequest::profile>({"machine", "profile", "--machine", "NAME|FILE",
                                                               "printer: print program, bed and dpi; see lamina machines",
                                                               decides::images | decides::moves}),
    custom<Job, read_presets, presets_text, &Job::machine, &MachineRequest::presets>(
        printer_key("presets", "--preset", "NAME|FILE,...", "powder, binder and process presets in order; see lamina machines"),
        Form::kStrings),
    field<&Job::machine, &MachineRequest::scan_speed_mm_s>(
        printer_key("scan_speed_mm_s", "--scan-speed", "MM/S", "scan speed of the head in mm/s; default: the machine's"),
        {1e-3, 1e6, " mm/s"}),
    field<&Job::machine, &MachineRequest::blocked>(
        printer_key("blocked", "--blocked", "N,N,...", "blocked nozzles, counted from 0; replaces the machine's list"),
        {0, 65'534}),
    custom<Job, read_rule, rule_text, &Job::machine, &MachineRequest::vat_rule>(
        printer_key("vat_rule", "--vat-rule", "RULE", "vat for layers of two powders: first, second, majority, both or refuse"),
        Form::kString)
        .with_words(vat_rule_words),
    field<&Job::compress_programs>(
        {"program", "compress", "", "", "compress print programs of the dialects planes and raw", decides::images})
        .shown_if([](const Job& job) { return !job.compress_programs; }),
};

const JobKey kDoseKeys[] = {
    field<&Job::dose, &DoseRequest::bleed_um>(
        dose_key("bleed_um", "--bleed", "UM|XxY", "bleed compensation in micrometres along x and y; negative: grow"), kBleedUm),
    field<&Job::dose, &DoseRequest::hole_bleed_um>(
        dose_key("hole_bleed_um", "--hole-bleed", "UM|XxY", "bleed compensation of holes in micrometres; default: --bleed"),
        kBleedUm),
    field<&Job::dose, &DoseRequest::first_bleed_um>(
        dose_key("first_bleed_um", "--first-bleed", "UM|XxY", "bleed compensation of the first layers in micrometres"),
        kBleedUm),
    field<&Job::dose, &DoseRequest::first_layers>(
        dose_key("first_layers", "--first-layers", "N", "number of first layers that use --first-bleed"), {1, 1'000'000})
        .shown_if([](const Job& job) { return job.dose.first_layers != DoseRequest().first_layers; }),
    field<&Job::dose, &DoseRequest::shell_mm>(
        dose_key("shell_mm", "--shell", "MM", "thickness of the fully set shell in mm (with a core or filling)"),
        {0, 1000, " mm"}),
    field<&Job::dose, &DoseRequest::core>(
        dose_key("core", "--core", "SHARE", "fraction of pixels that is jetted inside the shell, 0 to 1"), {0, 1}),
    structure<read_saturation, saturation_text, &Job::dose, &DoseRequest::saturation_percent>(
        dose_key("saturation_percent", "--saturation", "PERCENT|FORMULA",
                 "binder in % of the void volume, or a formula of x, y, z in mm")),
    structure<read_saturation, saturation_text, &Job::dose, &DoseRequest::core_saturation_percent>(
        dose_key("core_saturation_percent", "--core-saturation", "PERCENT|FORMULA",
                 "saturation in % inside the shell (with --saturation and --shell)")),
    structure<read_saturation_ranges, saturation_ranges_text, &Job::dose, &DoseRequest::saturation_ranges>(
        dose_key("saturation_range", "", "[{...}]", "other saturations between two heights above the bed")),
    word<kLevels, &Job::levels>(
        dose_key("levels", "--levels", "2|4|16|off", "number of grey levels for the fill fraction of voxels"))
        .with_form(Form::kBare)
        .shown_if([](const Job& job) { return job.levels > 0; }),
    field<&Job::dose, &DoseRequest::dithered>(
        dose_key("dithered", "--no-dither", "", "round drops instead of dithering (with --levels or --saturation)", "false")),
    word<kBeadEnds, &Job::dose, &DoseRequest::bead_ends>(
        dose_key("bead_ends", "--bead-ends", "round|square", "shape of the ends of beads and segments"))
        .shown_if([](const Job& job) { return job.dose.bead_ends != BeadEnds::kRound; }),
};

// --- [slice]

std::vector<std::string_view> slice_format_words() {
  std::vector<std::string_view> words;
  for (const formats::SliceFormat& format : formats::slice_formats()) words.push_back(format.id);
  return words;
}

std::string check_slice_format(std::string_view text) {
  if (formats::find_slice_format(text) != nullptr) return {};
  if (text == "tif" || text == "tiff" || formats::extension_of(text))
    return fmt::format("'{}' is a format of images, which lamina jet writes; use one of {}", text.substr(0, 60),
                       fmt::join(slice_format_words(), ", "));
  return not_one_of(text, slice_format_words());
}

const JobKey kSliceKeys[] = {
    text<check_slice_format, &Job::slice, &SliceRequest::format>(
        {"slice", "format", "--format", "FORMAT", "file format: svg, svg-polygon, cli, cli-binary, cli-16, 3mf, null (no file)",
         decides::contours})
        .with_words(slice_format_words),
    field<&Job::slice, &SliceRequest::file_a_layer>({"slice", "file_a_layer", "--file-a-layer", "",
                                                     "write one file per layer, from layers/000000.svg", decides::contours,
                                                     "true"}),
    field<&Job::slice, &SliceRequest::empty_first_layer>({"slice", "empty_first_layer", "--empty-first-layer", "",
                                                          "CLI: start with an empty layer, for readers that infer thickness",
                                                          decides::contours, "true"}),
    field<&Job::slice, &SliceRequest::tolerance_um>(
        slice_key("tolerance_um", "--tolerance", "UM", "max deviation of simplified contours in micrometres"), {0, 1e6, " um"}),
    field<&Job::slice, &SliceRequest::bridge_mm>(
        slice_key("bridge_mm", "--bridge", "MM", "max gap in mm to close in open meshes (with --no-repair)"), {0, 1000, " mm"}),
    field<&Job::slice, &SliceRequest::offset_mm>(
        slice_key("offset_mm", "--offset", "MM", "contour offset in mm, positive outwards"), {-1000, 1000, " mm"}),
    field<&Job::support_angle_deg>(
        {"slice", "support_angle_deg", "--support-angle", "DEG", "overhangs: max angle in degrees; 0: wall, 90: horizontal"},
        {0, 89, " degrees"}),
};

// --- [extrude]

std::string read_machine_changes(const TomlValue& tree, ProfileChanges& changes, TextPosition& at) {
  return tree.is_text() ? read_changes(tree.text, changes) : read_changes(tree, changes, at);
}

JobKey machine_key() {
  JobKey key = structure<read_machine_changes, changes_text, &Job::extrude, &ExtrudeRequest::machine>(
      {"extrude", "machine", "--machine-set", "KEY=VALUE;...", "override keys of the machine's profile, as in fan.from_layer=2",
       decides::moves});
  key.read_text = [](const JobKey&, std::string_view text, Job& job) { return read_changes(text, job.extrude.machine); };
  return key;
}

template <auto Member>
JobKey number(std::string_view name, std::string_view flag, std::string_view unit, double low, double high,
              std::string_view meaning) {
  return field<&Job::extrude, Member>({"extrude", name, flag, unit, meaning, decides::moves}, {low, high});
}

const JobKey kExtrudeKeys[] = {
    text<check_path, &Job::extrude, &ExtrudeRequest::material>(
        {"extrude", "material", "--material", "NAME|FILE", "material preset; default: the printer's", decides::moves}),
    number<&ExtrudeRequest::flow>("flow", "--flow", "FACTOR", 0.01, 10, "extrusion multiplier"),
    number<&ExtrudeRequest::nozzle_degc>("nozzle_degc", "--nozzle-temperature", "DEGC", 0, 600,
                                         "nozzle temperature in degrees Celsius"),
    number<&ExtrudeRequest::bed_degc>("bed_degc", "--bed-temperature", "DEGC", 0, 300, "bed temperature in degrees Celsius"),
    number<&ExtrudeRequest::print_mm_s>("print_mm_s", "--print-speed", "MM/S", 0.1, 2000,
                                        "speed of filling lines in mm/s; 100 % of segmented lines"),
    number<&ExtrudeRequest::wall_mm_s>("wall_mm_s", "--wall-speed", "MM/S", 0.1, 2000, "speed of walls in mm/s"),
    number<&ExtrudeRequest::first_layer_mm_s>("first_layer_mm_s", "--first-layer-speed", "MM/S", 0.1, 2000,
                                              "speed limit of the first layer in mm/s"),
    number<&ExtrudeRequest::travel_mm_s>("travel_mm_s", "--travel-speed", "MM/S", 0.1, 2000, "travel speed in mm/s"),
    number<&ExtrudeRequest::retraction_mm>("retraction_mm", "--retraction", "MM", 0, 50,
                                           "retraction of filament in mm before long travel moves"),
    number<&ExtrudeRequest::fan_percent>("fan_percent", "--fan", "%", 0, 100, "speed of the part cooling fan in %"),
    field<&Job::extrude, &ExtrudeRequest::relative_extrusion>(
        {"extrude", "relative_extrusion", "--relative-extrusion", "true|false", "relative E coordinates", decides::moves})
        .with_words([] {
          return std::vector<std::string_view>{"true", "false"};
        }),
    field<&Job::extrude, &ExtrudeRequest::skirt_loops>(
        {"extrude", "skirt_loops", "--skirt", "N", "number of skirt loops around all parts; 0: none", decides::moves},
        {0, 100}),
    field<&Job::extrude, &ExtrudeRequest::brim_mm>(
        {"extrude", "brim_mm", "--brim", "MM", "width of a brim around the parts in mm", decides::moves}, {0, 100, " mm"})
        .unsaid_at("0"),
    number<&ExtrudeRequest::first_thickness_mm>("first_thickness_mm", "--first-layer", "MM", kMinMm, 10,
                                                "thickness of the first layer in mm"),
    number<&ExtrudeRequest::first_bead_mm>("first_bead_mm", "--first-bead", "MM", 0.01, 100,
                                           "bead width in the first layer in mm"),
    field<&Job::extrude, &ExtrudeRequest::elephant_foot_mm>(
        {"extrude", "elephant_foot_mm", "--elephant-foot", "MM", "inset of the first layer's outline in mm", decides::moves},
        {0, 2, " mm"})
        .unsaid_at("0"),
    field<&Job::extrude, &ExtrudeRequest::raft_layers>(
        {"extrude", "raft_layers", "--raft", "N", "number of raft layers under the parts; 0: none", decides::moves}, {0, 20})
        .unsaid_at("0"),
    field<&Job::extrude, &ExtrudeRequest::raft_gap_mm>(
        {"extrude", "raft_gap_mm", "--raft-gap", "MM", "distance from the raft to the parts in mm", decides::moves},
        {0, 1, " mm"})
        .unsaid_at("0.1"),
    field<&Job::extrude, &ExtrudeRequest::raft_margin_mm>(
        {"extrude", "raft_margin_mm", "--raft-margin", "MM", "width of the raft around the parts in mm", decides::moves},
        {0, 50, " mm"})
        .unsaid_at("3"),
    machine_key()};

// --- [load], [run]

constexpr Word<Engine> kEngines[] = {{"rays", Engine::kRays}, {"contours", Engine::kContours}, {"both", Engine::kBoth}};

constexpr Word<Container> kContainers[] = {{"none", Container::kNone}, {"zip", Container::kZip}, {"tiff", Container::kTiff}};

constexpr Word<Sync> kSyncs[] = {{"layer", Sync::kLayer}, {"job", Sync::kJob}, {"off", Sync::kOff}};

using Pair = std::optional<std::array<std::uint32_t, 2>>;

std::string write_bytes(const std::uint64_t& bytes) {
  for (const auto& [letter, shift] : {std::pair{"G", 30}, {"M", 20}, {"K", 10}}) {
    if (bytes % (1ull << shift) == 0) return fmt::format("{}{}", bytes >> shift, letter);
  }
  return fmt::format("{}", bytes);
}

constexpr Isa kIsas[] = {Isa::kAuto, Isa::kPlain, Isa::kAvx2, Isa::kAvx512};

std::string read_isa(std::string_view text, Isa& isa) {
  for (Isa one : kIsas) {
    if (isa_name(one) == text) return isa = one, std::string();
  }
  return "has to be auto, plain, avx2 or avx512";
}
/// Jobs are saved for any processor unless one was meant.
std::string write_isa(const Isa& isa) { return std::string(isa == Isa::kAuto ? std::string_view() : isa_name(isa)); }
std::vector<std::string_view> isa_words() {
  std::vector<std::string_view> words;
  for (Isa isa : kIsas) words.push_back(isa_name(isa));
  return words;
}

template <std::string (*Read)(std::string_view, std::array<std::uint32_t, 2>&)>
std::string read_pair(std::string_view text, Pair& pair) {
  std::array<std::uint32_t, 2> read{};
  auto wrong = Read(text, read);
  if (wrong.empty()) pair = read;
  return wrong;
}
std::string write_layers(const Pair& layers) {
  if (!layers) return {};
  const auto [first, last] = *layers;
  return last == UINT32_MAX ? fmt::format("{}:", first) : fmt::format("{}:{}", first, last);
}

std::string write_share(const Pair& share) {
  return share ? fmt::format("{}/{}", (*share)[0] + 1, (*share)[1]) : std::string();
}

// true and false mean auto and off; they are what is written.
std::string read_repair(std::string_view text, Job& job) {
  const bool winding = text == "winding" || text == "\"winding\"", off = text == "off" || text == "false";
  if (!winding && !off && text != "auto" && text != "true") return "has to be auto, winding or off";
  job.repair = !off;
  job.winding = winding;
  return {};
}
std::string write_repair(const Job& job) { return !job.repair ? "false" : job.winding ? "\"winding\"" : "true"; }

JobKey repair_key(const KeyName& name) {
  JobKey key = custom<Job, read_repair, write_repair>(name, Form::kBare);
  key.copy_value = [](const JobKey&, const Job& from, Job& to) { to.repair = from.repair, to.winding = from.winding; };
  return key;
}

const JobKey kLoadKeys[] = {
    repair_key(
        {"load", "repair", "--repair", "MODE", "repair of open meshes: auto, winding (approximate) or off", decides::all})
        .with_words([] {
          return std::vector<std::string_view>{"auto", "winding", "off"};
        }),
    // The row above decides; this one is an option only.
    repair_key({"load", "repair", "--no-repair", "", "do not repair open meshes", 0, "false"}).shown_if([](const Job&) {
      return false;
    }),
    field<&Job::drop_bad>(
        {"load", "drop_bad", "--drop-bad", "", "drop facets with NaN or infinite coordinates", decides::all, "true"}),
    field<&Job::weld_um>(
        {"load", "weld_um", "--weld", "UM", "max gap to weld in micrometres; 5 is doubled as needed", decides::all},
        {0, 1e6, " um"}),
};

const JobKey kRunKeys[] = {
    text<check_path, &Job::output>({"run", "output", "-o,--output", "DIR", "output directory for layers and manifest"}),
    word<kEngines, &Job::engine>(
        {"run", "engine", "--engine", "ENGINE", "slicing engine: rays, contours or both (compared); same output"}),
    custom<Job, read_isa, write_isa, &Job::isa>(
        {"run", "isa", "--isa", "SET", "instruction set: auto (widest), plain, avx2 or avx512; same output"}, Form::kString)
        .with_words(isa_words),
    field<&Job::threads>({"run", "threads", "--threads", "N", "number of threads; 0: all processors"}, {0, 4096}),
    custom<Job, read_bytes, write_bytes, &Job::memory_bytes>(
        {"run", "memory", "--memory", "SIZE", "memory limit for layers in flight, without meshes: 256M, 1G"}, Form::kString),
    word<kSyncs, &Job::sync>(
        {"run", "sync", "--sync", "WHEN", "when files are flushed to disk: job (at its end), layer or off"}),
    word<kContainers, &Job::container>(
        {"run", "container", "--container", "KIND", "few files: zip (one ZIP file), tiff (one multi-page TIFF)"}),
    custom<Job, read_pair<read_layer_range>, write_layers, &Job::layers>(
        {"run", "layers", "--layers", "A:B", "plan layers A to B - 1 only, from 0 at the bottom; also A: and :B"},
        Form::kString),
    field<&Job::strict>({"run", "strict", "--strict", "", "treat warnings as errors: exit code 5, no output", 0, "true"}),
    field<&Job::allow_empty>(
        {"run", "allow_empty", "--allow-empty", "", "accept a job without any pixel, contour or bead", 0, "true"}),
    field<&Job::inspect>(
        {"run", "inspect", "--inspect", "", "detect islands, trapped powder, thin walls, gaps and touching parts", 0, "true"}),
    field<&Job::min_wall_mm>(
        {"run", "min_wall_mm", "--min-wall", "MM", "min wall thickness in mm for --inspect; default: the powder's, else 0.3"},
        {0, 1000, " mm"}),
    field<&Job::min_drain_mm>(
        {"run", "min_drain_mm", "--min-drain", "MM", "min width of drains of hollows in mm for --inspect; default: 0.8"},
        {0, 1000, " mm"}),
    field<&Job::allow_unbound>({"run", "allow_unbound", "--allow-unbound", "",
                                "accept layers with less binder than the machine's powder needs", 0, "true"})
        .shown_if([](const Job& job) { return job.allow_unbound; }),
    custom<Job, read_pair<read_shard>, write_share, &Job::shard>(
        {"run", "shard", "--shard", "I/N", "plan shard I of N only, I from 1; see lamina merge"}, Form::kString),
};

// --- [[part]]

constexpr double kMaxFactor = 1e6, kMinScale = 1e-6, kMinShrink = 0.1;
constexpr std::string_view kUnits[] = {"mm", "cm", "m", "um", "inch", "foot"};

std::string check_unit(std::string_view text) {
  return std::ranges::find(kUnits, text) == std::end(kUnits) ? not_one_of(text, kUnits) : std::string();
}

// Factors of 0 flatten a part; of shrink, negative ones make no sense.
// clang below 18 takes no double as a template's argument.
template <const double& Low, bool Negative>
std::string read_factors(std::string_view text, std::array<double, 3>& factors) {
  std::array<double, 3> read{};
  if (auto wrong = read_value(text, {Negative ? -kMaxFactor : Low, kMaxFactor, "", true}, read); !wrong.empty()) return wrong;
  for (const double factor : read) {
    if (std::abs(factor) >= Low) continue;
    return fmt::format("{} is out of range; give factors of at least {}", number_text(factor), Low);
  }
  factors = read;
  return {};
}
std::string write_factors(const std::array<double, 3>& factors) { return value_text(factors); }

/// What no mesh is called: images, whose manifest may say where they begin.
bool may_be_images(const PartRequest& part) {
  constexpr std::string_view kMeshes[] = {".stl", ".obj", ".3mf", ".gz"};
  return !part.path.empty() &&
         std::ranges::find(kMeshes, lower_case(std::filesystem::path(part.path).extension().string())) == std::end(kMeshes);
}

PartKey bottom_key() {
  PartKey key = field<&PartRequest::bottom_mm>(
      part_key("bottom_mm", "--bottom", "MM", "height of the part's lowest point above the bed in mm"), {0, kMaxMm, " mm"});
  key.write_text = [](const PartKey&, const PartRequest& part) { return value_text(part.bottom_mm.value_or(0)); };
  return key.shown_if([](const PartRequest& part) { return part.bottom_mm || !may_be_images(part); });
}

const PartKey kPartKeys[] = {
    text<check_path, &PartRequest::path>(part_key(
        "path", "", "FILE", "STL, OBJ or 3MF file, or a folder of layer images; in a job file, relative to that file")),
    text<check_unit, &PartRequest::unit>(
        part_key("unit", "--unit", "UNIT", "unit of STL and OBJ files: mm, cm, m, um, inch or foot"))
        .with_words([] { return std::vector<std::string_view>(std::begin(kUnits), std::end(kUnits)); }),
    field<&PartRequest::copies>(part_key("copies", "--copies", "N", "number of copies of each part, 1 to 1000000"),
                                {1, 1'000'000}),
    field<&PartRequest::at_mm>(
        part_key("at_mm", "--at", "X,Y", "position of the part's front left corner in mm; default: arranged"),
        {0, kMaxMm, " mm"}),
    bottom_key(),
    custom<PartRequest, read_factors<kMinScale, true>, write_factors, &PartRequest::scale>(
        part_key("scale", "--scale", "S|X,Y,Z", "scale factor, or one per axis of the file; negative: mirrored"), Form::kList),
    field<&PartRequest::rotate_deg>(
        part_key("rotate_deg", "--rotate", "X,Y,Z", "rotation in degrees about x, then y, then z, after scaling"),
        {-36000, 36000, " degrees"}),
    custom<PartRequest, read_factors<kMinShrink, false>, write_factors, &PartRequest::shrink>(
        part_key("shrink", "--shrink", "S|X,Y,Z", "shrinkage compensation factor, or one per bed axis, applied last"),
        Form::kList),
    structure<read_fill_changes, fill_changes_text, &PartRequest::fill>(
        part_key("fill", "", "{...}", "keys of the job's filling that differ for this part")),
    text<check_material, &PartRequest::material>(
        part_key("material", "", "NAME", "powder of the part, for machines with two vats")),
    structure<read_material_ranges, material_ranges_text, &PartRequest::material_ranges>(
        part_key("material_range", "", "[{...}]", "other powders between two heights above the part's bottom")),
    field<&PartRequest::images, &PartImages::dpi>(
        images_key("dpi", "", "DPI|XxY", "resolution of image parts whose files state none"), kDpi),
    field<&PartRequest::images, &PartImages::layer_mm>(
        images_key("layer_mm", "", "MM", "thickness of a layer of a part that is images; else by its manifest, or the job's"),
        {0.001, kMaxMm, " mm"}),
    field<&PartRequest::images, &PartImages::threshold>(
        images_key("threshold", "", "N", "grey below it is jetted, 1 to 255; of images"), {1, 255})
        .shown_if([](const PartRequest& part) { return part.images.threshold != PartImages().threshold; }),
    field<&PartRequest::images, &PartImages::invert>(
        images_key("invert", "", "", "bright pixels are jetted, not dark ones; of images"))
        .shown_if([](const PartRequest& part) { return part.images.invert; }),
    field<&PartRequest::images, &PartImages::missing_empty>(
        images_key("missing_empty", "", "", "numbers that are missing among images are empty layers"))
        .shown_if([](const PartRequest& part) { return part.images.missing_empty; }),
    field<&PartRequest::images, &PartImages::crop>(images_key("crop", "", "", "cut off images at the edges of the bed"))
        .shown_if([](const PartRequest& part) { return part.images.crop; }),
    field<&PartRequest::images, &PartImages::resample>(
        images_key("resample", "", "", "images of another dpi than the job's are brought to it"))
        .shown_if([](const PartRequest& part) { return part.images.resample; }),
    field<&PartRequest::bleed_um>(
        images_key("bleed_um", "", "UM|XxY",
                   "bleed compensation of this part, instead of dose.bleed_um and dose.hole_bleed_um"),
        kBleedUm),
    field<&PartRequest::hole_bleed_um>(
        images_key("hole_bleed_um", "", "UM|XxY", "bleed compensation of this part's holes, if different"), kBleedUm),
    structure<read_saturation, saturation_text, &PartRequest::saturation_percent>(images_key(
        "saturation_percent", "", "PERCENT|FORMULA",
        "saturation of this part at all heights, instead of dose.saturation_percent and its ranges; a formula of x, y, z from its corner")),
    structure<read_saturation, saturation_text, &PartRequest::core_saturation_percent>(
        images_key("core_saturation_percent", "", "PERCENT|FORMULA", "saturation inside its shell; default: as in the shell")),
};

constexpr Key<MaterialRange> kMaterialKeys[] = {text<check_material, &MaterialRange::material>({"material_range", "material"})};

}  // namespace

std::string read_saturation(const TomlValue& value, std::optional<Saturation>& percent, TextPosition&) {
  if (!value.is_text()) return "is not a number of per cent or a formula of x, y and z";
  const std::string& text = value.text;
  const bool number = !text.empty() && text.find_first_not_of("0123456789.+-eE_") == std::string::npos;
  double read = 0;
  const std::string wrong = read_value(text, Limits{0, dose::kMaxPercent, " %"}, read);
  if (wrong.empty()) {
    percent = read;
    return {};
  }
  constexpr std::size_t kLongest = 1000;
  double any = 0;
  if (text.empty() || (number && read_value(text, Limits{-1e300, 1e300}, any).empty())) return wrong;
  if (text.size() > kLongest) return fmt::format("is a formula of {} characters, at most {} are read", text.size(), kLongest);
  if (const auto parsed = dose::parse_saturation(text); !parsed) return parsed.error().message;
  percent = Saturation::of(text);
  return {};
}

std::string saturation_text(const std::optional<Saturation>& percent) {
  if (!percent) return {};
  return percent->formula.empty() ? number_text(percent->percent) : toml_string(percent->formula);
}

std::string read_fill_rule(std::string_view text, FillRule& rule) { return read_word(kFillRules, text, rule); }

std::span<const JobKey> job_keys() {
  // The order of the sections in a job file.
  static const std::vector<JobKey> keys = [] {
    std::vector<JobKey> all;
    for (const std::span<const JobKey> group : std::initializer_list<std::span<const JobKey>>{
             kBedKeys, kHeightsKeys, kPlacementKeys, kImageKeys, kMachineKeys, kDoseKeys, kSliceKeys, fill_keys(), kExtrudeKeys,
             segment_keys(), kLoadKeys, kRunKeys}) {
      all.insert(all.end(), group.begin(), group.end());
    }
    return all;
  }();
  return keys;
}

std::span<const PartKey> part_keys() { return kPartKeys; }

Status set_materials(std::string_view text, Job& job) {
  const auto names = split(text, ",");
  if (names.size() != 1 && names.size() != job.parts.size())
    return usage("{} names for {} parts; give one for all or one for each", names.size(), job.parts.size());
  for (std::size_t p = 0; p < job.parts.size(); ++p) {
    const auto name = names[names.size() == 1 ? 0 : p];
    if (const std::string what = check_material(name); !what.empty()) return Error{Fault::kUsage, what};
    job.parts[p].material = name;
  }
  return {};
}

std::string read_material_ranges(const TomlValue& list, std::vector<MaterialRange>& ranges, TextPosition& at) {
  if (auto wrong = check_tables(list, "from_mm, to_mm and material"); !wrong.empty()) return wrong;
  std::vector<MaterialRange> read;
  for (TomlValue table : list.value) {
    MaterialRange& range = read.emplace_back();
    at = table.position;
    if (auto wrong = take_ends(table, range.from_mm, range.to_mm, at); !wrong.empty()) return wrong;
    if (auto wrong = read_table<MaterialRange>(table, "material_range", kMaterialKeys, range, at); !wrong.empty()) return wrong;
    if (range.material.empty()) return fmt::format("{}: material is missing", range_name(range.from_mm, range.to_mm));
  }
  ranges = std::move(read);
  return {};
}

std::string material_ranges_text(const std::vector<MaterialRange>& ranges) {
  std::string text;
  for (const auto& [from, to, material] : ranges) {
    text += fmt::format("{}{{ from_mm = {}, to_mm = {}, material = {} }}", text.empty() ? "" : ", ", number_text(from),
                        number_text(to), toml_string(material));
  }
  return text.empty() ? text : fmt::format("[{}]", text);
}

std::vector<KeyFacts> key_facts() {
  std::vector<KeyFacts> facts;
  const auto add = [&]<class Target>(std::span<const Key<Target>> keys, const Target& presets) {
    for (const auto& key : keys) {
      facts.push_back({fmt::format("{}.{}", key.section, key.name), std::string(key.flag), std::string(key.value),
                       key.write(presets), std::string(key.meaning), (key.decides & decides::images) != 0});
    }
  };
  add(job_keys(), Job());
  add(part_keys(), PartRequest());
  return facts;
}

}  // namespace lamina::pipeline
