#include "stages/formats/gcode/write_gcode.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>

#include "stages/data/units.h"
#include "stages/formats/gcode/host_tags.h"
#include "stages/formats/gcode/slow_layer.h"
#include "stages/support/text/decimal.h"

namespace lamina::formats::gcode {
namespace {

constexpr double kWipeSpeed = 0.8;     // of a travel, as in PrusaSlicer (GCode.cpp, Wipe::wipe)
constexpr std::size_t kMaxLine = 160;  // bytes; five numbers with their letters need less

std::int64_t micrometres(std::int64_t nm) { return floor_div<std::int64_t>(nm + 500, 1000); }

char* put(char* out, std::string_view text) {
  std::memcpy(out, text.data(), text.size());
  return out + text.size();
}

std::string_view type_name(PathKind kind) {
  switch (kind) {
    case PathKind::kOuter: return "External perimeter";
    case PathKind::kInner: return "Perimeter";
    case PathKind::kSkirt: return "Skirt/Brim";
    case PathKind::kSolid: return "Solid infill";
    case PathKind::kSupport: return "Support material";
    default: return "Internal infill";
  }
}

/// That the fan is set to at the start of a layer; 0: it stays as it is. It speeds up from its first layer to full_layer.
double fan_percent(const Extruder::Fan& fan, const Switches& switches, std::uint32_t layer) {
  const std::uint32_t first = switches.fan.value_or(fan.from_layer);
  const std::uint32_t ramp = fan.full_layer > fan.from_layer ? fan.full_layer - fan.from_layer : 0;
  if (layer < first) return 0;
  const std::uint32_t step = layer - std::min(layer, fan.from_layer);
  if (layer > first && step > ramp) return 0;
  return fan.percent * (std::min(step, ramp) + 1) / (ramp + 1);
}

/// The kinds with one name are one type.
PathKind type_of(PathKind kind) { return kind == PathKind::kContour || kind == PathKind::kLink ? PathKind::kRaster : kind; }

}  // namespace

LayerWriter::LayerWriter(const Extruder& machine, const Layer& layer, std::uint32_t layers, Buffer<char>& out,
                         const Switches& switches, const LayerSurroundings& around)
    : machine_(machine),
      out_(out),
      time_(machine),
      height_(layer.thickness),
      top_(std::int64_t{layer.bottom} + layer.thickness),
      objects_(around.objects) {
  const auto& retraction = machine.retraction;
  feed_per_volume_ = 1 / machine.material.mm3_of_e();
  corner_x_ = nm_of(machine.bed.corner_mm[0]);
  corner_y_ = nm_of(machine.bed.corner_mm[1]);
  back_ = nearest(retraction.length_mm * 1e5);
  retracted_ = retraction.length_mm > 0;
  // No higher than the machine builds.
  const std::int64_t above = std::max<std::int64_t>(0, nm_of(machine.bed.build_height_mm) - top_);
  lift_ = retracted_ ? std::min(nm_of(retraction.lift_mm), above) : 0;
  lifted_ = lift_ > 0;
  if (around.region != nullptr && retraction.inside) {
    route_.emplace(*around.region, around.inset, retraction.detour_mm * 1e6);
  }
  begin_layer(layer, layers, switches);
  if (around.progress) append_progress(machine, *around.progress, out_);
}

void LayerWriter::begin_layer(const Layer& layer, std::uint32_t layers, const Switches& switches) {
  append(out_, ";LAYER_CHANGE\n;Z:");
  append_mm(out_, top_);
  append(out_, "\n;HEIGHT:");
  append_mm(out_, layer.thickness);
  append(out_, "\n");
  if (!machine_.code.relative_extrusion) append(out_, "G92 E0\n");
  move_height(top_ + lift_);
  if (layer.index == switches.temperatures) {
    const auto& m = machine_.material;
    if (m.nozzle_degc != m.first_nozzle_degc) append(out_, fmt::format("M104 S{:.0f}\n", m.nozzle_degc));
    if (m.bed_degc != m.first_bed_degc) append(out_, fmt::format("M140 S{:.0f}\n", m.bed_degc));
  }
  if (const double percent = fan_percent(machine_.fan, switches, layer.index); percent > 0) {
    append(out_, fmt::format("M106 S{:.0f}\n", percent * 2.55));
  }
  if (!machine_.code.layer.empty()) {
    append(out_, fill_code(machine_.code.layer, machine_, layers, layer.index, mm(top_)));
  }
  time_.move({0, 0, mm(layer.thickness + lift_), 0}, machine_.speed.lift_mm_s);
}

/// height  nm
void LayerWriter::move_height(std::int64_t height) {
  append_written(out_, kMaxLine, [&](char* text) {
    text = put_fixed<3>(micrometres(height), put(text, "G1 Z"));
    text = put_fixed<0>(nearest(machine_.speed.lift_mm_s * 60), put(text, " F"));
    *text++ = '\n';
    return text;
  });
  feed_rate_ = -1;
}

/// Moves the filament alone. from, to  mm of filament in this layer, 1e-5 mm
void LayerWriter::move_filament(std::int64_t from, std::int64_t to) {
  append_written(out_, kMaxLine, [&](char* text) {
    text = put_fixed<5>(machine_.code.relative_extrusion ? to - from : to, put(text, "G1 E"));
    feed_rate_ = nearest(machine_.retraction.speed_mm_s * 60);
    text = put_fixed<0>(feed_rate_, put(text, " F"));
    *text++ = '\n';
    return text;
  });
  time_.move({0, 0, 0, static_cast<double>(to - from) * 1e-5}, machine_.retraction.speed_mm_s);
}

/// Draws the filament back: as much of it along the bead as the bead is as long as the wipe, the rest before.
void LayerWriter::retract() {
  const double wipe_mm = machine_.retraction.wipe_mm;
  const double way = wipe_mm > 0 ? trail_.back(wipe_mm, [](Point2, double) {}) : 0;
  const std::int64_t along = way > 0 ? drawn_after(way) : 0;
  if (along < back_ || !(way > 0)) move_filament(written_, written_ - (back_ - along));
  if (way > 0) wipe(written_ - (back_ - along));
  ++totals_.retractions;
  retracted_ = true;
}

/// Raises the nozzle over the layer.
void LayerWriter::lift() {
  if (lift_ == 0 || lifted_) return;
  move_height(top_ + lift_);
  time_.move({0, 0, mm(lift_), 0}, machine_.speed.lift_mm_s);
  lifted_ = true;
}

/// Filament drawn back over so many mm of a wipe, 1e-5 mm.
std::int64_t LayerWriter::drawn_after(double way_mm) const {
  return nearest(static_cast<double>(back_) * std::min(1.0, way_mm / machine_.retraction.wipe_mm));
}

/// Moves back along the bead and draws the filament back. from  where the filament is, 1e-5 mm. The filament is no faster than
/// in a retraction.
void LayerWriter::wipe(std::int64_t from) {
  const auto& retraction = machine_.retraction;
  const double speed = std::max(0.1, std::min(kWipeSpeed * machine_.speed.travel_mm_s,
                                              retraction.wipe_mm / retraction.length_mm * retraction.speed_mm_s));
  std::int64_t drawn = 0;
  double way = 0;
  trail_.back(retraction.wipe_mm, [&](Point2 to, double length) {
    way += length;
    const std::int64_t now = drawn_after(way), step = now - drawn;
    append_written(out_, kMaxLine, [&](char* text) {
      text = put_fixed<3>(micrometres(to.x + corner_x_), put(text, "G1 X"));
      text = put_fixed<3>(micrometres(to.y + corner_y_), put(text, " Y"));
      text = put_fixed<5>(machine_.code.relative_extrusion ? -step : from - now, put(text, " E"));
      const std::int64_t rate = std::max<std::int64_t>(1, nearest(speed * 60));
      if (rate != feed_rate_) text = put_fixed<0>(feed_rate_ = rate, put(text, " F"));
      *text++ = '\n';
      return text;
    });
    time_.move({mm(std::int64_t{to.x} - at_.x), mm(std::int64_t{to.y} - at_.y), 0, static_cast<double>(-step) * 1e-5}, speed);
    totals_.travel_mm += length;
    drawn = now;
    at_ = to;
  });
}

/// Feeds again what was drawn back.
void LayerWriter::prime() {
  if (lifted_) {
    move_height(top_);
    time_.move({0, 0, -mm(lift_), 0}, machine_.speed.lift_mm_s);
    lifted_ = false;
  }
  // Absolute counting starts a layer at 0 with the filament drawn back.
  if (!machine_.code.relative_extrusion && kind_ < 0) {
    fed_ = static_cast<double>(back_) * 1e-5;
    written_ = back_;
  }
  move_filament(written_ - back_, written_);
  retracted_ = false;
}

void LayerWriter::extrude_to(double filament_mm, char*& text) {
  fed_ += filament_mm;
  const std::int64_t now = nearest(fed_ * 1e5);
  text = put_fixed<5>(machine_.code.relative_extrusion ? now - written_ : now, put(text, " E"));
  written_ = now;
}

void LayerWriter::tags(const BeadMove& move) {
  if (const int type = static_cast<int>(type_of(move.kind)); type != kind_) {
    kind_ = type;
    append(out_, ";TYPE:");
    append(out_, type_name(move.kind));
    append(out_, "\n");
  }
  if (move.width != width_) {
    width_ = move.width;
    append_written(out_, kMaxLine, [&](char* text) {
      text = put_fixed<3>(micrometres(move.width), put(text, ";WIDTH:"));
      text = put_fixed<3>(micrometres(height_), put(text, "\n; tool H"));
      text = put_fixed<3>(micrometres(move.width), put(text, " W"));
      *text++ = '\n';
      return text;
    });
  }
}

/// Whether the travel to a point needs no retraction, as its points in the file do not cross a contour. They are line_ then.
bool LayerWriter::stays_inside(Point2 to) {
  if (!route_) return false;
  const auto written = [](Nm at, std::int64_t corner) { return static_cast<Nm>(1000 * micrometres(at + corner) - corner); };
  const auto as_written = [&](Point2 p) { return Point2{written(p.x, corner_x_), written(p.y, corner_y_)}; };
  line_ = route_->find(as_written(at_), as_written(to));
  if (line_.empty()) return false;
  line_.back() = to;
  return true;
}

void LayerWriter::travel(Point2 to) {
  const double dx = mm(std::int64_t{to.x} - at_.x), dy = mm(std::int64_t{to.y} - at_.y);
  const auto& retraction = machine_.retraction;
  const bool may_retract = !retracted_ && retraction.length_mm > 0 && placed_ && std::hypot(dx, dy) >= retraction.min_travel_mm;
  line_.clear();
  if (may_retract && !stays_inside(to)) {
    retract();
    lift();
  }
  if (line_.empty()) line_.push_back(to);
  for (const Point2 p : line_) travel_line(p);
  ++totals_.travels;
  trail_.restart(to);
  placed_ = true;
}

void LayerWriter::begin_object(std::uint32_t object) {
  if (objects_.empty() || object_ == object) return;
  end_object();
  object_ = object;
  append_object_tag(machine_, objects_, object, true, out_);
}

/// An object begins and ends with the filament drawn back, so that it can be left out.
void LayerWriter::end_object() {
  if (!retracted_ && machine_.retraction.length_mm > 0) {
    retract();
    lift();
  }
  if (object_ >= 0) append_object_tag(machine_, objects_, static_cast<std::uint32_t>(object_), false, out_);
  object_ = -1;
}

void LayerWriter::travel_line(Point2 to) {
  append_written(out_, kMaxLine, [&](char* text) {
    text = put_fixed<3>(micrometres(to.x + corner_x_), put(text, "G0 X"));
    text = put_fixed<3>(micrometres(to.y + corner_y_), put(text, " Y"));
    const std::int64_t rate = nearest(machine_.speed.travel_mm_s * 60);
    if (rate != feed_rate_) text = put_fixed<0>(feed_rate_ = rate, put(text, " F"));
    *text++ = '\n';
    return text;
  });
  const double dx = mm(std::int64_t{to.x} - at_.x), dy = mm(std::int64_t{to.y} - at_.y);
  const double length = placed_ ? std::hypot(dx, dy) : 0;
  if (length > 0) {
    time_.move({dx, dy, 0, 0}, machine_.speed.travel_mm_s);
    totals_.travel_mm += length;
  }
  at_ = to;
}

double LayerWriter::deposit(const BeadMove& move) {
  if (!placed_ || move.from != at_) travel(move.from);
  if (retracted_) prime();
  tags(move);
  const double dx = mm(std::int64_t{move.to.x} - move.from.x), dy = mm(std::int64_t{move.to.y} - move.from.y);
  const double length = length_of(move);
  const double volume = length * move.area_mm2;
  append_written(out_, kMaxLine, [&](char* text) {
    text = put_fixed<3>(micrometres(move.to.x + corner_x_), put(text, "G1 X"));
    text = put_fixed<3>(micrometres(move.to.y + corner_y_), put(text, " Y"));
    extrude_to(volume * feed_per_volume_, text);
    const std::int64_t rate = std::max<std::int64_t>(1, nearest(move.speed_mm_s * 60));
    if (rate != feed_rate_) text = put_fixed<0>(feed_rate_ = rate, put(text, " F"));
    *text++ = '\n';
    return text;
  });
  totals_.deposit(move, length, feed_per_volume_);
  time_.move({dx, dy, 0, volume * feed_per_volume_}, move.speed_mm_s);
  at_ = move.to;
  trail_.add(at_);
  return length;
}

const MoveTotals& LayerWriter::finish() {
  if (!retracted_ && machine_.retraction.length_mm > 0) retract();
  if (object_ >= 0) end_object();
  if (totals_.moves > 0) totals_.last = at_;
  totals_.seconds = time_.halt();
  return totals_;
}

std::string fill_code(const std::string& code, const Extruder& machine, std::uint32_t layers, std::uint32_t layer,
                      double z_mm) {
  const auto& m = machine.material;
  const std::pair<std::string_view, double> values[] = {{"{nozzle_degc}", m.nozzle_degc},
                                                        {"{bed_degc}", m.bed_degc},
                                                        {"{first_nozzle_degc}", m.first_nozzle_degc},
                                                        {"{first_bed_degc}", m.first_bed_degc},
                                                        {"{layers}", layers},
                                                        {"{layer}", layer},
                                                        {"{z}", z_mm}};
  std::string text = code;
  for (const auto& [name, value] : values) {
    for (std::size_t at = 0; (at = text.find(name, at)) != std::string::npos;) {
      text.replace(at, name.size(), fmt::format("{}", value));
    }
  }
  if (!text.empty() && text.back() != '\n') text += '\n';
  return text;
}

namespace {

/// The acceleration of beads and travels, as each firmware takes it: M204 P and T of Marlin (marlinfw.org, M204) and
/// RepRapFirmware (docs.duet3d.com, M204), M204 S of Klipper (Klipper3d/klipper, docs/G-Codes.md). M204 of Repetier sets
/// temperatures: there they are M201 and M202 (repetier/Repetier-Firmware, Repetier.ino).
std::string acceleration_code(const Extruder& machine) {
  const double value = machine.speed.acceleration_mm_s2;
  const std::string& flavor = machine.code.flavor;
  if (!machine.speed.states_acceleration) return {};
  if (flavor == "Klipper") return fmt::format("M204 S{}\n", value);
  if (flavor == "Repetier") return fmt::format("M201 X{0} Y{0}\nM202 X{0} Y{0}\n", value);
  return fmt::format("M204 P{0} T{0}\n", value);
}

}  // namespace

void append_head(const Extruder& machine, const ExtrusionHead& facts, Buffer<char>& out) {
  // PrusaSlicer's viewer reads ;WIDTH: in its own files only; of others it knows Simplify3D's tag.
  append(out, fmt::format("; generated by {}\n; \"tool\" lines state widths as in G-Code generated by Simplify3D(R)\n"
                          "; machine: {}\n; parts: {}\n; layers: {}\n;FLAVOR:{}\n",
                          facts.program, machine.name, facts.source, facts.layers, machine.code.flavor));
  append(out, facts.thumbnail);
  append(out, fill_code(machine.code.start, machine, facts.layers, 0, 0));
  append_objects(machine, facts.objects, out);
  if (machine.code.progress && machine.code.flavor == "Klipper") {
    append(out, fmt::format("SET_PRINT_STATS_INFO TOTAL_LAYER={}\n", facts.layers));
  }
  append(out, "G21 ; millimetres\nG90 ; absolute positions\n");
  append(out, machine.code.relative_extrusion ? "M83 ; relative extrusion\n" : "M82 ; absolute extrusion\n");
  append(out, "G92 E0\n");
  append(out, acceleration_code(machine));
  if (facts.segmented && !machine.code.plain_pressure.empty()) {
    append(out, fill_code(machine.code.plain_pressure, machine, facts.layers, 0, 0));
  }
  if (machine.retraction.length_mm > 0) {
    const double length = machine.retraction.length_mm;
    append(out, fmt::format("G1 E{} F{:.0f} ; every layer begins with the filament drawn back\n", -length,
                            machine.retraction.speed_mm_s * 60));
  }
}

std::string time_text(double seconds) {
  const std::int64_t whole = nearest(seconds);
  std::string text;
  if (whole >= 86'400) text += fmt::format("{}d ", whole / 86'400);
  if (whole >= 3600) text += fmt::format("{}h ", whole / 3600 % 24);
  if (whole >= 60) text += fmt::format("{}m ", whole / 60 % 60);
  return text + fmt::format("{}s", whole % 60);
}

void append_tail(const Extruder& machine, const MoveTotals& totals, std::uint32_t layers, Buffer<char>& out) {
  if (machine.code.progress) append(out, "M73 P100 R0\n");
  append(out, fill_code(machine.code.end, machine, layers, layers == 0 ? 0 : layers - 1, 0));
  const FilamentUse use = filament_use(totals, machine);
  append(out,
         fmt::format("; filament used [mm] = {:.2f}\n; filament used [cm3] = {:.2f}\n; filament used [g] = {:.2f}\n"
                     "; filament_density = {}\n; estimated printing time (normal mode) = {}\n",
                     totals.filament_mm, use.mm3 / 1000, use.grams, machine.material.density_g_cm3, time_text(totals.seconds)));
}

namespace {

class GcodeFormat final : public ExtrusionFormat {
 public:
  GcodeFormat(const Extruder& machine, const Switches& switches) : machine_(machine), switches_(switches) {}
  Status check(const Layer& layer) const override {
    if (mm(layer.thickness) <= machine_.material.nozzle_mm) return {};
    return Error{Fault::kUsage, fmt::format("layer {}: {} mm is thicker than the nozzle of {} mm is wide; take thinner layers",
                                            layer.index, mm(layer.thickness), machine_.material.nozzle_mm)};
  }
  void head(const ExtrusionHead& head, Buffer<char>& out) const override { append_head(machine_, head, out); }
  std::unique_ptr<LayerMoves> layer(const Layer& layer, std::uint32_t layers, Buffer<char>& out,
                                    const LayerSurroundings& around) const override {
    if (machine_.fan.min_layer_s > 0) {
      return std::make_unique<SlowLayer>(machine_, layer, layers, out, switches_, around);
    }
    return std::make_unique<LayerWriter>(machine_, layer, layers, out, switches_, around);
  }
  void tail(const MoveTotals& totals, std::uint32_t layers, Buffer<char>& out) const override {
    append_tail(machine_, totals, layers, out);
  }
  double travel_seconds(double length_mm) const override {
    return rest_to_rest(length_mm, machine_.speed.travel_mm_s, machine_.speed.acceleration_mm_s2);
  }

 private:
  const Extruder& machine_;
  Switches switches_;
};

}  // namespace
}  // namespace lamina::formats::gcode

namespace lamina::formats {
std::unique_ptr<ExtrusionFormat> make_gcode_format(const Extruder& machine, const Switches& switches) {
  return std::make_unique<gcode::GcodeFormat>(machine, switches);
}
}  // namespace lamina::formats
