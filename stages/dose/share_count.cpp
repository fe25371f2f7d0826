#include "stages/dose/share_count.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "stages/support/text/readable.h"

namespace lamina::dose {

void ShareCount::add(std::uint64_t full_voxels, std::uint64_t differs, std::uint64_t far) {
  full_voxels_ += full_voxels;
  differs_ += differs;
  far_ += far;
}

double ShareCount::differing_share() const {
  return full_voxels_ > 0 ? static_cast<double>(differs_) / static_cast<double>(full_voxels_) : 0;
}

std::string ShareCount::told(std::uint32_t levels, std::string_view as) const {
  return fmt::format(
      "{} levels come to {} full voxels, as {}; {} ({:.3f} %) half full or more are not as their centre, {} away "
      "from any boundary",
      levels, readable_count(full_voxels_), as, readable_count(differs_), 100 * differing_share(), readable_count(far_));
}

nlohmann::ordered_json ShareCount::json(std::uint32_t levels, std::string_view as) const {
  return {{"levels", levels},
          {"as", as},
          {"full_voxels", full_voxels_},
          {"half_differs", differs_},
          {"half_differs_share", differing_share()},
          {"half_far", far_}};
}

}  // namespace lamina::dose
