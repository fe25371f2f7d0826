#include "pipeline/report/powder_drops.h"

#include <fmt/format.h>

#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

double ml_of(std::uint64_t drops, double drop_pl) { return static_cast<double>(drops) * drop_pl * 1e-9; }

}  // namespace

std::string powder_text(const PowderDrops& powder, double drop_pl) {
  const std::string count = readable_count(powder.pixels);
  if (drop_pl <= 0) return fmt::format("{} of {}", count, powder.name);
  return fmt::format("{} pixels of {}: {} drops, {:.3f} ml of binder", count, powder.name, readable_count(powder.drops),
                     ml_of(powder.drops, drop_pl));
}

Json powder_json(const PowderDrops& powder, double drop_pl) {
  Json fact = {{"name", powder.name}, {"set_pixels", powder.pixels}};
  if (drop_pl <= 0) return fact;
  fact["drops"] = powder.drops;
  fact["binder_ml"] = ml_of(powder.drops, drop_pl);
  return fact;
}

}  // namespace lamina::pipeline
