// SML, the Stratasys Modeling Language of the FDM 2000: README.md says what of it is known.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "stages/data/units.h"
#include "stages/formats/extrusion_format.h"
#include "stages/support/text/decimal.h"

namespace lamina::formats {
namespace {

constexpr double kNmPerMil = 25'400;  // a thousandth of an inch

std::int64_t mils(std::int64_t nm) { return std::llround(static_cast<double>(nm) / kNmPerMil); }

void replace_all(std::string& text, std::string_view name, std::int64_t value) {
  const std::string digits = fmt::format("{}", value);
  for (std::size_t at = 0; (at = text.find(name, at)) != std::string::npos; at += digits.size())
    text.replace(at, name.size(), digits);
}

/// The PD line for a thickness and use, or nullptr. Thicknesses are those of the table to a micrometre.
const Extruder::Sml::Pd* find_pd(const Extruder& machine, Nm thickness, std::string_view use) {
  for (const auto& pd : machine.sml.pd) {
    if (pd.use == use && std::abs(pd.thickness_mm - mm(thickness)) < 0.001) return &pd;
  }
  return nullptr;
}

/// Moves in thousandths of an inch; a PD line in front of the first contour and the first raster of a layer, and again
/// where they change.
class SmlLayer final : public LayerMoves {
 public:
  SmlLayer(const Extruder& machine, const Layer& layer, Buffer<char>& out) : machine_(machine), layer_(layer), out_(out) {
    append(out_, fmt::format("; layer {} thickness {} mm\n", layer.index + 1, mm(layer.thickness)));
    std::string height = machine.sml.height;
    replace_all(height, "{z}", mils(std::int64_t{layer.bottom} + layer.thickness));
    append(out_, height + "\n");
    feed_per_volume_ = 1 / machine.material.mm3_of_e();
  }

  double deposit(const BeadMove& move) override {
    const bool contour = move.kind == PathKind::kOuter || move.kind == PathKind::kInner || move.kind == PathKind::kSkirt;
    if (!begun_ || contour != contour_) {
      if (const auto* pd = find_pd(machine_, layer_.thickness, contour ? "contour" : "raster")) append(out_, pd->line + "\n");
      contour_ = contour;
      moved_ = false;
    }
    begun_ = true;
    if (!moved_ || move.from != at_) {
      command(machine_.sml.travel, move.from);
      const double length =
          moved_ ? std::hypot(mm(std::int64_t{move.from.x} - at_.x), mm(std::int64_t{move.from.y} - at_.y)) : 0;
      totals_.travel_mm += length;
      totals_.seconds += length / machine_.speed.travel_mm_s;
      ++totals_.travels;
    }
    command(machine_.sml.draw, move.to);
    moved_ = true;
    at_ = move.to;
    const double length = std::hypot(mm(std::int64_t{move.to.x} - move.from.x), mm(std::int64_t{move.to.y} - move.from.y));
    totals_.deposit(move, length, feed_per_volume_);
    totals_.seconds += length / move.speed_mm_s;
    return length;
  }

  const MoveTotals& finish() override { return totals_; }

 private:
  void command(const std::string& form, Point2 at) {
    std::string text = form;
    replace_all(text, "{x}", mils(at.x + nm_of(machine_.bed.corner_mm[0])));
    replace_all(text, "{y}", mils(at.y + nm_of(machine_.bed.corner_mm[1])));
    append(out_, text + "\n");
  }

  const Extruder& machine_;
  Layer layer_;
  Buffer<char>& out_;
  MoveTotals totals_;
  double feed_per_volume_;
  bool begun_ = false, contour_ = false, moved_ = false;
  Point2 at_{};
};

class SmlFormat final : public ExtrusionFormat {
 public:
  explicit SmlFormat(const Extruder& machine) : machine_(machine) {}

  Status check(const Layer& layer) const override {
    for (const std::string_view use : {"raster", "contour"}) {
      if (find_pd(machine_, layer.thickness, use) != nullptr) continue;
      std::string known;
      for (const auto& pd : machine_.sml.pd) {
        if (pd.use == use) known += fmt::format("{}{}", known.empty() ? "" : ", ", pd.thickness_mm);
      }
      return Error{Fault::kUsage, fmt::format("layer {}: {} has no PD line for a {} of {} mm; its table has {}", layer.index,
                                              machine_.name, use, mm(layer.thickness), known.empty() ? "none" : known)};
    }
    return {};
  }
  void head(const ExtrusionHead& head, Buffer<char>& out) const override {
    append(out, fmt::format("; SML of {}\n; machine: {}\n; parts: {}\n; layers: {}\n", head.program, machine_.name, head.source,
                            head.layers));
    if (!machine_.sml.header.empty()) append(out, machine_.sml.header + (machine_.sml.header.ends_with('\n') ? "" : "\n"));
  }
  std::unique_ptr<LayerMoves> layer(const Layer& layer, std::uint32_t, Buffer<char>& out,
                                    const LayerSurroundings&) const override {
    return std::make_unique<SmlLayer>(machine_, layer, out);
  }
  double travel_seconds(double length_mm) const override { return length_mm / machine_.speed.travel_mm_s; }
  void tail(const MoveTotals& totals, std::uint32_t, Buffer<char>& out) const override {
    if (!machine_.sml.footer.empty()) append(out, machine_.sml.footer + (machine_.sml.footer.ends_with('\n') ? "" : "\n"));
    append(out, fmt::format("; bead {:.1f} mm, {:.3f} cm3\n", totals.bead_mm, totals.volume_mm3 / 1000));
  }

 private:
  const Extruder& machine_;
};

}  // namespace

std::unique_ptr<ExtrusionFormat> make_sml_format(const Extruder& machine) { return std::make_unique<SmlFormat>(machine); }

}  // namespace lamina::formats
