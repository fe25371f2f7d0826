#include "stages/cost/powder_drops.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "stages/support/text/readable.h"

namespace lamina::cost {
namespace {

double ml_of(std::uint64_t drops, double drop_pl) { return static_cast<double>(drops) * drop_pl * 1e-9; }

}  // namespace

std::string PowderDrops::told(double drop_pl) const {
  const std::string count = readable_count(pixels);
  if (drop_pl <= 0) return fmt::format("{} of {}", count, name);
  return fmt::format("{} pixels of {}: {} drops, {:.3f} ml of binder", count, name, readable_count(drops),
                     ml_of(drops, drop_pl));
}

nlohmann::ordered_json PowderDrops::json(double drop_pl) const {
  nlohmann::ordered_json fact = {{"name", name}, {"set_pixels", pixels}};
  if (drop_pl <= 0) return fact;
  fact["drops"] = drops;
  fact["binder_ml"] = ml_of(drops, drop_pl);
  return fact;
}

}  // namespace lamina::cost
