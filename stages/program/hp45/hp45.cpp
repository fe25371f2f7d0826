#include "stages/program/hp45/hp45.h"

#include "stages/program/care/care.h"
#include "stages/program/hp45/head.h"

namespace lamina::write::hp45 {
namespace {

constexpr CareWords kCare{"G1", Head::spit, Head::kWait, "", "", 1};

class Writer final : public ProgramWriter {
 public:
  Writer(const Machine& machine, const HeadGrid& grid) : machine_(machine), head_(machine, grid), care_(machine, kCare) {}

  void start(std::uint32_t, ProgramBytes& out) override {
    put(out, "G21\nG90\n");
    put_base_zero(machine_, out);
  }
  void begin_layer(const LayerCycle& cycle, ProgramBytes& out) override {
    head_.settings(out);
    put_powder_cycle(machine_, cycle, out);
    care_.begin_layer(cycle, out);
  }
  void sweep(const Sweep& sweep, const SweepVectors& vectors, ProgramBytes& out) override {
    head_.sweep(sweep, vectors, care_, out);
  }
  void end_layer(const LayerCycle&, ProgramBytes& out) override {
    put(out, "G1 {}{} {}{} F{}\n", machine_.motion.x_axis, mm_text(machine_.motion.safe_mm[0]), machine_.motion.y_axis,
        mm_text(machine_.motion.safe_mm[1]), feed_text(machine_.motion.travel_speed_mm_s));
    Head::wait(out);
    put(out, "BRL\n");
  }
  void end(ProgramBytes& out) override { put(out, "BCL\n"); }

 private:
  const Machine& machine_;
  Head head_;
  Care care_;
};

}  // namespace

std::unique_ptr<ProgramWriter> make_writer(const Machine& machine, const HeadGrid& grid) {
  return std::make_unique<Writer>(machine, grid);
}

}  // namespace lamina::write::hp45
