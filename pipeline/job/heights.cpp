// Section [heights].
#include "pipeline/job/heights.h"

#include "pipeline/job/keys.h"
#include "stages/data/units.h"
#include "stages/heights/heights.h"

namespace lamina::pipeline {
namespace {

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
std::string same_text(const std::string& text) { return text; }

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
constexpr Limits kLength{kLeastMm, kMostMm, " mm"}, kArea{0, 1e9, " mm2"};

const JobKey kHeightsKeys[] = {
    word<kModes, kHeights, &Request::mode>(
        {"heights", "mode", "--heights", "MODE",
         "how layers are decided: uniform, angle, cusp, stepwise, optimal; see docs/heights.md", decides::all}),
    custom<Job, read_thickness_text, same_text, kHeights, &Request::thickness_mm>(
        {"heights", "thickness_mm", "--thickness", "SET|RANGE",
         "thicknesses in mm: a set as 0.178,0.254, or a range as 0.05..0.3:0.01 (step 0.001 if left out); --layer if absent",
         decides::all},
        Form::kString),
    field<kHeights, &Request::cusp_mm>(
        {"heights", "cusp_mm", "--cusp", "MM", "highest step on a slope, for cusp, stepwise and optimal", decides::all},
        kLength),
    word<kCuspsOf, kHeights, &Request::cusp_of>(
        {"heights", "cusp_of", "--cusp-of", "printed|nominal",
         "with --shrink: the steps that are printed, or those of the part once it has shrunk", decides::all})
        .unsaid_at("printed"),
    field<kHeights, &Request::adapt_angle_deg>(
        {"heights", "adapt_angle_deg", "--adapt-angle", "DEG",
         "angle: slopes at least this flat, before --shrink, get thinner layers; 0 is a wall, 90 a horizontal face",
         decides::all},
        {0, 90, " degrees"}),
    field<kHeights, &Request::peak_angle_deg>({"heights", "peak_angle_deg", "--peak-angle", "DEG",
                                               "facets at least this flat, and level, are horizontal faces", decides::all},
                                              {45, 90, " degrees"}),
    field<kHeights, &Request::normal_tolerance>(
        {"heights", "normal_tolerance", "", "", "of the vertical component of a facet's normal, in all comparisons of angles",
         decides::all},
        {0, 0.1}),
    word<kFacets, kHeights, &Request::facets>(
        {"heights", "facets", "--facets", "range|plane",
         "what a layer looks at: facets within it, or only those that its bounding plane cuts, as in the documents",
         decides::all}),
    field<kHeights, &Request::least_facet_mm2>(
        {"heights", "facet_mm2", "--facet-area", "MM2", "facets smaller than this ask for nothing", decides::all}, kArea),
    word<kPeaks, kHeights, &Request::peaks>(
        {"heights", "peaks", "--peaks", "flats|facets",
         "angle: peaks are faces of at least --flat-area, or every horizontal facet as in Lima (2009)", decides::all})
        .unsaid_at("flats"),
    field<kHeights, &Request::cover_top>({"heights", "cover_top", "--cover-top", "",
                                          "angle and optimal: the last layer ends at the top or above it", decides::all,
                                          "true"})
        .unsaid_at("false"),
    field<kHeights, &Request::flats>({"heights", "flats", "--no-flats", "",
                                      "optimal: do not aim at horizontal faces and tops, only keep the step", decides::all,
                                      "false"}),
    field<kHeights, &Request::least_flat_mm2>(
        {"heights", "flat_mm2", "--flat-area", "MM2", "horizontal faces smaller than this are not aimed at", decides::all},
        kArea),
    field<kHeights, &Request::flat_tolerance_um>(
        {"heights", "flat_tolerance_um", "--flat-tolerance", "UM",
         "horizontal faces that near are one, and a layer that ends that near hits it, in micrometres", decides::all},
        {0, 1000, " um"}),
    custom<Job, read_time_model, write_time_model, kHeights, &Request::time_model>(
        {"heights", "time_model", "--time-model", "S[,S]",
         "optimal: the least time instead of the fewest layers; seconds a layer, and a mm2 of its section", decides::all},
        Form::kList),
    word<kContainments, kHeights, &Request::containment>({"heights", "containment", "--containment", "across|inside|outside",
                                                          "whether steps lie across the true surface, inside or outside of it",
                                                          decides::all}),
    field<kHeights, &Request::per_part>({"heights", "per_part", "--per-part", "",
                                         "each part gets its own layers within common slabs (material extrusion)", decides::all,
                                         "true"}),
};

}  // namespace

std::span<const JobKey> heights_keys() { return kHeightsKeys; }

Result<heights::Options> heights_options(const Job& job) { return heights::options_of(job.heights, job.layer_mm); }

}  // namespace lamina::pipeline
