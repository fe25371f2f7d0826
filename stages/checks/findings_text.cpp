// What an inspection found, in words.
#include <fmt/format.h>

#include "stages/checks/inspect.h"
#include "stages/support/text/readable.h"

namespace lamina::checks {
namespace {

std::string at(const Spot& spot) {
  return fmt::format("at x {:.2f}, y {:.2f}, z {:.2f} mm (layer {})", spot.x_mm, spot.y_mm, spot.z_mm, spot.layer);
}

std::string of(std::uint64_t count, std::string_view one, std::string_view several) {
  return count == 1 ? fmt::format("one {}", one) : fmt::format("{} {}", count, several);
}

std::string name_of(std::span<const std::string> part, std::uint32_t number) {
  return number < part.size() ? part[number] : fmt::format("part {}", number);
}

Warning warning(std::string code, std::string text, const Spot& spot) {
  return {std::move(code), std::move(text), {}, spot.layer, spot.z_mm};
}

}  // namespace

void report(const Findings& findings, std::span<const std::string> part, double min_mm, std::vector<Warning>& warnings) {
  const auto& [layers, islands, loose, hollows, thin, touching, bed_edge, stop] = findings;
  if (islands.count > 0) {
    warnings.push_back(warning(
        "islands",
        fmt::format(
            "{} of {} with nothing below, the largest of {:.3g} mm2 {}: powder alone holds them until they join a part; "
            "turn the part, or spread the first layers above them with care",
            of(islands.count, "piece", "pieces"), of(islands.layers, "layer", "layers"), islands.largest, at(islands.spot)),
        islands.spot));
  }
  if (loose.count > 0) {
    warnings.push_back(
        warning("loose",
                fmt::format("{} of {:.3g} mm3 that nothing joins to the bottom of a part, the largest {}: they fall "
                            "off; repair the part or take them out of it",
                            of(loose.count, "body", "bodies"), loose.amount, at(loose.spot)),
                loose.spot));
  }
  if (hollows.count > 0) {
    warnings.push_back(warning(
        "hollows",
        fmt::format("{} of {:.3g} mm3 that powder cannot leave, the largest of {:.3g} mm3 {}: open them by "
                    "holes, or let them be solid",
                    of(hollows.count, "closed hollow", "closed hollows"), hollows.amount, hollows.largest, at(hollows.spot)),
        hollows.spot));
  }
  if (thin.count > 0) {
    warnings.push_back(warning(
        "thin",
        fmt::format("{} in {} narrower than {:.3g} mm, the largest of {:.3g} mm2 {}: they may not hold; make "
                    "them thicker, or tell a smaller --min-wall",
                    of(thin.count, "spot", "spots"), of(thin.layers, "layer", "layers"), min_mm, thin.largest, at(thin.spot)),
        thin.spot));
  }
  for (const Findings::Touching& pair : touching) {
    const std::string parts = pair.part == pair.other
                                  ? "copies of " + name_of(part, pair.part)
                                  : fmt::format("{} and {}", name_of(part, pair.part), name_of(part, pair.other));
    Warning reported = warning(
        "touching", fmt::format("{} grow together {}: they come out as one; move them apart", parts, at(pair.spot)), pair.spot);
    if (pair.part < part.size()) reported.part = part[pair.part];
    warnings.push_back(std::move(reported));
  }
  if (bed_edge) {
    warnings.push_back(warning(
        "bed-edge", fmt::format("pixels lie at the very edge of the bed, first {}: move the parts inwards", at(*bed_edge)),
        *bed_edge));
  }
  if (stop) {
    constexpr std::uint64_t kMega = 1 << 20;
    warnings.push_back(
        {"not-inspected",
         fmt::format("{}: to look at layer {} takes about {}, and half of --memory is for that; give --memory {}M or more, or "
                     "leave out --inspect",
                     layers == 0 ? "no layer was looked at"
                                 : fmt::format("layers from {} on were not looked at, and what is told is of those below it",
                                               stop->layer),
                     stop->layer, readable_bytes(stop->bytes), (2 * stop->bytes + kMega - 1) / kMega),
         {},
         stop->layer,
         stop->z_mm});
  }
}

}  // namespace lamina::checks
