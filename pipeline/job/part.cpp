#include "pipeline/job/part.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "pipeline/job/job.h"
#include "pipeline/job/keys.h"
#include "pipeline/job/profiles/printer.h"
#include "stages/support/text/key.h"
#include "stages/support/text/ranges.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {

// [[part]] of a job.

namespace {

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
      {"part", "bottom_mm", "--bottom", "MM", "height of the part's lowest point above the bed, in mm", decides::all},
      {0, kMaxMm, " mm"});
  key.write_text = [](const PartKey&, const PartRequest& part) { return value_text(part.bottom_mm.value_or(0)); };
  return key.shown_if([](const PartRequest& part) { return part.bottom_mm || !may_be_images(part); });
}

const PartKey kPartKeys[] = {
    text<check_path, &PartRequest::path>(
        {"part", "path", "", "FILE", "STL, OBJ or 3MF file, or a folder of layer images; in a job file, relative to that file",
         decides::all}),
    text<check_unit, &PartRequest::unit>(
        {"part", "unit", "--unit", "UNIT", "of STL and OBJ, which carry none: mm, cm, m, um, inch, foot", decides::all})
        .with_words([] { return std::vector<std::string_view>(std::begin(kUnits), std::end(kUnits)); }),
    field<&PartRequest::copies>({"part", "copies", "--copies", "N", "of each part, 1 to 1000000", decides::all},
                                {1, 1'000'000}),
    field<&PartRequest::at_mm>({"part", "at_mm", "--at", "X,Y",
                                "where the part's box starts, in mm from the bed's front left; else arranged", decides::all},
                               {0, kMaxMm, " mm"}),
    bottom_key(),
    custom<PartRequest, read_factors<kMinScale, true>, write_factors, &PartRequest::scale>(
        {"part", "scale", "--scale", "S|X,Y,Z", "factors per axis of the file; a negative one mirrors", decides::all},
        Form::kList),
    field<&PartRequest::rotate_deg>(
        {"part", "rotate_deg", "--rotate", "X,Y,Z", "degrees about x, then y, then z, after scaling", decides::all},
        {-36000, 36000, " degrees"}),
    custom<PartRequest, read_factors<kMinShrink, false>, write_factors, &PartRequest::shrink>(
        {"part", "shrink", "--shrink", "S|X,Y,Z", "factors per axis of the bed that make up for shrinkage, applied last",
         decides::all},
        Form::kList),
    structure<read_fill_changes, fill_changes_text, &PartRequest::fill>(
        {"part", "fill", "", "{...}", "keys of the job's filling that differ for this part", decides::all}),
    text<pipeline::check_material, &PartRequest::material>(
        {"part", "material", "", "NAME", "powder of the part, for machines with two vats", decides::all}),
    structure<read_material_ranges, material_ranges_text, &PartRequest::material_ranges>(
        {"part", "material_range", "", "[{...}]", "other powders between two heights above the part's bottom", decides::all}),
    field<&PartRequest::images, &PartImages::dpi>(
        {"part", "dpi", "", "DPI|XxY", "of a part that is images, if their files do not tell it", decides::images},
        {1, 25'400, "", true}),
    field<&PartRequest::images, &PartImages::layer_mm>(
        {"part", "layer_mm", "", "MM", "thickness of a layer of a part that is images; else by its manifest, or the job's",
         decides::images},
        {0.001, kMaxMm, " mm"}),
    field<&PartRequest::images, &PartImages::threshold>(
        {"part", "threshold", "", "N", "grey below it is jetted, 1 to 255; of images", decides::images}, {1, 255})
        .shown_if([](const PartRequest& part) { return part.images.threshold != PartImages().threshold; }),
    field<&PartRequest::images, &PartImages::invert>(
        {"part", "invert", "", "", "bright pixels are jetted, not dark ones; of images", decides::images})
        .shown_if([](const PartRequest& part) { return part.images.invert; }),
    field<&PartRequest::images, &PartImages::missing_empty>(
        {"part", "missing_empty", "", "", "numbers that are missing among images are empty layers", decides::images})
        .shown_if([](const PartRequest& part) { return part.images.missing_empty; }),
    field<&PartRequest::images, &PartImages::crop>(
        {"part", "crop", "", "", "what of images sticks out of the bed is cut off", decides::images})
        .shown_if([](const PartRequest& part) { return part.images.crop; }),
    field<&PartRequest::images, &PartImages::resample>(
        {"part", "resample", "", "", "images of another dpi than the job's are brought to it", decides::images})
        .shown_if([](const PartRequest& part) { return part.images.resample; }),
    field<&PartRequest::bleed_um>(
        {"part", "bleed_um", "", "UM|XxY", "of this part, instead of dose.bleed_um and dose.hole_bleed_um", decides::images},
        kBleedUm),
    field<&PartRequest::hole_bleed_um>(
        {"part", "hole_bleed_um", "", "UM|XxY", "of this part's holes, if it differs there", decides::images}, kBleedUm),
    structure<read_saturation, saturation_text, &PartRequest::saturation_percent>(
        {"part", "saturation_percent", "", "PERCENT|FORMULA",
         "of this part at all heights, instead of dose.saturation_percent and its ranges; of x, y, z from its corner",
         decides::images}),
    structure<read_saturation, saturation_text, &PartRequest::core_saturation_percent>(
        {"part", "core_saturation_percent", "", "PERCENT|FORMULA", "the same inside of its shell; absent: as in it",
         decides::images}),
};

}  // namespace

std::span<const PartKey> part_keys() { return kPartKeys; }

namespace {

constexpr Key<MaterialRange> kMaterialKeys[] = {
    text<pipeline::check_material, &MaterialRange::material>({"material_range", "material"})};

}  // namespace

Status set_materials(std::string_view text, Job& job) {
  const auto names = split(text, ",");
  if (names.size() != 1 && names.size() != job.parts.size()) {
    return Error{Fault::kUsage,
                 fmt::format("{} names for {} parts; give one for all or one for each", names.size(), job.parts.size())};
  }
  for (std::size_t p = 0; p < job.parts.size(); ++p) {
    const auto name = names[names.size() == 1 ? 0 : p];
    if (const std::string what = pipeline::check_material(name); !what.empty()) return Error{Fault::kUsage, what};
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

}  // namespace lamina::pipeline
