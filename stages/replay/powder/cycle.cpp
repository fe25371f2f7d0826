// The powder of a layer: the order and the places of roller, vats and head. What is wrong is told by check_cycle alone, which
// knows the layer's heights for true.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "stages/replay/printing.h"

namespace lamina::replay {

void Printing::wrong_cycle(std::string_view what) { fail(fmt::format("layer {}, powder cycle: {}", layer_.index, what)); }

void Printing::wrong_powder(std::string what) {
  if (spread_wrong_.empty()) spread_wrong_ = std::move(what);
}

bool Printing::roller_on_gantry() const {
  const auto& [powder, motion] = std::tie(profile().powder, profile().motion);
  return powder.roller_axis == motion.x_axis || powder.roller_axis == motion.y_axis;
}

bool Printing::roller_at_home() const { return std::abs(roller_mm_ - profile().powder.roller_mm[0]) < 1e-3; }

bool Printing::head_at_safe() const {
  const auto& safe = profile().motion.safe_mm;
  const auto [x, y] = head_mm_.value_or(safe);
  return std::hypot(x - safe[0], y - safe[1]) < 1e-3;
}

void Printing::check_way(Part part, double mm_s) {
  const auto& powder = profile().powder;
  const bool gantry = roller_on_gantry();
  const auto at_roller = [&] {
    return fmt::format("while the roller is at {:g} mm, not at {:g}", roller_mm_, powder.roller_mm[0]);
  };
  if (part == Part::kHead) {
    if (!gantry && !roller_at_home()) wrong_powder(fmt::format("the head moves {}", at_roller()));
    return;
  }
  const bool roller = part == Part::kRoller;
  if (roller && !head_at_safe()) {
    wrong_powder(fmt::format("the roller moves while the head is at {:g}, {:g} mm, not at its safe place", (*head_mm_)[0],
                             (*head_mm_)[1]));
  }
  // Oasis lowers its pistons before the spreader goes back.
  if (!roller && profile().dialect != "oasis" && !roller_at_home() && !(gantry && head_at_safe())) {
    wrong_powder(fmt::format("a vat moves {}", at_roller()));
  }
  const double speed = roller ? powder.roller_speed_mm_s : powder.vat_speed_mm_s;
  if (std::abs(mm_s - speed) < 1.01 * kHalfMmPerMinute) return;
  wrong_powder(fmt::format("{} moves at {:g} mm/s where {:g} have to be", roller ? "the roller" : "a vat", mm_s, speed));
}

void Printing::check_spread() {
  const std::string& dialect = profile().dialect;
  if (dialect == "raw" || dialect == "planes") return;
  if (!rolled_) return wrong_powder("the first sweep begins before powder is spread");
  const double top = mm(std::int64_t{layer_.bottom} + layer_.thickness);
  if (dialect == "brundlefab" || std::abs(count.build_mm - top) < 1e-3) return;  // its bins give way to the carriage
  wrong_powder(fmt::format("a sweep begins with the build vat at {:g} mm where {:g} have to be", count.build_mm, top));
}

void Printing::feeds(std::uint32_t vat, double mm, double mm_s) {
  count.fed_mm[vat] += mm;
  if (mm > 0) count.vats |= 1u << vat;
  tells_powder_ = true;
  takes(std::abs(mm) / mm_s);
}

void Printing::build_vat_stands_at(double mm) {
  count.moves = tells_powder_ = true;
  count.build_mm = mm * profile().powder.build_sign;
}

void Printing::build_vat_goes_down(double mm) {
  count.moves = tells_powder_ = true;
  lowered_mm_ = mm;
}

void Printing::roller_stands_at(double mm, bool may_spread) {
  tells_powder_ = true;
  const double far = profile().powder.roller_mm[1];
  const bool comes = std::abs(roller_mm_ - far) >= 1e-3 || std::abs(profile().powder.roller_mm[0] - far) < 1e-3;
  if (may_spread && std::abs(mm - far) < 1e-3 && comes)
    strokes(count.moves ? count.build_mm : lamina::mm(layer_.bottom) - base_mm(), count.fed_mm[0] + count.fed_mm[1]);
  rolled_ = rolled_ || strokes_ > base_layers();
  const double home = profile().powder.roller_mm[0];
  if (rpm_ != 0 && std::abs(mm - home) < 1e-3 && std::abs(roller_mm_ - home) >= 1e-3) {
    wrong_powder(fmt::format("the roller returns with {:g} turns a minute, and has to stand still", rpm_));
  }
  roller_mm_ = mm;
}

void Printing::strokes(double build_mm, double fed_mm) {
  const auto& powder = profile().powder;
  ++strokes_;
  if (powder.roller_rpm > 0 && std::abs(rpm_ - powder.roller_rpm) > 1e-3) {
    wrong_powder(fmt::format("the roller spreads with {:g} turns a minute where {:g} have to be", rpm_, powder.roller_rpm));
  }
  if (profile().dialect == "oasis") return;  // whose reader sees where it turns
  if (strokes_ > base_layers() + 1) {
    if (!roller_on_gantry()) wrong_powder("the roller spreads once more than the layer needs");
    return;
  }
  const bool base = strokes_ <= base_layers();
  const double above = base ? base_mm() - strokes_ * powder.base_layer_mm : -mm(layer_.thickness);  // still to be spread
  const double build = mm(layer_.bottom) - above, fed = powder.dose * (base_mm() - above);
  if (std::abs(build_mm - build) > 1e-3 || std::abs(fed_mm - fed) > 1e-3 * strokes_) {
    wrong_powder(fmt::format("{} is spread with the build vat at {:g} mm and {:g} mm fed, not {:g} and {:g}",
                             base ? fmt::format("layer {} of the base", strokes_) : "powder", build_mm, fed_mm, build, fed));
  }
}

void Printing::spreads(double build_mm, double fed_mm, double clearance_mm) {
  const auto& powder = profile().powder;
  const bool base = strokes_ < base_layers();
  const double height = base ? (strokes_ + 1) * powder.base_layer_mm : base_mm() + mm(layer_.thickness);
  const double build = build_mm * powder.build_sign, top = mm(layer_.bottom) - base_mm() + height - clearance_mm;
  const double fed = powder.dose * height + clearance_mm;
  if (std::abs(build - top) > 1e-3) {
    wrong_powder(fmt::format("powder is spread with the build vat at {:g} mm where {:g} have to be", build, top));
  } else if (std::abs(fed_mm - fed) > 1e-3) {
    wrong_powder(fmt::format("powder is spread with {:g} mm fed where {:g} have to be", fed_mm, fed));
  }
}

// SerialGRBL.py, NewLayer, takes it 1 mm down before a layer, which a thicker one's place lies below.
void Printing::pistons_came(double build_mm, double feed_mm) {
  constexpr double kThickMm = 1.25;
  const auto& powder = profile().powder;
  const double height = strokes_ < base_layers() ? powder.base_layer_mm : mm(layer_.thickness);
  const bool build = build_mm * powder.build_sign < 0 || height >= kThickMm;
  if (build && feed_mm * powder.feed_sign > 0) return;
  wrong_powder(fmt::format("the {} piston comes to its place from above, and has play", build ? "feed" : "build"));
}

void Printing::check_cycle() {
  const auto& powder = profile().powder;
  const Layer& layer = layer_;
  const auto wrong = [&](const std::string& what) { wrong_cycle(what); };
  if (const Standing next = standing(); head_mm_ && std::hypot((*head_mm_)[0] - next.x_mm, (*head_mm_)[1] - next.y_mm) > 1e-3) {
    wrong(fmt::format("the head stays at {:g}, {:g} mm, and the next layer finds it at {:g}, {:g}", (*head_mm_)[0],
                      (*head_mm_)[1], next.x_mm, next.y_mm));
  }
  if (lowered_mm_) count.build_mm = mm(layer.bottom) + *lowered_mm_;
  if (profile().dialect == "raw" || profile().dialect == "planes") {  // the head alone
    if (!spread_wrong_.empty()) wrong(spread_wrong_);
    return check_told();
  }
  if (!count.moves) return wrong("the build vat does not move");
  if (!rolled_) wrong(fmt::format("the roller does not reach its far end at {:g} mm", powder.roller_mm[1]));
  if (!spread_wrong_.empty()) return wrong(spread_wrong_);
  // Numbers are written to a tenth of a micrometre.
  if (const double top = mm(std::int64_t{layer.bottom} + layer.thickness); std::abs(count.build_mm - top) > 1e-3) {
    wrong(fmt::format("the build vat stands at {:g} mm where {:g} have to", count.build_mm, top));
  }
  const double fed = count.fed_mm[0] + count.fed_mm[1], dose = powder.dose * (mm(layer.thickness) + base_mm());
  if (std::abs(fed - dose) > 1e-3 * (1 + base_layers())) wrong(fmt::format("{:g} mm are fed where {:g} have to", fed, dose));
  check_pauses();
  if (rpm_ != 0) wrong(fmt::format("the roller still makes {:g} turns a minute when the layer ends", rpm_));
  if (std::abs(roller_mm_ - powder.roller_mm[0]) > 1e-3) {
    wrong(fmt::format("the roller stays at {:g} mm, not at {:g}", roller_mm_, powder.roller_mm[0]));
  }
}

}  // namespace lamina::replay
