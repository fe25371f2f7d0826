#include "pipeline/job/keys.h"
#include "pipeline/text/key_text.h"

namespace lamina::pipeline {
namespace {

using Form = KeyForm;
using Text = std::string_view;
using heights::Facets;
using heights::Mode;

constexpr Word<Mode> kModes[] = {{"uniform", Mode::kUniform},
                                 {"angle", Mode::kAngle},
                                 {"cusp", Mode::kCusp},
                                 {"stepwise", Mode::kStepwise},
                                 {"optimal", Mode::kOptimal}};
constexpr Word<Facets> kFacets[] = {{"range", Facets::kRange}, {"plane", Facets::kPlane}};
constexpr Word<Containment> kContainments[] = {
    {"across", Containment::kAcross}, {"inside", Containment::kInside}, {"outside", Containment::kOutside}};

std::string read_time_model(Text text, Job& job) {
  std::array<double, 2> model{};
  const auto pieces = split(text, ",");
  if (pieces.size() > 2) return fmt::format("'{}' is not one or two numbers; write 12 or 12,0.03", text);
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    if (auto wrong = read_number(pieces[i], 0, 1e6, " s", model[i]); !wrong.empty()) return wrong;
  }
  job.heights.time_model = model;
  return {};
}

const JobKey kHeightsKeys[] = {
    {"heights", "mode", "--heights", "MODE",
     "how layers are decided: uniform, angle, cusp, stepwise, optimal; see docs/heights.md", true,
     [](Text t, Job& j) { return read_word(kModes, t, j.heights.mode); },
     [](const Job& j) { return write_word(kModes, j.heights.mode); }, Form::kString},
    {"heights", "thickness_mm", "--thickness", "SET|RANGE",
     "thicknesses in mm: a set as 0.178,0.254, or a range as 0.05..0.3:0.01 (step 0.001 if left out); --layer if absent", true,
     [](Text t, Job& j) {
       heights::ThicknessSet set;
       auto wrong = read_thicknesses(t, set);
       if (wrong.empty()) j.heights.thickness_mm = t;
       return wrong;
     },
     [](const Job& j) { return j.heights.thickness_mm; }, Form::kString},
    {"heights", "cusp_mm", "--cusp", "MM", "highest step on a slope, for cusp, stepwise and optimal", true,
     [](Text t, Job& j) { return read_number(t, kLeastMm, kMostMm, " mm", j.heights.cusp_mm); },
     [](const Job& j) { return number_text(j.heights.cusp_mm); }, Form::kBare},
    {"heights", "adapt_angle_deg", "--adapt-angle", "DEG",
     "angle: slopes at least this flat get thinner layers; 0 is a wall, 90 a horizontal face", true,
     [](Text t, Job& j) { return read_number(t, 0, 90, " degrees", j.heights.adapt_angle_deg); },
     [](const Job& j) { return number_text(j.heights.adapt_angle_deg); }, Form::kBare},
    {"heights", "peak_angle_deg", "--peak-angle", "DEG", "facets at least this flat, and level, are horizontal faces", true,
     [](Text t, Job& j) { return read_number(t, 45, 90, " degrees", j.heights.peak_angle_deg); },
     [](const Job& j) { return number_text(j.heights.peak_angle_deg); }, Form::kBare},
    {"heights", "normal_tolerance", "", "", "of the vertical component of a facet's normal, in all comparisons of angles", true,
     [](Text t, Job& j) { return read_number(t, 0, 0.1, "", j.heights.normal_tolerance); },
     [](const Job& j) { return number_text(j.heights.normal_tolerance); }, Form::kBare},
    {"heights", "facets", "--facets", "range|plane",
     "what a layer looks at: facets within it, or only those that its bounding plane cuts, as in the documents", true,
     [](Text t, Job& j) { return read_word(kFacets, t, j.heights.facets); },
     [](const Job& j) { return write_word(kFacets, j.heights.facets); }, Form::kString},
    {"heights", "facet_mm2", "--facet-area", "MM2", "facets smaller than this ask for nothing", true,
     [](Text t, Job& j) { return read_number(t, 0, 1e9, " mm2", j.heights.least_facet_mm2); },
     [](const Job& j) { return number_text(j.heights.least_facet_mm2); }, Form::kBare},
    {"heights", "flats", "--no-flats", "", "optimal: do not aim at horizontal faces and tops, only keep the step", true,
     [](Text t, Job& j) { return read_switch(t, j.heights.flats); }, [](const Job& j) { return write_switch(j.heights.flats); },
     Form::kBare, "false"},
    {"heights", "flat_mm2", "--flat-area", "MM2", "horizontal faces smaller than this are not aimed at", true,
     [](Text t, Job& j) { return read_number(t, 0, 1e9, " mm2", j.heights.least_flat_mm2); },
     [](const Job& j) { return number_text(j.heights.least_flat_mm2); }, Form::kBare},
    {"heights", "flat_tolerance_um", "--flat-tolerance", "UM",
     "horizontal faces that near are one, and a layer that ends that near hits it, in micrometres", true,
     [](Text t, Job& j) { return read_number(t, 0, 1000, " um", j.heights.flat_tolerance_um); },
     [](const Job& j) { return number_text(j.heights.flat_tolerance_um); }, Form::kBare},
    {"heights", "time_model", "--time-model", "S[,S]",
     "optimal: the least time instead of the fewest layers; seconds a layer, and a mm2 of its section", true, read_time_model,
     [](const Job& j) {
       const auto& model = j.heights.time_model;
       return model[0] > 0 || model[1] > 0 ? write_list(model) : std::string();
     },
     Form::kList},
    {"heights", "containment", "--containment", "across|inside|outside",
     "whether steps lie across the true surface, inside or outside of it", true,
     [](Text t, Job& j) { return read_word(kContainments, t, j.heights.containment); },
     [](const Job& j) { return write_word(kContainments, j.heights.containment); }, Form::kString},
    {"heights", "per_part", "--per-part", "", "each part gets its own layers within common slabs (material extrusion)", true,
     [](Text t, Job& j) { return read_switch(t, j.heights.per_part); },
     [](const Job& j) { return write_switch(j.heights.per_part); }, Form::kBare, "true"},
};

}  // namespace

std::span<const JobKey> heights_keys() { return kHeightsKeys; }

std::string mode_name(heights::Mode mode) { return write_word(kModes, mode); }

}  // namespace lamina::pipeline
