#include "stages/formats/gcode/host_tags.h"

#include <fmt/format.h>

#include "stages/support/text/decimal.h"

namespace lamina::formats::gcode {

void append_objects(const Extruder& machine, std::span<const ExtrusionObject> objects, Buffer<char>& out) {
  if (objects.empty()) return;
  const bool klipper = machine.code.objects == "klipper", named = machine.code.flavor == "RepRap";
  if (!klipper) append(out, fmt::format("M486 T{}\n", objects.size()));
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const ExtrusionObject& of = objects[i];
    const double x0 = mm(of.lo[0]) + machine.bed.corner_mm[0], y0 = mm(of.lo[1]) + machine.bed.corner_mm[1];
    const double x1 = mm(of.hi[0]) + machine.bed.corner_mm[0], y1 = mm(of.hi[1]) + machine.bed.corner_mm[1];
    if (klipper) {
      append(out,
             fmt::format("EXCLUDE_OBJECT_DEFINE NAME={0} CENTER={1:.3f},{2:.3f} POLYGON=[[{3:.3f},{4:.3f}],[{5:.3f},{4:.3f}],"
                         "[{5:.3f},{6:.3f}],[{3:.3f},{6:.3f}]]\n",
                         of.name, (x0 + x1) / 2, (y0 + y1) / 2, x0, y0, x1, y1));
    } else if (named) {
      append(out, fmt::format("M486 S{} A\"{}\"\n", i, of.name));
    } else {
      append(out, fmt::format("; object {}: {}\n", i, of.name));
    }
  }
  if (!klipper && named) append(out, "M486 S-1\n");
}

void append_object_tag(const Extruder& machine, std::span<const ExtrusionObject> objects, std::uint32_t object, bool begins,
                       Buffer<char>& out) {
  if (machine.code.objects == "klipper") {
    append(out, fmt::format("EXCLUDE_OBJECT_{} NAME={}\n", begins ? "START" : "END", objects[object].name));
  } else {
    append(out, begins ? fmt::format("M486 S{}\n", object) : "M486 S-1\n");
  }
}

void append_progress(const Extruder& machine, const LayerSurroundings::Progress& progress, Buffer<char>& out) {
  append(out, fmt::format("M73 P{} R{}\n", progress.percent, progress.minutes));
  if (machine.code.flavor == "Klipper") append(out, fmt::format("SET_PRINT_STATS_INFO CURRENT_LAYER={}\n", progress.layer));
}

}  // namespace lamina::formats::gcode
