// stages/replay/machine.h: a virtual machine that carries out print programs and shows what they print.
//
// It shares nothing with the compiler but the profile: it reads the text of each dialect with parsers of its own, computes
// from pitch, angle and offsets where each nozzle is when it fires, and puts the drop on the pixel that is nearest.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "stages/data/layer.h"
#include "stages/data/machine.h"
#include "stages/data/runs.h"
#include "stages/data/status.h"
#include "stages/replay/count.h"

namespace lamina::replay {

/// The pixels of a machine, found again from its profile.
class VirtualMachine {
 public:
  /// columns, rows  of the images. errors  kVerification if the profile cannot be this job's
  static Result<VirtualMachine> build(const Machine& machine, std::uint32_t columns, std::uint32_t rows);

  const Machine& profile() const { return machine_; }

  /// Carries out the program of a layer (the whole file) and compares what it printed with the image.
  ///
  /// layer     its number, and where the build vat has to stand
  /// image     what was to be printed
  /// moved     pixels of blocked nozzles that neighbours fire instead, as recorded
  /// lost      those that nobody fires, as recorded
  /// errors    kVerification: "layer 12, swath 3, step 417: what is wrong"; a text that ends early, a word that the
  ///           dialect does not have, a nozzle that does not exist, is blocked or fires twice on a pixel, a pixel that is
  ///           not fired although a nozzle that works comes over it, one that is fired and not set, other numbers of moved
  ///           or lost pixels, a scan at which nozzles would fire too often, and where the dialect moves the machine: a
  ///           build vat at another height, another dose, a roller that does not go to its far end and back
  /// cost      O(text + drops); a bit a pixel
  Result<Count> replay(std::string_view program, const Layer& layer, const RunsView& image, std::uint64_t moved,
                       std::uint64_t lost) const;

  /// A drop: column and row of the image, sweep, step.
  struct Drop {
    std::uint32_t column, row, sweep, step, nozzle;
    std::int64_t first_line;  // of nozzle 0 in this sweep
  };
  /// Called with each drop in the order of the program.
  using Watch = std::function<void(const Drop&)>;
  /// Carries out a program without comparing. errors  as replay
  Result<Count> run(std::string_view program, std::uint32_t layer, const Watch& watch) const;

  /// Column and row of the image, in pixels and parts of them, where a nozzle is at a step of a sweep.
  std::array<double, 2> nozzle_at(std::int64_t first_line, double step, std::uint32_t nozzle) const;

 private:
  friend class Printing;
  Machine machine_;
  std::uint32_t columns_ = 0, rows_ = 0;
  double line_um_ = 0, place_um_ = 0, step_um_ = 0;
  std::uint32_t lines_ = 0, places_ = 0;
  struct Nozzle {
    std::int64_t line;           // from that of nozzle 0
    std::int64_t step_offset;    // steps behind the foremost nozzle, rounded
    double along_um, across_um;  // from the centre of its pixel when it fires
    bool blocked;
  };
  std::vector<Nozzle> nozzle_;
  std::int64_t ticks_ = 1;  // steps a pixel
};

}  // namespace lamina::replay
