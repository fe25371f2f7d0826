// pipeline/job/part.h: one [[part]] of a job.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "pipeline/job/fill.h"
#include "stages/data/saturation.h"
#include "stages/data/status.h"

namespace lamina {
struct TextPosition;
struct TomlValue;
}  // namespace lamina

namespace lamina::pipeline {

struct Job;

/// A different material between two heights, in mm above the bottom of a part. Where ranges overlap, the last one counts.
struct MaterialRange {
  double from_mm = 0, to_mm = 0;
  std::string material;
};

/// What of images that are a part (docs/images-as-parts.md) their files do not tell.
struct PartImages {
  std::optional<std::array<std::int64_t, 2>> dpi;  // absent: by the tags of the files
  std::optional<double> layer_mm;                  // absent: by the manifest beside them, or the job's
  std::uint32_t threshold = 128;                   // grey below it is dark, 1 .. 255
  bool invert = false;                             // bright pixels are jetted
  bool missing_empty = false;                      // numbers that are missing are empty layers
  bool crop = false;                               // what sticks out of the bed is cut off
  bool resample = false;                           // another dpi than the job's is brought to it
  bool operator==(const PartImages&) const = default;
};

/// One [[part]] of a job.
struct PartRequest {
  std::string path;
  std::string named_at = {};  // position in the job file, "job.toml:12:8"; empty without one
  std::string unit = "mm";    // mm, cm, m, um, inch, foot: for STL and OBJ, which store no unit
  std::uint32_t copies = 1;
  std::optional<std::array<double, 2>> at_mm = {};  // corner of the part's box on the bed; arranged if absent
  std::optional<double> bottom_mm = {};             // height of the part's lowest point above the bed; absent: of images as
                                                    // their manifest has it, else 0
  std::array<double, 3> scale{1, 1, 1};
  std::array<double, 3> rotate_deg{0, 0, 0};
  std::array<double, 3> shrink{1, 1, 1};            // compensation factors per axis of the bed, applied last
  FillChanges fill = {};                            // changes to the job's filling
  std::string material = {};                        // name of its powder; set for all parts or for none
  std::vector<MaterialRange> material_ranges = {};  // other materials between heights above its bottom
  PartImages images = {};                           // of a part that is images
  // --- instead of the job's
  std::optional<std::array<double, 2>> bleed_um = {}, hole_bleed_um = {};
  std::optional<Saturation> saturation_percent = {}, core_saturation_percent = {};  // at all heights; by its own corner
};

/// Sets the materials of the parts: "steel" for all, or "steel,bronze" one per part in order.
/// errors  kUsage: wrong number of names, or an invalid name
Status set_materials(std::string_view names, Job& job);

/// Reads an array of tables { from_mm, to_mm, material }. returns "" or an error message; at  its place
std::string read_material_ranges(const TomlValue& list, std::vector<MaterialRange>& ranges, TextPosition& at);
std::string material_ranges_text(const std::vector<MaterialRange>& ranges);

}  // namespace lamina::pipeline
