#include "stages/program/vats.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "stages/data/units.h"

namespace lamina::program {
namespace {

constexpr double kStepsPerMm = 1e4;  // of numbers in programs
constexpr double kTolerance = 1e-6;  // mm
constexpr const char* kVats[] = {"first", "second"};

double as_spelt(double mm) { return std::round(mm * kStepsPerMm) / kStepsPerMm; }

}  // namespace

bool VatPlan::has_depths(const Machine& machine) {
  return std::ranges::any_of(machine.powder.vat_depth_mm, [](double mm) { return mm > 0; });
}

void VatPlan::add(const Layer& layer, std::uint32_t feeds) {
  const auto& powder = machine_.powder;
  const double share = powder.dose / (feeds == 3 ? 2 : 1);
  double takes = as_spelt(share * mm(layer.thickness));
  if (layer.index == 0) takes += powder.base_layers * as_spelt(share * powder.base_layer_mm);
  const auto lacks = [&](std::uint32_t vat) {
    return (feeds >> vat & 1) != 0 && powder.vat_depth_mm[vat] > 0 && left_[vat] + kTolerance < takes;
  };
  for (std::uint32_t vat = 0; vat < 2; ++vat) {
    if ((feeds >> vat & 1) != 0) needed_[vat] += takes;
    if (!lacks(vat) || too_small_) continue;
    too_small_ = powder.vat_depth_mm[vat] + kTolerance < takes;
    if (!empties_ || too_small_) empty_ = layer, vat_ = vat;
    empties_ = true;
    if (powder.refill == VatRefill::kRefuse) continue;
    left_ = powder.vat_depth_mm;
    refills_.push_back(layer.index);
  }
  for (std::uint32_t vat = 0; vat < 2; ++vat) {
    if ((feeds >> vat & 1) != 0) left_[vat] -= takes;
  }
}

Status VatPlan::status() const {
  const auto& powder = machine_.powder;
  if (!empties_ || (powder.refill == VatRefill::kPause && !too_small_)) return {};
  const std::string where = fmt::format("layer {} (z {:.3f} mm): the {} vat of {}, {:g} mm deep, ", empty_.index,
                                        mm(empty_.bottom), kVats[vat_], machine_.name, powder.vat_depth_mm[vat_]);
  if (too_small_) {
    return Error{Fault::kUsage, where +
                                    "holds less than this layer takes; give powder.vat_depth_mm as it is, thinner layers or "
                                    "fewer powder.base_layers"};
  }
  return Error{
      Fault::kUsage,
      where + fmt::format("is empty for it: the job takes {:g} mm, layers x dose {:g}{}; make the job lower, or let it "
                          "pause for vats to be filled with powder.refill = \"pause\"",
                          needed_[vat_], powder.dose,
                          powder.base_layers > 0 ? fmt::format(" with a base of {:g} mm", powder.base_mm()) : "")};
}

}  // namespace lamina::program
