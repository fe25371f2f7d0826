#include "pipeline/job/keys.h"
#include "pipeline/job/material.h"
#include "pipeline/text/key_text.h"

namespace lamina::pipeline {
namespace {

using Form = KeyForm;
using Text = std::string_view;

constexpr double kMostFactor = 1e6;
constexpr Word<int> kUnits[] = {{"mm", 0}, {"cm", 0}, {"m", 0}, {"um", 0}, {"inch", 0}, {"foot", 0}};

// Factors of 0 flatten a part; of shrink, negative ones make no sense.
std::string read_factors(std::string_view text, double low, bool negative, std::array<double, 3>& factors) {
  std::array<double, 3> parsed{};
  if (auto wrong = read_triple(text, negative ? -kMostFactor : low, kMostFactor, "", true, parsed); !wrong.empty()) {
    return wrong;
  }
  for (const double factor : parsed) {
    if (std::abs(factor) < low) {
      return fmt::format("{} is out of range; give factors of at least {}", number_text(factor), low);
    }
  }
  factors = parsed;
  return {};
}

const PartKey kPartKeys[] = {
    {"part", "path", "", "FILE", "STL, OBJ or 3MF file; in a job file, relative to that file", true,
     [](Text t, PartRequest& p) { return read_path(t, p.path); }, [](const PartRequest& p) { return p.path; }, Form::kString},
    {"part", "unit", "--unit", "UNIT", "of STL and OBJ, which carry none: mm, cm, m, um, inch, foot", true,
     [](Text t, PartRequest& p) {
       int ignored = 0;
       auto wrong = read_word(kUnits, t, ignored);
       if (wrong.empty()) p.unit = t;
       return wrong;
     },
     [](const PartRequest& p) { return p.unit; }, Form::kString},
    {"part", "copies", "--copies", "N", "of each part, 1 to 1000000", true,
     [](Text t, PartRequest& p) {
       std::int64_t copies = 0;
       auto wrong = read_whole(t, 1, 1'000'000, copies);
       if (wrong.empty()) p.copies = static_cast<std::uint32_t>(copies);
       return wrong;
     },
     [](const PartRequest& p) { return fmt::format("{}", p.copies); }, Form::kBare},
    {"part", "at_mm", "--at", "X,Y", "where the part's box starts, in mm from the bed's front left; else arranged", true,
     [](Text t, PartRequest& p) {
       std::array<double, 2> at{};
       auto wrong = read_pair(t, 0, kMostMm, " mm", at);
       if (wrong.empty()) p.at_mm = at;
       return wrong;
     },
     [](const PartRequest& p) { return p.at_mm ? write_list(*p.at_mm) : std::string(); }, Form::kList},
    {"part", "bottom_mm", "--bottom", "MM", "height of the part's lowest point above the bed, in mm", true,
     [](Text t, PartRequest& p) { return read_number(t, 0, kMostMm, " mm", p.bottom_mm); },
     [](const PartRequest& p) { return number_text(p.bottom_mm); }, Form::kBare},
    {"part", "scale", "--scale", "S|X,Y,Z", "factors per axis of the file; a negative one mirrors", true,
     [](Text t, PartRequest& p) { return read_factors(t, 1e-6, true, p.scale); },
     [](const PartRequest& p) { return write_list(p.scale); }, Form::kList},
    {"part", "rotate_deg", "--rotate", "X,Y,Z", "degrees about x, then y, then z, after scaling", true,
     [](Text t, PartRequest& p) { return read_triple(t, -36000, 36000, " degrees", false, p.rotate_deg); },
     [](const PartRequest& p) { return write_list(p.rotate_deg); }, Form::kList},
    {"part", "shrink", "--shrink", "S|X,Y,Z", "factors per axis of the bed that make up for shrinkage, applied last", true,
     [](Text t, PartRequest& p) { return read_factors(t, 0.1, false, p.shrink); },
     [](const PartRequest& p) { return write_list(p.shrink); }, Form::kList},
    {"part", "fill", "", "CHANGES", "changes to the job's filling for this part: \"pattern=contour gap_mm=0.1\"", true,
     [](Text t, PartRequest& p) {
       FillSettings tried;
       auto wrong = read_fill_changes(t, tried);
       if (wrong.empty()) p.fill = t;
       return wrong;
     },
     [](const PartRequest& p) { return p.fill; }, Form::kString},
    {"part", "material", "", "NAME", "powder of the part, for machines with two vats", true,
     [](Text t, PartRequest& p) { return read_material(t, p.material); }, [](const PartRequest& p) { return p.material; },
     Form::kString},
    {"part", "material_by_height", "", "RANGES", "other powders between two heights above the part's bottom", true,
     [](Text t, PartRequest& p) {
       std::vector<MaterialRange> tried;
       auto wrong = read_material_ranges(t, tried);
       if (wrong.empty()) p.material_by_height = t;
       return wrong;
     },
     [](const PartRequest& p) { return p.material_by_height; }, Form::kString},
};

}  // namespace

std::span<const PartKey> part_keys() { return kPartKeys; }

}  // namespace lamina::pipeline
