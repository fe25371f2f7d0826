#include "pipeline/cli/needs.h"

#include <algorithm>

#include "pipeline/job/keys.h"

namespace lamina::pipeline {
namespace {

using heights::Mode;

bool fits_heights(Product, const Job& job) { return job.heights.mode != Mode::kUniform; }
bool by_angle(Product, const Job& job) { return job.heights.mode == Mode::kAngle; }
bool by_steps(Product product, const Job& job) { return fits_heights(product, job) && !by_angle(product, job); }
bool optimal(Product, const Job& job) { return job.heights.mode == Mode::kOptimal; }
bool may_end_below(Product product, const Job& job) { return by_angle(product, job) || optimal(product, job); }
bool shrinks(Product product, const Job& job) {
  const auto nominal = [](const PartRequest& part) { return part.shrink == std::array<double, 3>{1, 1, 1}; };
  return by_steps(product, job) && !std::ranges::all_of(job.parts, nominal);
}
bool thins(Product, const Job& job) { return job.dose.core < 1 || fills(job); }
/// Printers of filament lay a wall where nothing else is asked for.
bool lays_beads(Product product, const Job& job) { return product == Product::kMoves || fills(job); }
bool lays_lines(Product, const Job& job) {
  const auto plain = [](const PartRequest& part) { return part.fill.empty(); };
  return job.fill.all.pattern != infill::Pattern::kNone || job.segment.any() || !job.fill.ranges.empty() ||
         !std::ranges::all_of(job.parts, plain);
}

struct Need {
  std::string_view flag;
  bool (*met)(Product, const Job&);
  std::string_view unmet;
};
constexpr std::string_view kUniform = "is of layers that fit the part, and these are uniform; add --heights and --thickness",
                           kSteps = "is of --heights cusp, stepwise and optimal; add one of them",
                           kAngle = "is of --heights angle; add it", kOptimal = "is of --heights optimal; add it",
                           kCovered = "is of --heights angle and optimal, the others reach the top; add one of them",
                           kShrinks = "is of steps on parts that shrink; add --shrink, and --heights cusp, stepwise or optimal",
                           kBeads = "is of beads, and none are asked for; add --fill, --pattern or --walls",
                           kLines = "is of lines, and no pattern is asked for; add --fill or --pattern";
constexpr Need kNeeds[] = {
    {"--cusp", by_steps, kSteps},
    {"--cusp-of", shrinks, kShrinks},
    {"--adapt-angle", by_angle, kAngle},
    {"--peaks", by_angle, kAngle},
    {"--cover-top", may_end_below, kCovered},
    {"--peak-angle", fits_heights, kUniform},
    {"--facets", fits_heights, kUniform},
    {"--facet-area", fits_heights, kUniform},
    {"--no-flats", optimal, kOptimal},
    {"--flat-area", fits_heights, kUniform},
    {"--flat-tolerance", fits_heights, kUniform},
    {"--time-model", optimal, kOptimal},
    {"--shell", thins, "is the depth that is not thinned, and nothing is; add --core or --fill"},
    {"--bead-ends", lays_beads, kBeads},
    {"--bead", lays_beads, kBeads},
    {"--bead-gap", lays_lines, kLines},
    {"--line-distance", lays_lines, kLines},
    {"--gap-formula", lays_lines, kLines},
    {"--angle", lays_lines, kLines},
    {"--angle-step", lays_lines, kLines},
    {"--stagger", lays_lines, kLines},
};

}  // namespace

Status check_needs(Product product, const Arguments& arguments, const Job& job) {
  // Whoever names the pattern none knows that there are no lines.
  const bool named = arguments.has("--pattern") || arguments.has("--fill");
  for (const Need& need : kNeeds) {
    const bool beads = need.met == lays_lines || need.met == lays_beads;
    if (arguments.has(need.flag) && !need.met(product, job) && !(beads && named)) {
      return at_option(std::string(need.flag), std::string(need.unmet));
    }
  }
  return {};
}

}  // namespace lamina::pipeline
