#include "stages/program/program_text.h"

namespace lamina::program {
namespace {

/// The build vat goes to the depth of a layer, the vats feed it, the roller spreads and returns.
void put_spread(const Machine& machine, const LayerCycle& cycle, std::int64_t bottom_nm, std::int64_t thickness_nm,
                ProgramBytes& out) {
  const auto& powder = machine.powder;
  const std::string vat_speed = feed_text(powder.vat_speed_mm_s), roller_speed = feed_text(powder.roller_speed_mm_s);
  put(out, "G1 {}{} F{}\n", powder.build_axis, mm_text(powder.build_sign * mm(bottom_nm + thickness_nm)), vat_speed);
  put(out, "G91\n");
  for (const std::uint32_t vat : cycle.feeds) {
    put(out, "G1 {}{} F{}\n", powder.feed_axes[vat],
        mm_text(powder.feed_sign * powder.dose * mm(thickness_nm) / static_cast<double>(cycle.feeds.size())), vat_speed);
  }
  put(out, "G90\n");
  if (powder.roller_rpm > 0) put(out, "M4 S{}\n", plain_text(powder.roller_rpm, kPlainDigits));
  put(out, "G1 {}{} F{}\n", powder.roller_axis, mm_text(powder.roller_mm[1]), roller_speed);
  if (powder.roller_rpm > 0) put(out, "M5\n");
  put(out, "G1 {}{} F{}\n", powder.roller_axis, mm_text(powder.roller_mm[0]), roller_speed);
}

}  // namespace

void put_base_zero(const Machine& machine, ProgramBytes& out) {
  const auto& powder = machine.powder;
  if (powder.base_layers > 0) put(out, "G92 {}{}\n", powder.build_axis, mm_text(-powder.build_sign * powder.base_mm()));
}

void put_powder_cycle(const Machine& machine, const LayerCycle& cycle, ProgramBytes& out) {
  for_each_spread(machine, cycle, [&](std::int64_t bottom_nm, std::int64_t thickness_nm) {
    put_spread(machine, cycle, bottom_nm, thickness_nm, out);
  });
}

}  // namespace lamina::program
