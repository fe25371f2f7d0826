#include <fmt/format.h>

#include "stages/program/hp45/hp45.h"
#include "stages/program/maintenance.h"
#include "stages/program/program_text.h"
#include "stages/program/writers.h"

namespace lamina::program::oasis {
namespace {

// SerialGRBL.py: how far pistons go down before they come up, and how far they stay below the spreader's way afterwards.
constexpr double kHysteresisMm = 1, kClearanceMm = 0.25;
// Where homing leaves the gantry.
constexpr MachinePoint kHomeMm = {5, 245};

constexpr MaintenanceWords kMaintenance{"G1", hp45::Head::spit, hp45::Head::kWait, "; fill the vat, then resume\nM0\n", "G4 P",
                                        1};

class OasisWriter final : public ProgramWriter {
 public:
  OasisWriter(const Machine& machine, const HeadGrid& grid)
      : machine_(machine), head_(machine, grid), maintenance_(machine, kMaintenance) {}

  void start(std::uint32_t, ProgramBytes& out) override {
    const auto& motion = machine_.motion;
    put(out, "$h\nG92 {}{} {}{}\n", motion.x_axis, mm_text(kHomeMm[0]), motion.y_axis, mm_text(kHomeMm[1]));
    put(out, "G21\nG90\nG92 {}0 {}0\n", machine_.powder.build_axis, machine_.powder.feed_axes[0]);
    put_base_zero(machine_, out);
    go(motion.safe_mm, out);
  }
  void begin_layer(const LayerCycle& cycle, ProgramBytes& out) override;
  void sweep(const Sweep& sweep, const SweepVectors& vectors, ProgramBytes& out) override {
    head_.sweep(sweep, vectors, maintenance_, out);
  }
  void end_layer(const LayerCycle&, ProgramBytes& out) override {
    maintenance_.dry(out);
    go(machine_.motion.safe_mm, out);
    hp45::Head::wait(out);
    put(out, "BRL\n");
  }
  void end(ProgramBytes& out) override {
    put(out, "BCL\n");
    go(kHomeMm, out);
  }

 private:
  void go(MachinePoint to, ProgramBytes& out) const { put_move(machine_, "G1", to, machine_.motion.travel_speed_mm_s, out); }
  void build_to(double depth_mm, ProgramBytes& out) const {
    put(out, "G1 {}{} F{}\n", machine_.powder.build_axis, mm_text(machine_.powder.build_sign * depth_mm),
        feed_text(machine_.powder.vat_speed_mm_s));
  }
  void feed_by(double up_mm, ProgramBytes& out) const {
    put(out, "G1 {}{} F{}\n", machine_.powder.feed_axes[0], mm_text(machine_.powder.feed_sign * up_mm),
        feed_text(machine_.powder.vat_speed_mm_s));
  }
  void spread(std::int64_t bottom_nm, std::int64_t thickness_nm, ProgramBytes& out) const;

  const Machine& machine_;
  hp45::Head head_;
  MaintenanceWriter maintenance_;
};

void OasisWriter::begin_layer(const LayerCycle& cycle, ProgramBytes& out) {
  head_.settings(out);
  maintenance_.refill(cycle, out);
  bool again = false;
  for_each_spread(machine_, cycle, [&](std::int64_t bottom_nm, std::int64_t thickness_nm) {
    if (again) go(machine_.motion.safe_mm, out);  // where spreading begins
    again = true;
    spread(bottom_nm, thickness_nm, out);
  });
  hp45::Head::wait(out);
  maintenance_.begin_layer(cycle, out);
}

// SerialGRBL.py, NewLayer, from the back, where each layer ends: pistons to their places, the spreader to the front, pistons
// down clear. The build piston's places are absolute here, so that a layer does not depend on those before it.
void OasisWriter::spread(std::int64_t bottom_nm, std::int64_t thickness_nm, ProgramBytes& out) const {
  const auto& powder = machine_.powder;
  const double bottom = mm(bottom_nm), top = mm(bottom_nm + thickness_nm);
  build_to(bottom + kHysteresisMm, out);
  build_to(top - kClearanceMm, out);
  put(out, "G91\n");
  feed_by(-kHysteresisMm, out);
  feed_by(powder.dose * mm(thickness_nm) + kClearanceMm + kHysteresisMm, out);
  put(out, "G90\nM4{}\n", powder.roller_rpm > 0 ? " S" + plain_text(powder.roller_rpm, kPlainDigits) : "");
  put(out, "G1 {}{} F{}\nM5\n", powder.roller_axis, mm_text(powder.roller_mm[1]), feed_text(powder.roller_speed_mm_s));
  build_to(top - kClearanceMm + kHysteresisMm, out);
  build_to(top, out);
  put(out, "G91\n");
  feed_by(-kHysteresisMm, out);
  feed_by(kHysteresisMm - kClearanceMm, out);
  put(out, "G90\n");
  if (powder.roller_axis != machine_.motion.x_axis && powder.roller_axis != machine_.motion.y_axis) {  // not on the gantry
    put(out, "G1 {}{} F{}\n", powder.roller_axis, mm_text(powder.roller_mm[0]), feed_text(powder.roller_speed_mm_s));
  }
}

}  // namespace

Status check(const Machine& machine, const HeadGrid& grid) {
  const auto& powder = machine.powder;
  if (powder.vats != 1) return wrong_key(machine, "powder.vats", "Oasis has one feed piston; give 1");
  const auto& motion = machine.motion;
  const bool x = powder.roller_axis == motion.x_axis, y = powder.roller_axis == motion.y_axis;
  if (const double waits = motion.safe_mm[x ? 0 : 1]; (x || y) && waits != powder.roller_mm[0]) {
    return wrong_key(machine, "powder.roller_mm",
                     fmt::format("the spreader on the gantry starts at {:g} mm, and the gantry waits at {:g} (motion.safe_mm); "
                                 "give the same",
                                 powder.roller_mm[0], waits));
  }
  return hp45::check(machine, grid);
}

std::unique_ptr<ProgramWriter> make_writer(const Machine& machine, const HeadGrid& grid) {
  return std::make_unique<OasisWriter>(machine, grid);
}

}  // namespace lamina::program::oasis
