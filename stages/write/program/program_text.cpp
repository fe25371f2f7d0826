#include "stages/write/program/program_text.h"

namespace lamina::write {

void put_powder_cycle(const Machine& machine, const LayerCycle& cycle, ProgramBytes& out) {
  const auto& powder = machine.powder;
  const auto mm_of = [](std::int64_t nm) { return static_cast<double>(nm) / kNmPerMm; };
  const std::string vat_speed = feed_text(powder.vat_speed_mm_s), roller_speed = feed_text(powder.roller_speed_mm_s);
  put(out, "G1 {}{} F{}\n", powder.build_axis, mm_text(powder.build_sign * mm_of(cycle.bottom_nm + cycle.thickness_nm)),
      vat_speed);
  put(out, "G91\n");
  for (const std::uint32_t vat : cycle.feeds) {
    put(out, "G1 {}{} F{}\n", powder.feed_axes[vat],
        mm_text(powder.feed_sign * powder.dose * mm_of(cycle.thickness_nm) / static_cast<double>(cycle.feeds.size())),
        vat_speed);
  }
  put(out, "G90\nG1 {}{} F{}\n", powder.roller_axis, mm_text(powder.roller_mm[1]), roller_speed);
  put(out, "G1 {}{} F{}\n", powder.roller_axis, mm_text(powder.roller_mm[0]), roller_speed);
}

}  // namespace lamina::write
